"""Commands: arguments, exit statuses, what the terminal is shown."""
