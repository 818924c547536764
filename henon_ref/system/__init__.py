"""Descriptions of systems, from case files or Python, to Filippov systems, scenes and initial-value problems."""
