"""A folder's page: one file with its data, its style and its script in it."""
