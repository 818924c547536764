"""Places in the arrays that the compiled loop and Python share."""

from __future__ import annotations

import ast
from collections import Counter
from pathlib import Path

from henon_ref.henon import state


def test_no_name_stands_for_two_places() -> None:
    """A tuple takes a name twice without a word, and the last place wins."""
    tree = ast.parse(Path(state.__file__).read_text(encoding="utf-8"))
    stored = [node.id for node in ast.walk(tree) if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store)]
    assert [name for name, times in Counter(stored).items() if times > 1] == []
