"""Agents that break in every way that a process can break, each in tick 30 of a drive that was fine until then."""

from __future__ import annotations

import builtins
import contextlib
import ctypes
import hashlib
import json
import locale
import logging
import os
import random
import resource
import signal
import subprocess
import sys
import tempfile
import threading
import time
import warnings
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.domain.observation import CameraSpec, Observation
from pytest_drive_robust.domain.route import GlobalPlan
from pytest_drive_robust.runner.episode.machine import _PROBE

FAULT_TICK = 30
SMALLEST = 5e-324
FULL = Control(throttle=1.0)


class Steady:
    """Full throttle; a subclass does `fault` in tick 30, and returns what that returns."""

    cameras: ClassVar[tuple[CameraSpec, ...]] = ()

    def sensors(self) -> tuple[CameraSpec, ...]:
        return self.cameras

    def reset(self, route: GlobalPlan, seed: int) -> None:
        self.calls = 0

    def act(self, observation: Observation) -> Control:
        self.calls += 1
        if self.calls != FAULT_TICK + 1:
            return FULL
        answer: Any = self.fault(observation)
        return answer  # type: ignore[no-any-return]

    def fault(self, observation: Observation) -> object:
        return FULL


# --- raises ---------------------------------------------------------------------------------------------------------


class Raises(Steady):
    def fault(self, observation: Observation) -> object:
        raise ZeroDivisionError("no way")


class SaysExit(Steady):
    def fault(self, observation: Observation) -> object:
        sys.exit("enough")


class Interrupts(Steady):
    def fault(self, observation: Observation) -> object:
        raise KeyboardInterrupt("from within")


class RaisesWhatCannotBePickled(Steady):
    def fault(self, observation: Observation) -> object:
        class OddError(Exception):
            def __init__(self, first: str, second: object) -> None:
                super().__init__(first)
                self.second = second

        raise OddError("two arguments", threading.Lock())


class GivesNan(Steady):
    def fault(self, observation: Observation) -> object:
        return Control(steer=float("nan"))


class GivesInfinity(Steady):
    def fault(self, observation: Observation) -> object:
        return Control(throttle=float("inf"))


class GivesNothing(Steady):
    def fault(self, observation: Observation) -> object:
        return None


class GivesATuple(Steady):
    def fault(self, observation: Observation) -> object:
        return (1.0, 0.0, 0.0)


class CannotBeShown(Steady):
    def __repr__(self) -> str:
        raise RuntimeError("no picture")

    def fault(self, observation: Observation) -> object:
        return self


class GivesTooMuch(Steady):
    def fault(self, observation: Observation) -> object:
        return Control(brake=1.5)


# --- ends its process -----------------------------------------------------------------------------------------------


class Segfaults(Steady):
    def fault(self, observation: Observation) -> object:
        return signal.raise_signal(signal.SIGSEGV)  # bad memory accesses end in SIGABRT on some machines


class SegfaultsInReset(Steady):
    def reset(self, route: GlobalPlan, seed: int) -> None:
        ctypes.string_at(0)


class SegfaultsInSensors(Steady):
    def sensors(self) -> tuple[CameraSpec, ...]:
        ctypes.string_at(0)
        return ()


class SegfaultsWhenMade(Steady):
    def __init__(self) -> None:
        ctypes.string_at(0)


class Aborts(Steady):
    def fault(self, observation: Observation) -> object:
        print("cannot go on", file=sys.stderr)
        os.abort()


class Leaves(Steady):
    def fault(self, observation: Observation) -> object:
        os._exit(0)


class LeavesWithSeven(Steady):
    def fault(self, observation: Observation) -> object:
        os._exit(7)


class KillsItself(Steady):
    def fault(self, observation: Observation) -> object:
        os.kill(os.getpid(), signal.SIGKILL)
        time.sleep(600.0)
        return FULL


class KillsTheForkServer(Steady):
    def fault(self, observation: Observation) -> object:
        os.kill(os.getppid(), signal.SIGKILL)
        time.sleep(600.0)
        return FULL


class TakesTooMuchMemory(Steady):
    def fault(self, observation: Observation) -> object:
        return [bytearray(1 << 24) for _ in range(1 << 10)]


class HoldsMemory(Steady):
    """So much that there is no room for two."""

    def fault(self, observation: Observation) -> object:
        self.held = np.empty(400_000_000, np.uint8)
        return FULL


class HoldsMemoryToo(HoldsMemory):
    pass


class HoldsMemoryFromTheStart(Steady):
    def __init__(self) -> None:
        self.held = np.empty(400_000_000, np.uint8)


# --- takes too long -------------------------------------------------------------------------------------------------


class Hangs(Steady):
    def fault(self, observation: Observation) -> object:
        time.sleep(600.0)
        return FULL


class HangsInReset(Steady):
    def reset(self, route: GlobalPlan, seed: int) -> None:
        time.sleep(600.0)


class HangsDeaf(Steady):
    """Ignores every signal that can be ignored."""

    def fault(self, observation: Observation) -> object:
        for number in signal.valid_signals() - {signal.SIGKILL, signal.SIGSTOP}:
            signal.signal(number, signal.SIG_IGN)
        time.sleep(600.0)
        return FULL


class HangsInC(Steady):
    """Sleeps in C with the interpreter's lock held: no Python thread of its process runs any more."""

    def fault(self, observation: Observation) -> object:
        return ctypes.PyDLL(None).sleep(600)


class StopsItself(Steady):
    def fault(self, observation: Observation) -> object:
        os.kill(os.getpid(), signal.SIGSTOP)
        return FULL


class Dawdles(Steady):
    """Never late in one call, but in all of them."""

    def act(self, observation: Observation) -> Control:
        time.sleep(0.02)
        return super().act(observation)


# --- meddles with its process ---------------------------------------------------------------------------------------


class Scribbles(Steady):
    cameras = (CameraSpec("front", width_px=32, height_px=16),)

    def act(self, observation: Observation) -> Control:
        pixels = observation.cameras["front"].pixels
        shade = float(pixels[..., 2].mean()) / 255.0
        pixels.flags.writeable = True
        pixels[:] = 255
        return Control(throttle=0.5 + shade)


class Reseeds(Steady):
    def fault(self, observation: Observation) -> object:
        random.seed(1)
        np.random.seed(1)
        return FULL


class Draws(Steady):
    """Drives by the global generators."""

    def act(self, observation: Observation) -> Control:
        return Control(throttle=(random.random() + float(np.random.rand())) / 2.0)


class DrivesByHashes(Steady):
    def act(self, observation: Observation) -> Control:
        return Control(throttle=hash("left") % 1000 / 1000.0)


class MeddlesWithEverything(Steady):
    def fault(self, observation: Observation) -> object:
        os.chdir("/")
        os.environ["MEDDLED"] = "yes"
        os.environ.pop("HOME", None)
        sys.path.insert(0, "/nowhere")
        warnings.simplefilter("error")
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
        signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGUSR1})
        signal.setitimer(signal.ITIMER_REAL, 3600.0)
        logging.disable(logging.CRITICAL)
        logging.getLogger().addHandler(logging.NullHandler())
        builtins.print = lambda *_, **__: None
        sys.stdout = None  # type: ignore[assignment]
        sys.excepthook = lambda *_: None
        sys.setrecursionlimit(5000)
        os.umask(0o777)
        resource.setrlimit(resource.RLIMIT_FSIZE, (1 << 20, resource.getrlimit(resource.RLIMIT_FSIZE)[1]))
        np.set_printoptions(precision=2)
        np.seterr(all="ignore")
        locale.setlocale(locale.LC_ALL, "C")
        return FULL


class TellsItsSurroundings(Steady):
    """Raises a description of everything that `MeddlesWithEverything` touches."""

    def fault(self, observation: Observation) -> object:
        mask = os.umask(0o022)
        os.umask(mask)
        facts = (
            os.getcwd(), dict(os.environ), sys.path, [repr(item) for item in warnings.filters],
            str(signal.getsignal(signal.SIGTERM)), sorted(signal.pthread_sigmask(signal.SIG_BLOCK, ())),
            signal.getitimer(signal.ITIMER_REAL), logging.root.manager.disable, len(logging.root.handlers),
            repr(builtins.print), sys.stdout is None, repr(sys.excepthook), sys.getrecursionlimit(), mask,
            str(np.get_printoptions()), str(np.geterr()), locale.setlocale(locale.LC_ALL),
            resource.getrlimit(resource.RLIMIT_FSIZE),
        )  # fmt: skip
        raise RuntimeError(json.dumps(facts))


class SetsTorch(Steady):
    """The first to load torch, and drives by what it has set there."""

    def __init__(self) -> None:
        import torch

        torch.set_default_dtype(torch.float64)
        torch.set_default_device("meta")
        torch.set_flush_denormal(True)
        torch.set_float32_matmul_precision("medium")
        torch.backends.cudnn.deterministic = True
        torch.backends.cuda.matmul.fp32_precision = "tf32"  # what is older cannot be read any more
        torch.backends.mkldnn.enabled = False

    def act(self, observation: Observation) -> Control:
        return Control(throttle=(int(hashlib.md5(torch_settings().encode()).hexdigest(), 16) % 100) / 100.0)


class SetsTorchAndRaises(SetsTorch):
    def act(self, observation: Observation) -> Control:
        raise RuntimeError(torch_settings())


class TellsTorch(Steady):
    def fault(self, observation: Observation) -> object:
        raise RuntimeError(torch_settings())


class LoadsTorchInTheDrive(Steady):
    """Loads torch, sets it and drives by what it was before."""

    def fault(self, observation: Observation) -> object:
        before = torch_settings()
        SetsTorch()
        return Control(throttle=(int(hashlib.md5(before.encode()).hexdigest(), 16) % 100) / 100.0)


def torch_settings() -> str:
    import torch

    matmul = torch.backends.cuda.matmul.fp32_precision
    facts = (torch.get_default_dtype(), torch.get_default_device(), torch.backends.mkldnn.enabled, matmul)
    precision = torch.get_float32_matmul_precision() if matmul == "none" else "cannot be read"
    return repr((*facts, precision, torch.backends.cudnn.deterministic, SMALLEST * 4.0))


class FlushesByOnnxRuntime(Steady):
    """Has its process compute without subnormals, and nothing there that can be told to stop that."""

    def __init__(self) -> None:
        import onnxruntime

        options = onnxruntime.SessionOptions()
        options.add_session_config_entry("session.set_denormal_as_zero", "1")
        onnxruntime.InferenceSession(_PROBE, options, providers=["CPUExecutionProvider"])

    def act(self, observation: Observation) -> Control:
        return Control(throttle=1.0 if SMALLEST * 4.0 > 0.0 else 0.5)


class MovesIntoAFolderThatGoesAway(Steady):
    def fault(self, observation: Observation) -> object:
        folder = tempfile.mkdtemp()
        os.chdir(folder)
        os.rmdir(folder)
        return FULL


class Shouts(Steady):
    """Megabytes on both streams, through Python and past it, some of it in no encoding at all."""

    def fault(self, observation: Observation) -> object:
        print("x" * (1 << 21))
        os.write(2, b"\xff\xfe\x00" * 100_000)
        print("\udcff the last words", file=sys.stderr)
        return FULL


class ClosesEverything(Steady):
    def fault(self, observation: Observation) -> object:
        os.closerange(0, 1 << 16)
        return FULL


class ClosesItsStreams(Steady):
    def fault(self, observation: Observation) -> object:
        os.closerange(0, 3)
        return FULL


class WritesToEveryDescriptor(Steady):
    def fault(self, observation: Observation) -> object:
        for name in os.listdir("/proc/self/fd"):
            with contextlib.suppress(OSError):
                os.write(int(name), b"a message from the agent, longer than any head of ours")
        return FULL


class Forks(Steady):
    """Two processes go on from here."""

    def fault(self, observation: Observation) -> object:
        if os.fork() == 0:
            time.sleep(0.01)
        return FULL


class LeavesAThread(Steady):
    def fault(self, observation: Observation) -> object:
        threading.Thread(target=time.sleep, args=(600.0,), daemon=True).start()
        return FULL


class LeavesAChild(Steady):
    def fault(self, observation: Observation) -> object:
        _note(subprocess.Popen(["sleep", "600"]).pid)
        return FULL


class LeavesADaemon(Steady):
    """A process in a session of its own whose parent has ended."""

    def fault(self, observation: Observation) -> object:
        if os.fork() == 0:
            os.setsid()
            pid = os.fork()
            if pid == 0:
                time.sleep(600.0)
            _note(pid)
            os._exit(0)
        os.wait()
        return FULL


class LeavesADaemonAndDies(LeavesADaemon):
    def fault(self, observation: Observation) -> object:
        super().fault(observation)
        os._exit(3)


class LeavesADaemonAndHangs(LeavesADaemon):
    def fault(self, observation: Observation) -> object:
        super().fault(observation)
        time.sleep(600.0)
        return FULL


class Leaks(Steady):
    """Eight megabytes an episode, on memory that is written to."""

    hoard: ClassVar[list[bytes]] = []

    def fault(self, observation: Observation) -> object:
        self.hoard.append(b"x" * (8 << 20))
        return FULL


def _note(pid: int) -> None:
    """Tell the test which process to look for."""
    Path(os.environ["DRIVE_ROBUST_TEST_NOTE"]).write_text(str(pid))
