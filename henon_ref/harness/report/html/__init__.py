"""HTML page of a folder: a single file that contains its data, styles and scripts."""
