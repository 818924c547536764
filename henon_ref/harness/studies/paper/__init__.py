"""The paper, section by section: every number and equation computed again and set against what is printed."""
