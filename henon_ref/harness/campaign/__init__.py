"""A campaign: which solver runs which reading, the worker pool, the journal, timing, rows."""
