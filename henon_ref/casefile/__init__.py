"""Reading case files: YAML, keys and values, readings, expected results.

A fault in a file raises :class:`~henon_ref.errors.CaseError` with its line and column.
"""
