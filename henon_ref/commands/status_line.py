"""Status line of a terminal while libraries are imported that can show more."""

from __future__ import annotations

from henon_ref.terminal import Line

_line = Line()
show = _line.show
"""Show a text on the status line, in place of the previous one; nothing outside a terminal."""
clear = _line.end
"""Erase the status line if one is shown."""
