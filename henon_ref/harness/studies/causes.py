"""Page of causes: the check of each cause is run while the page is written."""

from __future__ import annotations

import importlib.metadata

from henon_ref.baselines.causes import CAUSES, Cause, ClaimError
from henon_ref.harness.registry import program_versions
from henon_ref.harness.studies.page import write
from henon_ref.harness.studies.study import StudyRequest, StudyResult


def run_causes(request: StudyRequest) -> StudyResult:
    """Run the check of every cause and write the results."""
    shown = [{"cause": cause, "version": _version(cause.package), "seen": _seen(cause)} for cause in CAUSES.values()]
    return StudyResult(write(request.folder, "causes", {"causes": shown}))


def _version(package: str) -> str | None:
    if package in (programs := program_versions()):
        return programs[package] or None
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return None


def _seen(cause: Cause) -> str:
    """Result of the check, or a note that the library is not installed or does not behave as claimed."""
    if _version(cause.package) is None:
        return "not installed here: not checked"
    try:
        return cause.check()
    except ClaimError as error:
        return f"**not as claimed with this version**: {error}"
