"""How a fresh process comes to the registry of this run, and what an episode may use of its machine."""

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
    """The limits of every episode; None where there is none.

    `episode_s` is the wall time of an episode, `act_s` that of one call of the agent (`sensors`, `reset`, `act`).
    `memory_bytes` is what its process may allocate (`RLIMIT_DATA`, Linux only). Of what the process prints, the last
    `output_bytes` are kept. A process that grew by `growth_bytes` since its first episode is replaced.
    """

    episode_s: float | None = None
    act_s: float | None = None
    memory_bytes: int | None = None
    output_bytes: int = 65536
    growth_bytes: int = 256 << 20


@dataclass(frozen=True, slots=True)
class WorkerSetup:
    """Everything that a process needs to drive the episodes of a run; plain data that pickles.

    `python_path` becomes `sys.path`, `folder` the current folder and `environment` the variables, empty for those of
    the process that starts it. `plugins` are the modules whose hook
    `pytest_drive_robust_register` is called, each with its file, in the order of their registration. `simulator` is a
    name or a reference of the registry. `threads` is what torch, OpenMP, OpenCV and numba may use; `preload_agents`
    are names whose modules are imported once for all processes. `checks_identity`: a process refuses to drive where it
    finds other code, weights or libraries than there are where the run was started.
    """

    python_path: tuple[str, ...]
    folder: str
    plugins: tuple[tuple[str, str], ...]
    simulator: str
    options: SimulatorOptions = field(default_factory=SimulatorOptions)
    threads: int = 1
    preload_agents: tuple[str, ...] = ()
    checks_identity: bool = False
    environment: tuple[tuple[str, str], ...] = field(default=(), repr=False)

    def start_python(
        self, function: str, arguments: Sequence[int], content: object, *, pass_fds: Sequence[int], output: int
    ) -> subprocess.Popen[bytes]:
        """Start `function(*arguments)` of `engine.worker.forking` in a new Python with a session of its own.

        It finds `content` pickled at its standard input, and in its environment the number of threads and one hash
        seed, whatever ours is: an agent that iterates over a set of strings drives alike in every run. Nor does ours
        say what a warning is: as an error it would be the agent's.
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
        """Return every name that the run knows. Raises `UsageError` for a plugin that does not load."""
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
        """Tell the libraries that are loaded by now how many threads they may use."""
        for module, setter in (("cv2", "setNumThreads"), ("torch", "set_num_threads")):
            if module in sys.modules:
                getattr(sys.modules[module], setter)(self.threads)
