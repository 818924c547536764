"""Escapes for text from outside (case files, solvers, file names), one function for each kind of output.

:func:`message` is for a terminal, :func:`markdown` and :func:`code` for a page (their results are safe in HTML, too),
:func:`html` for a notebook, :func:`cell` for a spreadsheet.
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Collection
from difflib import get_close_matches
from html import escape

LONGEST_LINE = 2000
"""Largest number of characters of a line on a terminal."""
ELLIPSIS = " ... "
LONGEST_REASON = 500
"""Largest number of characters of a message of a solver or library in a file of results."""
_LITERAL = "'"
"""Prefix by which a spreadsheet takes a cell as text."""
# Text that markdown turns into links, and code; neither may contain characters that end it or begin a tag.
_KEPT = re.compile(
    r"(?P<code>`[^`<>&|]+`)|(?P<address>(?:[A-Za-z][A-Za-z0-9+.-]{0,20}://|(?i:www\.|mailto:|xmpp:))[^\s`<>&|]*"
    r"|[^\s`<>&|@]{1,64}@[^\s`<>&|@]{1,255})"
)


def printable(text: str) -> str:
    """Replace characters that do not print: control characters, escapes, marks that change the direction of writing.

    Lone surrogates, which cannot be written to a file, become replacement characters; each other character a space.

    >>> printable("no\\x1b[0m \\u202eway \\x9b1m"), printable("at \\udcff")
    ('no [0m  way  1m', 'at \\ufffd')
    """
    exact = str.__str__(text)
    if exact.isprintable():
        return exact
    return "".join(c if c.isprintable() else "\ufffd" if "\ud800" <= c <= "\udfff" else " " for c in exact)


def one_line(text: str) -> str:
    """Return printable text in one line, with runs of blanks as one blank."""
    return " ".join(printable(text).split())


def short_line(text: str) -> str:
    """One line for a file of results, as an exact ``str`` of at most ``LONGEST_REASON`` characters.

    >>> short_line("no\\r\\n\\tconvergence\\x1b[0m"), short_line("at \\udcff")
    ('no convergence [0m', 'at \ufffd')
    """
    line = one_line(text)
    return line if len(line) <= LONGEST_REASON else line[: LONGEST_REASON - 3] + "..."


def message(text: str) -> str:
    """One line for a terminal; the middle of a long line is left out.

    >>> message("bad key\\n'\\x1b[31mred'"), len(message("x" * 60_000))
    ("bad key ' [31mred'", 2000)
    """
    line = one_line(text)
    if len(line) <= LONGEST_LINE:
        return line
    tail = LONGEST_LINE // 4
    return line[: LONGEST_LINE - tail - len(ELLIPSIS)] + ELLIPSIS + line[-tail:]


def markdown(text: str) -> str:
    """One line of text that a page shows literally: no part becomes a tag, link, image, formula or list.

    Short code between backticks stays code; addresses become code, so that they are not links.

    >>> markdown("a_b [x](http://a.b/c) <img src=x> `x = 1`")
    'a_b \\\\[x\\\\]\\\\(`http://a.b/c)` &lt;img src=x&gt; `x = 1`'
    >>> markdown("# one"), markdown("1. one"), markdown("_one_ $x$")
    ('\\\\# one', '1\\\\. one', '\\\\_one\\\\_ \\\\$x\\\\$')
    """
    line, shown, end = one_line(text), [], 0
    for found in _KEPT.finditer(line):
        shown.append(_escaped(line[end : found.start()]))
        shown.append(found["code"] or f"`{found['address']}`")
        end = found.end()
    escaped = "".join([*shown, _escaped(line[end:])])
    return re.sub(r"^(#{1,6}|[-+=]+|\d{1,9}(?=[.)]))(?=[.)]?(\s|$))", _first_escaped, escaped)


def _escaped(text: str) -> str:
    """Escape marks of markdown (an underscore within a word is no mark) by a backslash, those of HTML as entities."""
    marked = re.sub(r"[\\`*\[\]~$]|(?<=\])\(|(?<![A-Za-z0-9])_|_(?![A-Za-z0-9])", r"\\\g<0>", text)
    return escape(marked, quote=False)


def _first_escaped(found: re.Match[str]) -> str:
    return f"{found[0]}\\" if found[0].isdigit() else f"\\{found[0]}"


def paragraphs(text: str) -> str:
    """Several lines of text for a page, each by :func:`markdown`; empty lines separate paragraphs."""
    return "\n".join(markdown(line) for line in text.strip().split("\n"))


def code(text: str) -> str:
    """A name as code, or as text if it contains characters that backticks cannot hold.

    >>> code("scipy-rk45"), code("a`<b>")
    ('`scipy-rk45`', 'a\\\\`&lt;b&gt;')
    """
    line = one_line(text)
    return f"`{line}`" if line and not set(line) & set("`<>&|") else markdown(line)


def html(text: str) -> str:
    """One line of text that a notebook shows literally: no part becomes a tag or a formula.

    Formula delimiters are in elements of their own, since formulas are not searched across elements.

    >>> html("a <b> & $x$"), html("\\\\(x\\\\)")
    ('a &lt;b&gt; &amp; <span>$</span>x<span>$</span>', '<span>\\\\</span>(x<span>\\\\</span>)')
    """
    return re.sub(r"[$\\]", r"<span>\g<0></span>", escape(one_line(text)))


def link(address: str) -> str:
    """Return a plain web address unchanged, and other text by :func:`markdown`.

    >>> link("https://doi.org/10.1/x(1)"), link("javascript:alert(1)"), link("http://a/![x](y)")
    ('https://doi.org/10.1/x(1)', 'javascript:alert(1)', '`http://a/![x](y)`')
    """
    plain = r"https?://[A-Za-z0-9.-]+(?:[:/?#][A-Za-z0-9._~:/?#@!&'()+,;=%-]*)?"
    return address if re.fullmatch(plain, address) else markdown(address)


def cell(text: str) -> str:
    """Text of a table cell that no spreadsheet takes as a formula; numbers stay unchanged, whatever their sign.

    >>> cell("=1+1"), cell("-x"), cell("-1"), cell("s=-1")
    ("'=1+1", "'-x", '-1', 's=-1')
    """
    line = printable(text)
    is_formula = line.lstrip(f" {_LITERAL}").startswith(tuple("=+-@\t\r\n＝＋－＠"))
    return _LITERAL + line if is_formula and not _is_number(line) else line


def from_cell(text: str) -> str:
    """Return the text from which :func:`cell` made a cell."""
    return text[1:] if text.startswith(_LITERAL) and cell(text[1:]) == text else text


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def spelled(name: str) -> str:
    """Return a name with its Greek letters spelled out.

    >>> spelled("θ_1"), spelled("Δx"), spelled("v")
    ('theta_1', 'Deltax', 'v')
    """
    return "".join(c if c.isascii() else _letter(c) for c in name)


def _letter(character: str) -> str:
    words = unicodedata.name(character, character).split()
    word = words[-1].lower()
    return word.capitalize() if "CAPITAL" in words else word


def did_you_mean(word: str, known: Collection[str]) -> str:
    """``"; did you mean 'x'?"`` with the most similar known word, or an empty string."""
    matches = [k for k in known if k.lower() == word.lower()]
    if not matches and len(word) > 2:
        matches = get_close_matches(word, list(known), n=1, cutoff=0.6)
    return f"; did you mean '{matches[0]}'?" if matches else ""


def listed(words: Collection[str], limit: int = 24) -> str:
    """Words separated by commas; a long list is cut."""
    shown = list(words)[:limit]
    more = len(words) - len(shown)
    return ", ".join(shown) + (f" and {more} more" if more > 0 else "")


def shortened(text: str, limit: int = 60) -> str:
    """User text, quoted and cut to fit one line of a message."""
    return repr(text if len(text) <= limit else text[: limit - 3] + "...")
