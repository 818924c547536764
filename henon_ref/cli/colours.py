"""Whether a terminal is sent colours."""

from __future__ import annotations

import os
from typing import Any


def console_colours() -> dict[str, Any]:
    """Arguments of a rich console: no style at all where ``NO_COLOR`` is set and not empty (https://no-color.org)."""
    return {"color_system": None} if os.environ.get("NO_COLOR") else {}
