"""Commands that do not need the harness, and the exit statuses of all commands of this package."""
