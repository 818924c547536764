"""What the documentation's build makes by itself: tables, lists and formulas."""
