"""Which files the code of a class or function lies in, and one digest of their content.

Those are all files of its top-level package (or its one file), and then, the same way, of everything that they import
which is no installed distribution. Installed distributions count by name and version, the standard library by that of
Python, unless who wrote the code promises that no library decides what it computes, or says which ones do. Imports are
found by reading, not by running: an import inside a function counts, one by a computed name not.
"""

from __future__ import annotations

import ast
import functools
import hashlib
import importlib.util
import inspect
import re
import sys
from collections.abc import Iterable, Iterator
from importlib import metadata
from pathlib import Path
from types import FunctionType, ModuleType

__all__ = [
    "UnknownSourceError", "code_digest", "file_of", "hex_of", "imported_versions", "module_digest", "source_digest",
    "versions_of",
]  # fmt: skip

_OWN = __name__.partition(".")[0]
_DIGEST_BYTES = 6
_CODE = frozenset({".py", ".pyx", ".so", ".pyd", ".json", ".yaml", ".yml", ".toml", ".ini", ".cfg"})
"""What belongs to the code of a package; weights are named by the agent."""
_VERSION_FILES = ("__init__.py", "version.py", "_version.py")
_INSTALLED = frozenset({"site-packages", "dist-packages"})
_TEST_FILE = re.compile(r"test_.*\.py|.*_test\.py")
_IMPORT = re.compile(
    rb"^[ \t]*(?:from[ \t]+(?P<module>\.*[\w.]*)[ \t]+import[ \t]+(?P<names>[^#\r\n]*)"
    rb"|import[ \t]+(?P<list>[^#\r\n]*))",
    re.MULTILINE,
)


class UnknownSourceError(Exception):
    """There is no telling what the code is: it was typed in, made up at run time, or holds something unknowable."""


def module_digest(file: Path, module: str, *, libraries: bool = True) -> str:
    """Return 32 hex digits of the code in `file`, the file of the module of that name, and of all that it imports.

    `libraries`: with the versions of Python and of what is installed, and not with the files alone.
    """
    walk = _Walk()
    walk.add_module(file, module)
    return walk.digest(libraries=libraries)


def imported_versions(target: object) -> dict[str, str]:
    """Return the versions of Python and of what the code of a class, function or module imports, by module.

    Raises `UnknownSourceError`.
    """
    walk = _Walk()
    walk.add_module(file_of(target), str(getattr(target, "__module__", "")))
    return dict(sorted(walk.versions().items()))


def versions_of(modules: Iterable[str]) -> dict[str, str]:
    """Return the versions of Python and of these modules, by name; `"absent"` for one that is not installed."""
    found = {name: _find(name) for name in modules}
    versions = {
        name: "absent" if spec is None or spec.origin is None else _version(name, Path(spec.origin).resolve())
        for name, spec in sorted(found.items())
    }
    return {**_python(), **versions}


def _python() -> dict[str, str]:
    """Return the version that decides results: patches change none."""
    return {"python": f"{sys.version_info[0]}.{sys.version_info[1]}"}


def source_digest(factory: object) -> str:
    """Return 12 hex digits of the code behind an agent's factory; empty when its file is not known.

    That is every Python file of the top-level package that defines it, or the one file where there is no package.
    """
    try:
        file = file_of(factory)
    except UnknownSourceError:
        return ""
    folder = _package_folder(file, str(getattr(factory, "__module__", "")))
    files = [file] if folder is None else sorted(folder.rglob("*.py"))
    return _short_digest(files, file.parent if folder is None else folder)


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


def _file_of_methods(target: object) -> str:
    """Return the file that the methods of a class were read from; empty for other things, and where they do not tell.

    `inspect` takes the file of whatever module has the name now. That is another one where two conftest.py share a
    name, and none where the module was removed from `sys.modules`.
    """
    if not isinstance(target, type):
        return ""
    for member in vars(target).values():
        function = inspect.unwrap(member) if isinstance(member, FunctionType) else None
        # What a decorator made is written elsewhere, and what `dataclass` made nowhere.
        if isinstance(function, FunctionType) and function.__qualname__ == f"{target.__qualname__}.{function.__name__}":
            file = function.__code__.co_filename
            if function.__module__ == target.__module__ and Path(file).is_file():
                return file
    return ""


def code_digest(modules: Iterable[ModuleType]) -> str:
    """Return 32 hex digits of the files of these modules, by their names within them; a package counts with all below.

    Raises `UnknownSourceError` for a module without a file: nothing to read must never look like unchanged code.
    """
    digest = hashlib.blake2b(digest_size=16)
    for module in modules:
        file = file_of(module)
        place, files = (file.parent, sorted(file.parent.rglob("*.py"))) if _is_package(module) else (file, [file])
        for path in files:
            name = path.relative_to(place.parent).as_posix()
            digest.update(name.encode() + b"\0" + hashlib.blake2b(path.read_bytes()).digest())
    return digest.hexdigest()


def _is_package(module: ModuleType) -> bool:
    return hasattr(module, "__path__")


def hex_of(content: bytes) -> str:
    """Return 12 hex digits of bytes."""
    return hashlib.blake2b(content, digest_size=_DIGEST_BYTES).hexdigest()


class _Walk:
    """Follows imports from a first module. What was found is kept by a name that does not depend on where it lies."""

    def __init__(self) -> None:
        self._found: dict[str, str] = {}
        self._installed: dict[str, str] = {}  # versions
        self._tops: set[str] = set()
        self._files: set[Path] = set()
        self._specs: dict[str, importlib.machinery.ModuleSpec | None] = {}  # many files import the same few

    def versions(self) -> dict[str, str]:
        """Return the versions of Python and of the distributions that were found."""
        return {**_python(), **self._installed}

    def digest(self, *, libraries: bool) -> str:
        """Return 32 hex digits of the files, and of what is installed where `libraries` count."""
        counted = {f"distribution {name}": version for name, version in self.versions().items()} if libraries else {}
        lines = "\n".join(f"{name} {content}" for name, content in sorted({**self._found, **counted}.items()))
        return hashlib.blake2b(lines.encode(errors="surrogatepass"), digest_size=16).hexdigest()

    def add_module(self, file: Path, module: str) -> None:
        """Add the module that is looked at, wherever it is installed. A single file counts the same under any name."""
        folder = _package_folder(file, module)
        if folder is None:
            self._add_file(file, "the file itself")
        else:
            self._tops.add(module.partition(".")[0])
            self._add_folder(folder)

    def _add_folder(self, folder: Path) -> None:
        for path in sorted(folder.rglob("*")):
            if path.suffix in _CODE and path.is_file() and not _is_hidden(path.relative_to(folder)):
                self._add_file(path, path.relative_to(folder.parent).as_posix())

    def _add_file(self, path: Path, name: str) -> None:
        if path in self._files:
            return
        self._files.add(path)
        content = path.read_bytes()
        self._found[name] = _content_digest(path, content)
        if path.suffix == ".py":
            for imported in _imports(content):
                self._follow(imported, path)

    def _follow(self, imported: str, importer: Path) -> None:
        if imported.startswith("."):
            self._follow_relative(imported, importer)
            return
        top = imported.partition(".")[0]
        if top == _OWN or top in sys.stdlib_module_names:
            return
        if top not in self._specs:
            self._specs[top] = _find(top)
        spec = self._specs[top]
        if spec is None or spec.origin in ("built-in", "frozen"):
            return
        if spec.origin is None:
            self._follow_namespace(imported, [Path(folder) for folder in spec.submodule_search_locations or ()])
        elif top not in self._tops:
            self._tops.add(top)
            origin = Path(spec.origin).resolve()
            if _INSTALLED & set(origin.parts):
                self._installed[top] = _version(top, origin)
            elif spec.submodule_search_locations:
                self._add_folder(origin.parent)
            else:
                self._add_file(origin, origin.name)

    def _follow_relative(self, imported: str, importer: Path) -> None:
        """Follow it where the importer is in no package that was added whole, such as a conftest.py."""
        module = imported.lstrip(".")
        folder = importer.parents[len(imported) - len(module) - 1]
        self._follow_namespace(f"here.{module}", [folder])

    def _follow_namespace(self, imported: str, folders: list[Path]) -> None:
        """Go down a dotted name through folders that have no __init__.py."""
        for part in imported.split(".")[1:]:
            for folder in folders:
                if (folder / part / "__init__.py").is_file():
                    self._add_folder((folder / part).resolve())
                    return
                if (folder / f"{part}.py").is_file():
                    self._add_file((folder / f"{part}.py").resolve(), f"{part}.py")
                    return
            folders = [folder / part for folder in folders if (folder / part).is_dir()]


def _imports(content: bytes) -> Iterator[str]:
    """Yield the dotted names that are imported: `a.b` and `a.b.c` for `from a.b import c`."""
    for match in _IMPORT.finditer(content):
        words = (match["names"] or match["list"]).decode(errors="replace").strip(" \t()\\").split(",")
        names = [word.split()[0] for word in words if word.split()]
        if match["list"] is not None:
            yield from names
            continue
        module = match["module"].decode(errors="replace")
        yield module
        yield from (f"{module}{'' if module.endswith('.') else '.'}{name}" for name in names)


def _content_digest(path: Path, content: bytes) -> str:
    """Return a file's digest, of a test file without its tests: an agent or perturbation beside them is not theirs."""
    if _TEST_FILE.fullmatch(path.name):
        try:
            tree = ast.parse(content)
        except (SyntaxError, ValueError):
            return hashlib.blake2b(content).hexdigest()
        tree.body = [statement for statement in tree.body if not _is_test(statement)]
        content = ast.dump(tree).encode(errors="surrogatepass")
    return hashlib.blake2b(content).hexdigest()


def _is_test(statement: ast.stmt) -> bool:
    named = isinstance(statement, (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef))
    return named and statement.name.lower().startswith("test")  # type: ignore[attr-defined]


def _package_folder(file: Path, module: str) -> Path | None:
    """Return the folder of the top-level package that `file` belongs to, None where it is a module of its own."""
    package = sys.modules.get(module.partition(".")[0])
    folders = [Path(folder).resolve() for folder in getattr(package, "__path__", ())]
    return next((folder for folder in folders if file.is_relative_to(folder)), None)


def _short_digest(files: Iterable[Path], folder: Path) -> str:
    digest = hashlib.blake2b(digest_size=_DIGEST_BYTES)
    for path in files:
        if path.is_file():
            digest.update(path.relative_to(folder).as_posix().encode() + b"\0" + hex_of(path.read_bytes()).encode())
    return digest.hexdigest()


def _is_hidden(path: Path) -> bool:
    return any(part.startswith(".") or part == "__pycache__" for part in path.parts)


def _find(top: str) -> importlib.machinery.ModuleSpec | None:
    try:
        return importlib.util.find_spec(top)
    except (ImportError, ValueError, AttributeError):
        return None


@functools.cache
def _version(top: str, origin: Path) -> str:
    """Return the version of a distribution; where its name is not the module's, a digest of what tells versions."""
    try:
        return metadata.version(top)
    except (metadata.PackageNotFoundError, ValueError):
        files = [origin.with_name(name) for name in _VERSION_FILES] if origin.name == "__init__.py" else [origin]
        return _short_digest(files, origin.parent)
