"""Commands of the harness: arguments, exit statuses and terminal output."""
