"""The build backend that pyproject.toml names: setuptools', with the libraries in C (PEP 517 and 660).

``python -m build_backend`` compiles the libraries anew in the tree.
"""

from __future__ import annotations
