"""Finds the files that hold the code of a class or function, and computes one digest of their content.

The files are those of its top-level package (or its single file), and, in turn, of every module they import that is no
installed distribution. Installed distributions count by name and version, the standard library by the version of
Python, unless the author declares that no library decides what the code computes, or which libraries do. Imports are
found by reading the source, not by running it: an import inside a function counts, an import by a computed name does
not.
"""

from __future__ import annotations

import functools
import hashlib
import inspect
import os
import sys
from collections.abc import Iterable
from pathlib import Path
from types import FunctionType, ModuleType

from pytest_drive_robust.runner.cache_key import distributions
from pytest_drive_robust.runner.cache_key.python_source import imports_in, what_counts

_OWN = __name__.partition(".")[0]
_CODE = frozenset({".py", ".pyx", ".so", ".pyd", ".json", ".yaml", ".yml", ".toml", ".ini", ".cfg"})
"""Suffixes of files that belong to the code of a package; the agent names its weights itself."""


class UnknownSourceError(Exception):
    """The code is unknown: typed in, made at run time, or holding a value that cannot be compared."""


def module_digest(file: Path, module: str, *, libraries: bool = True) -> str:
    """Return a digest of the code of `module` in `file` and of all that it imports, 32 hex digits.

    With `libraries` the versions of Python and of installed distributions count, too, not only the files. Raises
    `UnknownSourceError` for a file that cannot be read.
    """
    return _Walk(file, module).digest(libraries=libraries)


def source_digest(factory: object) -> str:
    """Return a digest of the code of an agent's factory, without libraries, 12 hex digits; `""` for unknown code."""
    try:
        return module_digest(file_of(factory), str(getattr(factory, "__module__", "")), libraries=False)[:12]
    except UnknownSourceError:
        return ""


def python_files(factory: object) -> dict[Path, str]:
    """Return the Python files that `source_digest` reads, sorted, with their digests; empty for unknown code."""
    try:
        walk = _Walk(file_of(factory), str(getattr(factory, "__module__", "")))
    except UnknownSourceError:
        return {}
    return {path: digest for path, digest in sorted(walk.files.items()) if path.suffix == ".py"}


def content_digest(name: str, content: bytes) -> str:
    """Return a digest of what counts of the content of the file `name`."""
    return hashlib.blake2b(what_counts(name, content)).hexdigest()


def imported_versions(target: object) -> dict[str, str]:
    """Return the versions of Python and of the installed modules that the code of a class or function imports, by name.

    Raises `UnknownSourceError`.
    """
    return dict(sorted(_Walk(file_of(target), str(getattr(target, "__module__", ""))).versions().items()))


def file_of(target: object) -> Path:
    """Return the file of a class, function or module. Raises `UnknownSourceError`."""
    try:
        found = inspect.unwrap(target)  # type: ignore[arg-type]
        file = Path(_file_of_methods(found) or inspect.getfile(found)).resolve()
    except (OSError, TypeError, ValueError) as error:
        raise UnknownSourceError(str(error)) from None
    if not file.is_file():
        raise UnknownSourceError(f"there is no file {file}")
    return file


def file_of_code(function: FunctionType) -> Path:
    """Return the file that a function was written in, not the function it wraps. Raises `UnknownSourceError`."""
    file = Path(function.__code__.co_filename).resolve()
    if not file.is_file():
        raise UnknownSourceError(f"there is no file {file}")
    return file


def file_of_name(module: str) -> Path:
    """Return the file of the module of this name, without importing it. Raises `UnknownSourceError`."""
    spec = distributions.find_module(module)
    if spec is None or spec.origin is None or not Path(spec.origin).is_file():
        raise UnknownSourceError(f"there is no file of {module}")
    return Path(spec.origin).resolve()


def _file_of_methods(target: object) -> str:
    """Return the file of a class's methods; `""` for other objects, and for a class without a method of its own.

    `inspect` takes the file of the module that has the class's module name now: the wrong file when two conftest.py
    share a name, and no file when the module was removed from `sys.modules`.
    """
    if not isinstance(target, type):
        return ""
    for member in vars(target).values():
        function = inspect.unwrap(member) if isinstance(member, FunctionType) else None
        # A decorator's method is written elsewhere; a method made by `dataclass` is in no file.
        if isinstance(function, FunctionType) and function.__qualname__ == f"{target.__qualname__}.{function.__name__}":
            file = function.__code__.co_filename
            if function.__module__ == target.__module__ and Path(file).is_file():
                return file
    return ""


def code_digest(modules: Iterable[ModuleType | str]) -> str:
    """Return a digest of the names and contents of these modules' files, 32 hex digits; a package counts as a whole.

    A module given by its name is not imported. Raises `UnknownSourceError` for a module without a file: a missing file
    must never look like unchanged code.
    """
    digest = hashlib.blake2b(digest_size=16)
    for module in modules:
        file = file_of_name(module) if isinstance(module, str) else file_of(module)
        is_package = file.name == "__init__.py" if isinstance(module, str) else hasattr(module, "__path__")
        place, files = (file.parent, sorted(file.parent.rglob("*.py"))) if is_package else (file, [file])
        for path in filter(Path.is_file, files):  # an editor locks `a.py` by a link `.#a.py` that leads nowhere
            name = path.relative_to(place.parent).as_posix()
            digest.update(name.encode() + b"\0" + hashlib.blake2b(path.read_bytes()).digest())
    return digest.hexdigest()


class _Walk:
    """Follows imports from a first module. Found files are kept by names that do not depend on their folder.

    The first module counts also when it is installed; a single file counts the same under any name.
    """

    def __init__(self, file: Path, module: str) -> None:
        self._found: dict[str, str] = {}
        self._installed: dict[str, str] = {}  # versions
        self._tops: set[str] = set()
        self.files: dict[Path, str] = {}  # digests
        self._folders: set[Path] = set()
        self._find = functools.cache(distributions.find_module)  # many files import the same few
        folder = _package_folder(file, module)
        if folder is None:
            self._add_file(file, "the file itself")
        else:
            self._tops.add(module.partition(".")[0])
            self._add_folder(folder)

    def versions(self) -> dict[str, str]:
        """Return the versions of Python and of the distributions that were found."""
        return {**distributions.python_version(), **self._installed}

    def digest(self, *, libraries: bool) -> str:
        """Return a digest of the files, and with `libraries` of the versions, 32 hex digits."""
        counted = {f"distribution {name}": version for name, version in self.versions().items()} if libraries else {}
        lines = "\n".join(f"{name} {content}" for name, content in sorted({**self._found, **counted}.items()))
        return hashlib.blake2b(lines.encode(errors="surrogatepass"), digest_size=16).hexdigest()

    def _add_folder(self, folder: Path) -> None:
        if folder in self._folders:
            return
        self._folders.add(folder)
        for place, folders, names in os.walk(folder):
            folders[:] = sorted(name for name in folders if not is_hidden(name))
            for name in sorted(names):
                path = Path(place, name)
                if path.suffix in _CODE and not is_hidden(name) and path.is_file():
                    self._add_file(path, path.relative_to(folder.parent).as_posix())

    def _add_file(self, path: Path, name: str) -> None:
        if path in self.files:
            return
        try:
            content = path.read_bytes()
        except OSError as error:  # in a zip file, or not allowed
            raise UnknownSourceError(f"{path} cannot be read: {error.strerror}") from None
        while name in self._found:  # a file of another folder has this name
            name += "'"
        self._found[name] = self.files[path] = content_digest(path.name, content)
        if path.suffix == ".py":
            for imported in imports_in(content):
                self._follow(imported, path)

    def _follow(self, imported: str, importer: Path) -> None:
        if imported.startswith("."):
            self._follow_relative(imported, importer)
            return
        top = imported.partition(".")[0]
        spec = None if top == _OWN else self._find(top)
        if spec is None or spec.origin in ("built-in", "frozen") or distributions.is_standard(top, spec):
            return
        folders = [Path(folder) for folder in spec.submodule_search_locations or ()]
        if spec.origin is None:
            self._follow_namespace(imported, folders)
            return
        if top not in self._tops:
            self._tops.add(top)
            self._add_top(top, Path(spec.origin).resolve(), is_package=bool(folders))
        if top not in self._installed:
            self._follow_links(imported, folders)

    def _add_top(self, top: str, origin: Path, *, is_package: bool) -> None:
        if distributions.is_installed(origin):
            self._installed[top] = distributions.version_of(top, origin)
        elif is_package:
            self._add_folder(origin.parent)
        else:
            self._add_file(origin, origin.name)

    def _follow_links(self, imported: str, folders: list[Path]) -> None:
        """Add folders that a package reaches through links, which the walk through the package's files leaves out."""
        for folder in folders:
            for part in imported.split(".")[1:]:
                folder /= part
                if folder.is_symlink() and folder.is_dir():
                    self._add_folder(folder.resolve())

    def _follow_relative(self, imported: str, importer: Path) -> None:
        """Follow a relative import: the importer, such as a conftest.py, may be in no package that was added whole."""
        module = imported.lstrip(".")
        folder = importer.parents[len(imported) - len(module) - 1]
        self._follow_namespace(f"here.{module}", [folder])

    def _follow_namespace(self, imported: str, folders: list[Path]) -> None:
        """Follow a dotted name through folders without `__init__.py`; add the first package or module found."""
        for part in imported.split(".")[1:]:
            for folder in folders:
                if (folder / part / "__init__.py").is_file():
                    self._add_folder((folder / part).resolve())
                    return
                if (folder / f"{part}.py").is_file():
                    self._add_file((folder / f"{part}.py").resolve(), f"{part}.py")
                    return
            folders = [folder / part for folder in folders if (folder / part).is_dir()]


def _package_folder(file: Path, module: str) -> Path | None:
    """Return the folder of the top-level package that `file` belongs to, None when `file` is a single module."""
    package = sys.modules.get(module.partition(".")[0])
    folders = [Path(folder).resolve() for folder in getattr(package, "__path__", ())]
    return next((folder for folder in folders if file.is_relative_to(folder)), None)


def is_hidden(name: str) -> bool:
    """Return whether a file or folder of this name is passed over."""
    return name.startswith(".") or name == "__pycache__"
