"""Campaigns: run solvers on readings at several settings in worker processes, and keep a journal of the rows."""

WORKERS_NEED = ("henon_ref.baselines.henon", "henon_ref.harness.campaign.jobs")
"""Modules that every worker of a comparison imports before its first job."""
DRAWING_NEEDS = ("henon_ref.harness.report.svg", "matplotlib.mathtext")
"""Modules that a worker imports if it draws figures."""
