"""The compiled side of the reference, in C: the mode loop and what it calls, and runs of many points.

``kernel.h`` says what it shares with Python: structures, numbers with names, functions; ``kernel.c`` is the one
translation unit, which includes the others.
"""
