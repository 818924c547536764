"""The commands that need no harness, and how every command of this package ends."""
