"""Which solvers run which readings at which settings, in worker processes; their rows, and a journal of them."""

WORKERS_NEED = (
    "henon_ref.baselines.henon",
    "henon_ref.harness.campaign.run_jobs",
    "henon_ref.harness.campaign.truth_job",
)
"""Modules that every worker of a comparison imports."""
DRAWING_NEEDS = ("henon_ref.harness.report.figure_jobs", "matplotlib.mathtext")
"""Modules that those import which draw figures."""
