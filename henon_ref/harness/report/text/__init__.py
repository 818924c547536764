"""Reports as markdown."""
