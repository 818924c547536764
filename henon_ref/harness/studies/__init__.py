"""Studies: programs that use the library as a user would, each with a page under reports/."""
