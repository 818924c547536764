"""The harness on top of the library: solvers side by side, scored against a truth; reports, a gate, studies."""
