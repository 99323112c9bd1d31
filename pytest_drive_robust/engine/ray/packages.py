"""What travels to the other machines of a cluster, and how it is found there.

The folder of the run travels, and packages of the agent and of plugins that lie outside it. What was installed with
pip is expected on every node in the same version; that is checked, because a result must not be stored under the name
of code that did not drive it.
"""

from __future__ import annotations

import inspect
import json
import os
import pickle
import platform
import site
import subprocess
import sys
import sysconfig
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.runner.cache_key.identity import agent_identity, simulator_identity, weights_digest
from pytest_drive_robust.runner.cache_key.object_code import SESSION

if TYPE_CHECKING:
    from pytest_drive_robust.engine.worker_setup import WorkerSetup
    from pytest_drive_robust.registry.registry import Registry

__all__ = ["NodePackages", "contents_of"]

_EXCLUDED = (
    ".git",
    ".drive-robust",
    ".venv",
    "venv",
    ".tox",
    ".nox",
    ".mypy_cache",
    ".pytest_cache",
    ".ruff_cache",
    ".hypothesis",
    "__pycache__",
    "*.py[co]",
    "*.nb[ci]",
)
_CHECK = "from pytest_drive_robust.engine.ray.packages import main; main()"
_CHECK_S = 300.0
_SESSION = "PYTEST_XDIST_TESTRUNUID"
"""What `runner.cache_key.object_code.SESSION` is read from."""
_MARK = b"\ncontents "


@dataclass(frozen=True, slots=True)
class NodePackages:
    """What was packed.

    `folder` travels as Ray's working directory, `packages` (folders or files that can be imported) as its `py_modules`.
    `contents` are digests of what drives, by agent: see `contents_of`. `session` stands in them for code that cannot be
    known.
    """

    folder: str
    packages: tuple[str, ...]
    contents: tuple[tuple[str, Mapping[str, str]], ...] = ()
    session: str = ""

    @classmethod
    def of(cls, worker_setup: WorkerSetup, definitions: Iterable[object]) -> NodePackages:
        """Find what a run by `worker_setup` must take along; `definitions` are the factories of its agents."""
        files = [file for found in definitions if (file := _file_of(found)) is not None]
        files += [(module, Path(file)) for module, file in worker_setup.plugins]
        packages = (_root_of(module, file) for module, file in files if not _is_there_anyway(file, worker_setup.folder))
        return cls(worker_setup.folder, tuple(dict.fromkeys(map(str, packages))), session=SESSION)

    def runtime_env(self) -> dict[str, object]:
        """Return the same as a `runtime_env` of Ray."""
        packages = {"py_modules": list(self.packages)} if self.packages else {}
        return {"working_dir": self.folder, "excludes": list(_EXCLUDED), **packages}

    def unpacked(self, worker_setup: WorkerSetup) -> WorkerSetup:
        """Return the setup with its paths as they are on this node, where Ray made the folder the current one."""
        here = os.getcwd()
        moved = [self._on_node(path) for path in worker_setup.python_path if _is_within(path, self.folder)]
        plugins = ((module, self._on_node(file)) for module, file in worker_setup.plugins)
        return replace(
            worker_setup,
            python_path=(*moved, *(path for path in sys.path if path not in moved)),
            folder=here,
            plugins=tuple(plugins),
        )

    def check(self, worker_setup: WorkerSetup, agent: str) -> None:
        """Raise `UsageError` where another version of `agent` or of this package would drive.

        It is asked in a process of its own: importing an agent may do anything.
        """
        wanted = dict(self.contents).get(agent)
        if wanted is None:
            return
        asked = subprocess.run(
            [sys.executable, "-c", _CHECK],
            input=pickle.dumps((worker_setup, agent)),
            capture_output=True,
            timeout=_CHECK_S,
            check=False,
            env={
                **os.environ,
                "PYTHONPATH": os.pathsep.join(filter(None, worker_setup.python_path)),
                _SESSION: self.session,
            },
        )
        answer = asked.stdout.rpartition(_MARK)[2] if asked.returncode == 0 else b""
        found: Mapping[str, str] = json.loads(answer or b"{}")
        if not found:
            raise UsageError(
                f"the node {platform.node()} cannot load the agent {agent!r}: {_last_line(asked.stderr)}. Its package "
                "must lie in the folder of the run or be installed on every node."
            )
        for what, digest in wanted.items():
            if found.get(what) != digest:
                raise UsageError(
                    f"the node {platform.node()} would drive with another {what} for {agent!r}: {digest} was "
                    f"announced, found {found.get(what) or 'nothing'}. Install the same versions on every node, and "
                    "keep weights in the folder of the run or under the same path everywhere."
                )

    def _on_node(self, path: str) -> str:
        if _is_within(path, self.folder):
            return os.path.abspath(os.path.relpath(path, self.folder))
        for package in self.packages:
            if _is_within(path, package):
                inside = os.path.relpath(path, os.path.dirname(package))
                found = (os.path.join(folder, inside) for folder in sys.path)
                return next(filter(os.path.exists, found), path)
        return path  # installed here as there, or else its import says what is missing


def contents_of(registry: Registry, agent: str, *, worker_setup: WorkerSetup) -> dict[str, str]:
    """Return digests of what decides the numbers and may differ between machines, by what people call it.

    Together they are what `identity_of` makes the keys of the store of. Raises `UsageError` when the agent or the
    simulator does not load or weights do not read.
    """
    world = registry.simulator(worker_setup.simulator, worker_setup.options)
    try:
        simulator = simulator_identity(worker_setup.simulator, registry, world, worker_setup.options)
    finally:
        world.close()
    factory = registry.entry("agents", agent).load()
    return {
        "weights": weights_digest(getattr(factory, "weights", ()), agent=agent),
        "code or configuration": agent_identity(agent, registry),
        "simulator or libraries": simulator,
    }


def main() -> None:
    """Answer `NodePackages.check`, on a node."""
    worker_setup, agent = pickle.load(sys.stdin.buffer)
    contents = contents_of(worker_setup.registry(), agent, worker_setup=worker_setup)
    sys.stdout.flush()
    sys.stdout.buffer.write(_MARK + json.dumps(contents).encode())


def _file_of(definition: object) -> tuple[str, Path] | None:
    """Return the module that defines a class or function, and its file."""
    try:
        return str(getattr(definition, "__module__", "")), Path(inspect.getfile(inspect.unwrap(definition)))  # type: ignore[arg-type]
    except (OSError, TypeError):
        return None


def _root_of(module: str, file: Path) -> Path:
    """Return what Python imports to come to `module`: the folder of its outermost package, or the file."""
    inside = module.split(".")
    depth = len(inside) - (0 if file.name == "__init__.py" else 1)
    return file.parents[depth - 1] if depth > 0 else file


def _is_there_anyway(file: Path, folder: str) -> bool:
    """Tell whether a file travels with the folder, or was installed with pip and not as a link to a checkout."""
    installed = (*site.getsitepackages(), site.getusersitepackages(), sysconfig.get_path("stdlib"))
    return any(_is_within(str(file), place) for place in (folder, *installed))


def _is_within(path: str, folder: str) -> bool:
    return Path(os.path.realpath(path)).is_relative_to(os.path.realpath(folder))


def _last_line(output: bytes) -> str:
    lines = output.decode(errors="replace").split("\n")
    return next((line.strip() for line in reversed(lines) if line.strip()), "it ended without a word")
