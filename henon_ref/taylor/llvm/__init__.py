"""Machine code of a mode's Taylor coefficients, as LLVM IR."""
