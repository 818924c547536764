"""Validated integration of Filippov systems in ball arithmetic.

Every step of a run is a proof: the solution exists and its Taylor tail is bounded (``tail_bounds``), no guard falls
before the one claimed (``event``), that one falls once (interval Newton), the mode that follows is decided by strict
signs or exact zeros (``mode_selection``), and the set of possible states is carried along without wrapping
(``lohner``). What cannot be proven is said to be so, with the reason.
"""
