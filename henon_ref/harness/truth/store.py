"""Stored truths: one JSON file per reading, one entry per line, byte-identical for equal truths.

The last entry is a checksum of all earlier ones. A file that was changed in any way is not a stored truth. The form is
strict, for a stored truth decides who is right: no text for a number, no number that is not finite, no key too many.
"""

from __future__ import annotations

import hashlib
import json
import math
import re
from decimal import Decimal
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, Literal

import platformdirs
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from henon_ref.atomic_write import replace_file
from henon_ref.harness.truth.reference import NearGraze, ReferenceTransition, Truth, TruthError, instants
from henon_ref.trajectory import Kind

_PACKAGE = Path(__file__).resolve().parents[2]

Digits = Annotated[str, Field(pattern=r"^-?[0-9]+(\.[0-9]+)?([eE][+-]?[0-9]{1,3})?$")]
"""A number in decimal digits."""
Number = Annotated[float, Field(allow_inf_nan=False)]
Size = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Count = Annotated[int, Field(ge=0)]


class _Form(BaseModel):
    model_config = ConfigDict(strict=True, extra="forbid", frozen=True)


class MethodForm(_Form):
    """One way in which the truth was computed."""

    method: str
    bits: tuple[Count, ...]
    seconds: Size


class NearGrazeForm(_Form):
    """An instant at which a surface is nearly touched."""

    time: Number
    surface: Count
    distance: Size
    lasts: bool = False


class TransitionForm(_Form):
    """One transition."""

    kind: Kind
    surface: Count
    modes: Annotated[str, Field(pattern=r"^([+-]1|0)(,([+-]1|0))* -> ([+-]1|0)(,([+-]1|0))*$")]
    """Signs before and after, such as ``+1,0 -> +1,-1``."""
    time: Digits
    radius: Size
    proven: bool
    closed_form: bool
    state: tuple[Digits, ...]
    state_radius: Size
    transversality: Size
    conditioning: Size | None
    """None: infinite."""

    @property
    def transition(self) -> ReferenceTransition:
        """The transition as the rest of the package has it."""
        before, after = (tuple(map(int, side.split(","))) for side in self.modes.split(" -> "))
        return ReferenceTransition(
            **self.model_dump(exclude={"modes", "time", "conditioning"}),
            from_mode=before,
            to_mode=after,
            time_digits=self.time,
            conditioning=math.inf if self.conditioning is None else self.conditioning,
        )


class TruthForm(_Form):
    """A stored truth."""

    form: Literal[1] = Field(alias="schema")
    case: str
    reading: str
    mathematics: str
    status: Literal["ok", "diverged", "nonunique", "invalid", "failed"]
    reason: str
    end_time: Digits
    end_radius: Size
    certified: bool
    uncertified_because: str
    methods: tuple[MethodForm, ...]
    near_grazes: tuple[NearGrazeForm, ...]
    transitions: tuple[TransitionForm, ...]
    checksum: str

    @property
    def truth(self) -> Truth:
        """The truth as the rest of the package has it."""
        return Truth(
            case=self.case,
            reading=self.reading,
            mathematics_hash=self.mathematics,
            status=self.status,
            reason=self.reason,
            end_digits=self.end_time,
            end_radius=self.end_radius,
            certified=self.certified,
            uncertified_because=self.uncertified_because,
            transitions=tuple(entry.transition for entry in self.transitions),
            near_grazes=tuple(NearGraze(**graze.model_dump()) for graze in self.near_grazes),
            methods=tuple((m.method, m.bits, m.seconds) for m in self.methods),
        )


class StoredTruthError(TruthError):
    """The file of a truth is unusable: damaged, edited, of another case, or unreadable.

    ``content``: content of the file if it can be parsed; for comparison, never for scoring.
    """

    def __init__(self, path: Path, reason: str, content: Truth | None = None) -> None:
        super().__init__(f"{path} is no stored truth ({reason}); delete it and run henon-ref truth")
        self.reason = reason
        self.content = content


def folder_of(case_file: Path | None) -> Path:
    """Return the folder of a case file's truths.

    ``cases/truth`` for a case below a folder ``cases``, else the user's cache, so that no files appear next to a
    user's own case file.
    """
    if case_file is not None:
        for parent in case_file.resolve().parents:
            if parent.name == "cases":
                return parent / "truth"
    return user_folder()


def folder_for_new(case_file: Path | None) -> Path:
    """Folder for a new truth of a case file: as :func:`folder_of`, but never inside an installed package."""
    folder = folder_of(case_file)
    return user_folder() if inside_package(folder) else folder


def inside_package(folder: Path) -> bool:
    """Whether a folder is part of the package, as the truths of the shipped cases in an installed wheel are."""
    return folder.resolve().is_relative_to(_PACKAGE)


def user_folder() -> Path:
    """Folder of truths that are not stored next to their case."""
    return Path(platformdirs.user_cache_dir("henon_ref")) / "truth"


def path_of(folder: Path, case: str, reading: str) -> Path:
    return folder / case / f"{reading}.json"


def load(folder: Path, case: str, reading: str) -> Truth | None:
    """Return the stored truth, regardless of its mathematics; None if there is none.

    StoredTruthError if the file was not written by this package for this reading; the message says how to recompute it.
    """
    path = path_of(folder, case, reading)
    try:
        text = path.read_text(encoding="utf-8")
        truth = _parse(text)
    except (FileNotFoundError, NotADirectoryError):
        return None
    except OSError as error:
        raise StoredTruthError(path, error.strerror or "cannot be read") from error
    except ValueError as error:
        raise StoredTruthError(path, " ".join(str(error).split())) from error
    if (truth.case, truth.reading) != (case, reading):
        raise StoredTruthError(path, f"it is that of {truth.case}, {truth.reading}")
    if _checked(text) != text:
        raise StoredTruthError(path, "its checksum does not fit its content", truth)
    return truth


def _parse(text: str) -> Truth:
    """The truth that a text of this form holds, whether or not its checksum fits; ValueError for any other text."""
    try:
        truth = TruthForm.model_validate_json(text).truth
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        place = ".".join(str(part) for part in first["loc"])
        raise ValueError(f"{place}: {first['msg']}" if place else first["msg"]) from None
    if contradiction := _contradiction(truth):
        raise ValueError(contradiction)
    return truth


def _contradiction(truth: Truth) -> str:
    """What does not fit together; empty where everything does."""
    surfaces = {len(mode) for t in truth.transitions for mode in (t.from_mode, t.to_mode)}
    if len(surfaces) > 1 or len({len(t.state) for t in truth.transitions}) > 1:
        return "modes or states of different lengths"
    for index, t in enumerate(truth.transitions):
        if t.surface >= len(t.to_mode):
            return f"transition {index}: surface {t.surface} of {len(t.to_mode)}"
    groups = [truth.transitions[indices.start] for indices in instants(truth.transitions)]
    for earlier, later in pairwise(groups):
        if Decimal(later.time_digits) < Decimal(earlier.time_digits):
            return f"the transition at t = {later.time:g} stands behind a later one"
        if later.from_mode != earlier.to_mode:
            return f"the transition at t = {later.time:g} does not begin in the mode that the one before leads to"
    if groups and Decimal(groups[-1].time_digits) > Decimal(truth.end_digits):
        return "a transition beyond the end"
    if truth.certified and truth.proven < len(truth.transitions):
        return "certified, though not every transition is proven"
    return ""


def save(folder: Path, truth: Truth) -> Path:
    """Store a truth; the file is written completely or not at all. OSError if the folder cannot be written."""
    path = path_of(folder, truth.case, truth.reading)
    if folder == user_folder():  # its parent also holds compiled code, which is not used if others can write there
        folder.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
    path.parent.mkdir(parents=True, exist_ok=True)
    replace_file(path, dumps(truth).encode())
    return path


def dumps(truth: Truth) -> str:
    """Return a truth as JSON: keys in a fixed order, one entry per line."""
    whole = {
        "schema": 1,
        "case": truth.case,
        "reading": truth.reading,
        "mathematics": truth.mathematics_hash,
        "status": truth.status,
        "reason": truth.reason,
        "end_time": truth.end_digits,
        "end_radius": truth.end_radius,
        "certified": truth.certified,
        "uncertified_because": truth.uncertified_because,
        "methods": [{"method": m, "bits": list(b), "seconds": round(s, 1)} for m, b, s in truth.methods],
        "near_grazes": [
            {"time": g.time, "surface": g.surface, "distance": g.distance} | ({"lasts": True} if g.lasts else {})
            for g in truth.near_grazes
        ],
        "transitions": [_entry(t) for t in truth.transitions],
    }
    whole["checksum"] = "0" * 64
    return _checked(json.dumps(whole, indent=1, ensure_ascii=False, allow_nan=False) + "\n")


def _checked(text: str) -> str:
    """Insert the checksum into the text of a stored truth: SHA-256 of the text without the checksum."""
    found = re.search(r'(?<=\n "checksum": ")[0-9a-f]{64}(?="\n\}\n\Z)', text)
    if found is None:
        return ""
    before, after = text[: found.start()], text[found.end() :]
    return before + hashlib.sha256((before + after).encode()).hexdigest() + after


def _entry(t: ReferenceTransition) -> dict[str, Any]:
    return {
        "kind": t.kind,
        "surface": t.surface,
        "modes": " -> ".join(",".join(f"{s:+d}" if s else "0" for s in m) for m in (t.from_mode, t.to_mode)),
        "time": t.time_digits,
        "radius": t.radius,
        "proven": t.proven,
        "closed_form": t.closed_form,
        "state": list(t.state),
        "state_radius": t.state_radius,
        "transversality": t.transversality,
        "conditioning": t.conditioning if math.isfinite(t.conditioning) else None,
    }
