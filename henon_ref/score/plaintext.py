"""Words from outside (a solver's, a library's) as one line of text that every file of a report can hold."""

from __future__ import annotations

LONGEST = 500
"""Characters that are kept."""
ELLIPSIS = "..."


def plain_text(words: str) -> str:
    """One line of printable text, as an exact ``str``, cut to ``LONGEST`` characters.

    Lone surrogates, which no file can be written with, become replacement characters; line breaks, control
    characters and whatever else does not print become spaces, and spaces in a row become one.

    Examples
    --------
    >>> plain_text("no\\r\\n\\tconvergence\\x1b[0m"), plain_text("at \\udcff")
    ('no convergence [0m', 'at \\ufffd')
    """
    text = str.__str__(words)
    if not text.isprintable():
        text = "".join(c if c.isprintable() else "\ufffd" if "\ud800" <= c <= "\udfff" else " " for c in text)
    text = " ".join(text.split())
    return text if len(text) <= LONGEST else text[: LONGEST - len(ELLIPSIS)] + ELLIPSIS
