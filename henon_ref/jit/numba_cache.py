"""numba's cache of compiled functions, with checksums: what is damaged is compiled anew, never loaded.

numba itself unpickles, and runs, whatever bytes it finds; and a file that cannot be read or written fails the call.
"""

from __future__ import annotations

import inspect
import pickle
import sys
from functools import cache
from hashlib import sha256
from pathlib import Path
from typing import Any

from numba.core.caching import CompileResultCacheImpl, FunctionCache, IndexDataCacheFile

from henon_ref.jit.cache_files import DamagedError, make_folder, read, set_aside, write
from henon_ref.jit.cache_folder import note_unwritten


class CheckedCache(FunctionCache):
    """The cache of one function: an index of the types that it is compiled for, and a file for each.

    Parameters
    ----------
    function : callable
        As written in Python.
    folder : Path
        Where its files are; made when something is written.
    """

    def __init__(self, function: Any, folder: Path) -> None:
        self._name = repr(function)
        self._py_func = function
        self._impl = _Results(function, folder)
        self._cache_path = str(folder)
        self._cache_file = _CheckedFiles(self._cache_path, self._impl.filename_base, _stamp(inspect.getfile(function)))
        self.enable()

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """The function compiled for a signature; None where it is not there, or anything is wrong with it."""
        target_context.refresh()
        try:
            return self._load_overload(sig, target_context)
        except MemoryError:  # no fault of the file's
            raise
        except Exception as error:  # noqa: BLE001 - what another version wrote may raise anything when it is unpickled
            set_aside(Path(self._cache_path), error)
            return None

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keep what was compiled, where it can be."""
        try:
            self._save_overload(sig, data)
        except DamagedError as error:
            set_aside(Path(self._cache_path), error)
        except OSError as error:
            note_unwritten(error)


class _Results(CompileResultCacheImpl):
    """What is kept of a function, and under which name."""

    def __init__(self, function: Any, folder: Path) -> None:
        self._lineno = function.__code__.co_firstlineno
        self._locator = _Place(function, folder)
        name = f"{function.__module__}.{function.__qualname__}"
        self._filename_base = self.get_filename_base(name, getattr(sys, "abiflags", ""))


class _Place:
    """Where numba finds a function's files: it tries no other folder where this one cannot be written."""

    def __init__(self, function: Any, folder: Path) -> None:
        self._py_file = inspect.getfile(function)
        self._line = str(function.__code__.co_firstlineno)
        self._folder = folder

    def get_disambiguator(self) -> str:
        return self._line

    def ensure_cache_path(self) -> None:
        make_folder(self._folder)


class _CheckedFiles(IndexDataCacheFile):
    """Index and files of one function, each with a checksum.

    A file's name tells what is in it: processes that compile a function for other types do not write the same one.
    """

    def save(self, key: Any, data: Any) -> None:
        name = f"{Path(self._index_path).stem}.{sha256(repr((self._source_stamp, key)).encode()).hexdigest()[:16]}.nbc"
        self._save_data(name, data)
        self._save_index({**self._load_index(), key: name})

    def load(self, key: Any) -> Any:
        name = self._load_index().get(key)
        return None if name is None else self._load_data(name)

    def _load_index(self) -> dict[Any, str]:
        stamp, overloads = self._read(self._index_path) or (None, {})
        return overloads if stamp == self._source_stamp else {}

    def _save_index(self, overloads: dict[Any, str]) -> None:
        write(Path(self._index_path), self._dump((self._source_stamp, overloads)))

    def _load_data(self, name: str) -> Any:
        return self._read(self._data_path(name))

    def _save_data(self, name: str, data: Any) -> None:
        write(Path(self._data_path(name)), self._dump(data))

    @staticmethod
    def _read(path: str) -> Any:
        content = read(Path(path))
        return None if content is None else pickle.loads(content)


@cache
def _stamp(source: str) -> str:
    """What tells one text of a source file from another."""
    return sha256(Path(source).read_bytes()).hexdigest()
