"""Commands that do not need the harness, and the exit statuses of all commands of this package."""

from henon_ref.terminal import Line

status_line = Line()
"""Status line of a terminal while libraries are imported that can show more."""
