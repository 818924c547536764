"""The reference against its rivals, timed in turn on every reading."""
