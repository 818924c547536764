"""The compiled side of the reference, in C: sources, how they are compiled, and how their library is loaded."""
