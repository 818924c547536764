"""Programs of Olejnik and Awrejcewicz (2013): the method of the paper, implemented correctly (``henon-rk4``), and the
appendix as printed (``henon-listing``).

The loops are C. ``paper.h`` declares the functions; :mod:`henon_ref.baselines.paper.compiled` loads them.
"""
