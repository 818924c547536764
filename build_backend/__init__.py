"""Builds this project: the backend that pyproject.toml names."""
