"""Reading case files: YAML, keys and values, expressions, scenes.

A fault in a file raises :class:`~henon_ref.errors.CaseError` with its line and column; a fault in an expression that is
in no file raises :class:`~henon_ref.errors.ExpressionError` with its offset in the text.
"""
