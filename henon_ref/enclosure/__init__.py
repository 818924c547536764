"""Validated integration of Filippov systems in ball arithmetic.

Every step of a run is a proof: the solution exists and its Taylor remainder is bounded (``tail_bounds``); no guard
has a root before the located one (``event``); the located root is unique (interval Newton); the next mode is decided
by strict signs or exact zeros (``mode_selection``); and Lohner's method encloses the set of possible states without
the wrapping effect (``lohner``). A run that cannot be proven further stops and states the reason.
"""
