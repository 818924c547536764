"""Methods whose results each object caches; ``functools.cache`` would keep the object itself alive."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from functools import wraps
from typing import Any, TypeVar, cast

Method = TypeVar("Method", bound=Callable[..., Any])


def cached_method(method: Method) -> Method:
    """Decorate a method so that each object caches its results, by positional arguments."""

    @wraps(method)
    def of(self: Any, *arguments: Hashable) -> Any:
        known: dict[Hashable, Any] = self.__dict__.setdefault("_cached_results", {})
        key = method.__qualname__, arguments
        if key not in known:
            known[key] = method(self, *arguments)
        return known[key]

    return cast(Method, of)
