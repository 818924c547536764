"""What each package is that solvers come from: its address, and a line on it."""

from __future__ import annotations

PROJECTS = {
    "henon-ref": ("", "Taylor method with Hénon's landing, and the paper's own programs; this project"),
    "heyoka": ("https://bluescarni.github.io/heyoka.py/", "Taylor integrator, compiled by LLVM, with event detection"),
    "scikit-sundae": ("https://github.com/NREL/scikit-sundae", "CVODE and IDA of SUNDIALS, called from Python"),
    "scipy": ("https://docs.scipy.org/doc/scipy/tutorial/integrate.html", "solve_ivp, what most people begin with"),
    "sundials": ("https://computing.llnl.gov/projects/sundials", "CVODE from C, all callbacks compiled"),
    "octave": ("https://octave.org", "ode45 of GNU Octave, written as for MATLAB"),
    "siconos": (
        "https://nonsmooth.gricad-pages.univ-grenoble-alpes.fr/siconos/",
        "time stepping for nonsmooth systems",
    ),
    "diffrax": ("https://docs.kidger.site/diffrax/", "solvers for JAX, with events"),
    "pydiffsol": ("https://github.com/martinjrobins/diffsol", "diffsol, solvers in Rust with their own language"),
    "nosnoc": ("https://github.com/nosnoc/nosnoc_py", "time stepping with switch detection, by optimization"),
}
"""Package, or program -> (address, line); no address for this one."""
