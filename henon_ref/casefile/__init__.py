"""What a case file may say: YAML, its form, expressions, scenes and their effects.

What cannot be used is told by a :class:`~henon_ref.errors.CaseError` with its line and column (by an
:class:`~henon_ref.errors.ExpressionError` with its offset, where an expression stands in no file).
"""
