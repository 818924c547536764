"""Words from outside (a solver's, a library's) as one line of text that every file of a report can hold."""

from __future__ import annotations

from henon_ref.text import one_line

LONGEST = 500
"""Characters that are kept."""
ELLIPSIS = "..."


def plain_text(words: str) -> str:
    """One line of printable text, as an exact ``str``, cut to ``LONGEST`` characters.

    See :func:`henon_ref.text.one_line` for what becomes of the rest.

    Examples
    --------
    >>> plain_text("no\\r\\n\\tconvergence\\x1b[0m"), plain_text("at \\udcff")
    ('no convergence [0m', 'at \\ufffd')
    """
    text = one_line(words)
    return text if len(text) <= LONGEST else text[: LONGEST - len(ELLIPSIS)] + ELLIPSIS
