"""Check a tree against the case file's form; what does not fit is told by its line and column."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, TypeVar, get_args

from pydantic import ValidationError

from henon_ref.casefile.model_form import FEW, LIST, MAPPING, NAMED, given
from henon_ref.casefile.schema import CaseForm, Form
from henon_ref.casefile.tree import MappingNode, Node, Place, child, locate, to_python
from henon_ref.errors import CaseError
from henon_ref.text import did_you_mean, listed

AnyForm = TypeVar("AnyForm", bound=Form)


def validated(tree: MappingNode, *, file: str | None, within: str = "") -> CaseForm:
    """Check the form of one case (or of one of its readings, overrides laid over).

    Raises
    ------
    CaseError
        At the line and column of the first key or value that does not fit.
    """
    return validated_as(CaseForm, tree, file=file, within=within)


def validated_as(form: type[AnyForm], tree: MappingNode, *, file: str | None, within: str = "") -> AnyForm:
    """Check the form of any file.

    Raises
    ------
    CaseError
        At the line and column of the first key or value that does not fit.
    """
    try:
        return form.model_validate(to_python(tree))
    except ValidationError as error:
        raise _first(form, tree, error.errors(include_url=False), file, within) from None


def _first(form: type[Form], tree: MappingNode, items: Sequence[Any], file: str | None, within: str) -> CaseError:
    """The first of pydantic's errors."""
    found = [(item["type"] == "missing", *_explained(form, tree, item)) for item in items]
    # A misspelt key is unknown and missing at once; only the first is of use.
    _, place, message = min(found, key=lambda item: (item[0], item[1].line, item[1].column))
    return CaseError(message + within, file=file, line=place.line, column=place.column)


def _explained(whole: type[Form], tree: Node, error: dict[str, Any]) -> tuple[Place, str]:
    """Place and message of one pydantic error."""
    path = [part for part in error["loc"] if part != "[key]"]
    kind = error["type"]
    if not path:
        return tree.place, str(error["ctx"]["error"]) if kind == "value_error" else error["msg"]
    form = _form_at(whole, path[:-1])
    name = f"'{path[-1]}'" if isinstance(path[-1], str) else "an entry"
    where = f" in '{path[-2]}'" if len(path) > 1 and isinstance(path[-2], str) else ""
    if kind == "extra_forbidden":
        known = _keys(form)
        text = f"unknown key {name}{where}{did_you_mean(str(path[-1]), known)}; allowed: {listed(known)}"
        if path == ["points"]:
            text += " (a sweep file is run by henon-ref sweep)"
        return locate(tree, path, key=True), text
    if kind == "missing":
        return locate(tree, path[:-1], key=True), f"the key {name} is missing{where}"
    message = _MESSAGES.get(kind)
    if kind == "value_error":
        message = str(error["ctx"]["error"])
    elif kind == "literal_error":
        message = f"must be {error['ctx']['expected']}"
    elif kind == "too_long":
        message = f"may have at most {error['ctx']['max_length']} entries"
    elif message is None:
        message = error["msg"]
    node = None if kind in ("value_error", "too_short", "too_long") else child(tree, path)
    return locate(tree, path), f"{name}{where}: {message}{given(node) if node is not None else ''}"


_MESSAGES = {
    "list_type": LIST,
    "dict_type": NAMED,
    "model_type": MAPPING,
    "model_attributes_type": MAPPING,
    "too_short": FEW,
}


def _form_at(form: type[Form], path: list[Any]) -> type[Form]:
    """The form that a path leads into."""
    for part in path:
        for key, info in form.model_fields.items():
            if part in (key, info.alias):
                found = _form_in(info.annotation)
                form = found or form
    return form


def _form_in(annotation: Any) -> type[Form] | None:
    if isinstance(annotation, type) and issubclass(annotation, Form):
        return annotation
    for inner in get_args(annotation):
        found = _form_in(inner)
        if found is not None:
            return found
    return None


def _keys(form: type[Form]) -> list[str]:
    keys = [info.alias or key for key, info in form.model_fields.items()]
    return [*keys, "readings"] if form is CaseForm else keys
