"""The paper's own programs: its method done right (``henon-rk4``), and its appendix as printed (``henon-listing``).

Olejnik and Awrejcewicz (2013). Their loops are C: ``paper.h`` says what there is,
:mod:`henon_ref.baselines.paper.compiled` loads it.
"""
