"""What a new process needs to drive the episodes of a run, and the limits of an episode."""

from __future__ import annotations

import json
import os
import pickle
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, field

from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.registry.plugins import call_hook, imported_from
from pytest_drive_robust.registry.registry import Registry, default_registry
from pytest_drive_robust.simulators.base import SimulatorOptions

_THREAD_VARIABLES = (
    "OMP_NUM_THREADS",
    "MKL_NUM_THREADS",
    "OPENBLAS_NUM_THREADS",
    "NUMEXPR_NUM_THREADS",
    "VECLIB_MAXIMUM_THREADS",
    "NUMBA_NUM_THREADS",
)


@dataclass(frozen=True, slots=True)
class Limits:
    """The limits of every episode; None for no limit.

    `episode_s` is the wall time of an episode, `act_s` the wall time of one call of the agent (`sensors`, `reset`,
    `act`). `memory_bytes` is the memory that its process may allocate (`RLIMIT_DATA`, Linux only). The last
    `output_bytes` of the process's output are kept. A process that grew by `growth_bytes` since its first episode is
    replaced.
    """

    episode_s: float | None = None
    act_s: float | None = None
    memory_bytes: int | None = None
    output_bytes: int = 65536
    growth_bytes: int = 256 << 20


@dataclass(frozen=True, slots=True)
class WorkerSetup:
    """Everything that a process needs to drive the episodes of a run, as plain data that can be pickled.

    `python_path` becomes `sys.path`, `folder` the current folder, and `environment` the environment variables; with an
    empty `environment` the process inherits the variables of its starter. `plugins` lists (module, file) of the plugins
    whose hook `pytest_drive_robust_register` is called, in the order of their registration. `simulator` is a name or a
    reference of the registry. `threads` is the number of threads for torch, OpenMP, OpenCV and numba. `preload_agents`
    names agents whose modules are imported once for all processes. With `checks_identity` a process refuses to drive
    when its code, weights or libraries differ from those of the process that started the run. `sources` holds (file,
    digest) of Python files: a process that loads one of them itself checks that the file has not changed.
    """

    python_path: tuple[str, ...]
    folder: str
    plugins: tuple[tuple[str, str], ...]
    simulator: str
    options: SimulatorOptions = field(default_factory=SimulatorOptions)
    threads: int = 1
    preload_agents: tuple[str, ...] = ()
    checks_identity: bool = False
    sources: tuple[tuple[str, str], ...] = field(default=(), repr=False)
    environment: tuple[tuple[str, str], ...] = field(default=(), repr=False)

    def start_python(
        self, function: str, arguments: Sequence[int], content: object, *, pass_fds: Sequence[int], output: int
    ) -> subprocess.Popen[bytes]:
        """Start `function(*arguments)` of `engine.worker.forking` in a new Python process with its own session.

        The function reads `content`, pickled, from its standard input. The environment sets the number of threads, a
        fixed hash seed, so that an agent that iterates over a set of strings drives alike in every run, and no
        `PYTHONWARNINGS`, because a warning turned into an error would count as the agent's error.
        """
        code = (
            "import json, sys; sys.path[:] = json.loads(sys.argv[1]); "
            f"from pytest_drive_robust.engine.worker import forking; forking.{function}{(*arguments,)}"
        )
        with tempfile.TemporaryFile() as stdin:
            stdin.write(pickle.dumps(content))
            stdin.seek(0)
            return subprocess.Popen(
                [sys.executable, "-c", code, json.dumps(self.python_path)],
                stdin=stdin,
                stdout=output,
                stderr=output,
                pass_fds=pass_fds,
                env={
                    **(dict(self.environment) or os.environ),
                    "PYTHONHASHSEED": "0",
                    "PYTHONWARNINGS": "",
                    **dict.fromkeys(_THREAD_VARIABLES, str(self.threads)),
                },
                cwd=self.folder,
                start_new_session=True,
            )

    def registry(self) -> Registry:
        """Return the registry of the run, in this process. Raises `UsageError` for a plugin that does not load."""
        sys.path[:] = self.python_path
        os.chdir(self.folder)
        registry = default_registry()
        for module, file in self.plugins:
            try:
                plugin = imported_from(module, file)
            except BaseException as error:  # an import may also call sys.exit() or pytest.skip()
                raise UsageError(
                    f"the plugin {module} ({file}) does not load in the processes that drive episodes: "
                    f"{type(error).__name__}: {error}. What it needs must not depend on pytest having started; or give "
                    "--drive-executor inline."
                ) from error
            call_hook(plugin, registry)
        return registry

    def limit_threads(self) -> None:
        """Set the number of threads of torch and OpenCV, if they are loaded by now."""
        for module, setter in (("cv2", "setNumThreads"), ("torch", "set_num_threads")):
            if module in sys.modules:
                getattr(sys.modules[module], setter)(self.threads)
