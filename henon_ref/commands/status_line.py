"""What a terminal shows while the libraries are imported that can show more: one line, taken back before the next."""

from __future__ import annotations

from henon_ref.terminal import Line

_line = Line()
"""There is one terminal, and it has one line that the cursor is in."""
show = _line.show
"""Show on a terminal what is being done, in place of what was shown before; elsewhere nothing."""
clear = _line.end
"""Take the line back, where one is shown."""
