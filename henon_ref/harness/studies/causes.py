"""Page of causes: the check of each cause is run while the page is written."""

from __future__ import annotations

from henon_ref.baselines.causes import CAUSES, Cause, ClaimError
from henon_ref.harness.registry import program_versions
from henon_ref.harness.studies.page import write
from henon_ref.harness.studies.study import StudyRequest, StudyResult
from henon_ref.workers.machine import library_versions


def run_causes(request: StudyRequest) -> StudyResult:
    """Run the check of every cause and write the results."""
    versions = library_versions(tuple(cause.package for cause in CAUSES.values())) | program_versions()
    shown = [
        {"cause": cause, "version": versions[cause.package], "seen": _seen(cause, versions[cause.package])}
        for cause in CAUSES.values()
    ]
    return StudyResult(write(request.folder, "causes", {"causes": shown}))


def _seen(cause: Cause, version: str) -> str:
    """Result of the check, or a note that the library is not installed or does not behave as claimed."""
    if not version:
        return "not installed here: not checked"
    try:
        return cause.check()
    except ClaimError as error:
        return f"**not as claimed with this version**: {error}"
