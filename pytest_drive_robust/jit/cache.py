"""The cache of the machine code of entry points, keyed by everything that decides the code.

numba's own cache identifies a function by the path of its file and, in older releases, by the file's time. This cache
takes the digest of its content (`content`). So code that was compiled from the same source on the same kind of machine
is found from any checkout, image or CI cache, and no other code is.

numba writes each file whole (to another name, then renamed), so that processes may share the folder. The files are in
`NUMBA_CACHE_DIR` where that is set, else in the user's cache folder; files that nobody used for two months are removed.
"""

from __future__ import annotations

import hashlib
import os
import sys
import tempfile
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

import numba
from numba.core.caching import CompileResultCacheImpl, FunctionCache, IndexDataCacheFile
from numba.core.runtime import rtsys

from pytest_drive_robust.jit.content import content_digest

_UNUSED_S = 60 * 24 * 3600.0


def cache_folder() -> Path:
    """Return the folder of the machine code, which may not yet be there."""
    if numba.config.CACHE_DIR:
        return Path(numba.config.CACHE_DIR) / "pytest-drive-robust"
    return _user_cache() / "pytest-drive-robust" / "kernels"


def _user_cache() -> Path:
    if os.environ.get("XDG_CACHE_HOME"):
        return Path(os.environ["XDG_CACHE_HOME"])
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA") or Path.home())
    try:
        home = Path.home()
    except RuntimeError:  # a container gives neither HOME nor an entry for its user
        return Path(tempfile.gettempdir())
    with suppress(ImportError, KeyError):
        import pwd  # not on Windows

        listed = Path(pwd.getpwuid(os.getuid()).pw_dir)
        home = listed if os.access(listed, os.W_OK) else home  # tests change HOME, and would compile anew each time
    return home / ("Library/Caches" if sys.platform == "darwin" else ".cache")


def _fields(one: Any) -> Any:
    """Return the names of the fields of a type and of its parts, in their order.

    numba's text of a tuple type lacks these names, but machine code reads a field by its place.
    """
    if hasattr(one, "field_dict"):
        return [(name, _fields(part)) for name, part in one.field_dict.items()]
    return getattr(one, "fields", ()), [_fields(part) for part in getattr(one, "types", ())]


class _Locator:
    """Tells numba's cache where to look for one function (see `numba.core.caching._CacheLocator`)."""

    def __init__(self, function: Any) -> None:
        self._digest = content_digest(function)

    @classmethod
    def from_function(cls, function: Any, file: str) -> _Locator:
        """Return the locator of a function; `file` is not used."""
        return cls(function)

    def get_cache_path(self) -> str:
        """Return the path of the cache folder."""
        return str(cache_folder())

    def get_source_stamp(self) -> str:
        """Return the digest of the function: cached code with another digest is outdated."""
        return self._digest

    get_disambiguator = get_source_stamp  # tells apart functions of the same name: several versions live together

    def ensure_cache_path(self) -> None:
        """Make the cache folder and remove files unused for two months. Raises `OSError` where that is not possible."""
        folder = cache_folder()
        folder.mkdir(parents=True, exist_ok=True)
        oldest = time.time() - _UNUSED_S
        for file in folder.iterdir():
            with suppress(OSError):
                if file.stat().st_mtime < oldest:
                    file.unlink()


class _Implementation(CompileResultCacheImpl):  # type: ignore[misc]
    _locator_classes = (_Locator,)


class KernelCache(FunctionCache):  # type: ignore[misc]
    """The cache of one entry point, opened on first use, when all functions that the entry point calls are defined.

    Each signature and kind of processor has its own pair of files: processes that compile for different signatures or
    processors at the same time never write to the same file.
    """

    _impl_class = _Implementation

    def __init__(self, function: Any) -> None:
        self._function = function
        self._known = False

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Return the compiled code for a signature, or None; a file that cannot be read counts as missing."""
        rtsys.initialize(target_context)
        try:
            self._open(sig, target_context.codegen())
            found = self._load_overload(sig, target_context)
        except Exception:  # whatever unpickling a broken file raises
            with suppress(OSError):
                os.unlink(self._cache_file._index_path)
            return None
        if found is not None:
            with suppress(OSError):
                for file in (self._cache_file._index_path, self._cache_file._data_path(self._cache_file._data_name(1))):
                    os.utime(file)
        return found

    def save_overload(self, sig: Any, data: Any) -> None:
        """Write compiled code to the cache; do nothing where the folder cannot be written."""
        self._open(sig, data.codegen)
        with suppress(OSError):
            super().save_overload(sig, data)

    def holds(self, sig: Any, target_context: Any) -> bool:
        """Return whether there is compiled code for a signature."""
        try:
            self._open(sig, target_context.codegen())
            return self._cache_file.load(self._index_key(sig, target_context.codegen())) is not None
        except Exception:
            return False

    @property
    def cache_path(self) -> str:
        """The path of the cache folder."""
        return str(cache_folder())

    def _open(self, sig: Any, codegen: Any) -> None:
        """Choose the files of a signature."""
        if not self._known:
            super().__init__(self._function)
            self._known = True
        types = getattr(sig, "args", sig)  # a `cfunc` has a signature, an entry point the types of its arguments
        content = repr((self._index_key(sig, codegen), [_fields(one) for one in types]))
        key = hashlib.blake2b(content.encode(), digest_size=6).hexdigest()
        self._cache_file = IndexDataCacheFile(
            cache_path=self._cache_path,
            filename_base=f"{self._impl.filename_base}-{key}",
            source_stamp=self._impl.locator.get_source_stamp(),
        )
