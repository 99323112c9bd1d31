"""Check everything that the official evaluator needs, with advice for each failed check."""

from __future__ import annotations

import json
import os
import re
import shutil
import socket
import subprocess
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from pytest_drive_robust.bench2drive.evaluator.checkout import (
    EVALUATOR,
    NO_GETCHILDREN,
    SERVER,
    Checkout,
    named_carla,
    shell_trouble,
)
from pytest_drive_robust.bench2drive.evaluator.gpus import visible_gpus
from pytest_drive_robust.bench2drive.evaluator.ports import DEFAULT_PORT, TRAFFIC_OFFSET, check_ports
from pytest_drive_robust.errors import UsageError

_CARLA = "0.9.15"
_LARGE_MAPS = ("Town12", "Town13")
_SEAMS = {
    "leaderboard/leaderboard/envs/sensor_interface.py": ("SensorInterface", "get_data"),
    "leaderboard/leaderboard/autoagents/agent_wrapper.py": ("AgentWrapper", "__call__"),
    "leaderboard/leaderboard/scenarios/scenario_manager.py": ("ScenarioManager", "load_scenario"),
}
_MODULES = (
    "carla", "agents.navigation.global_route_planner", "numpy", "py_trees", "dictor", "networkx", "shapely", "tabulate",
    "transforms3d", "simple_watchdog_timer", "pexpect", "six", "ephem", "psutil", "requests", "pkg_resources",
    "distutils.version",
)  # fmt: skip
_PROBE = """
import importlib, json, sys
told = {"python": list(sys.version_info[:2]), "missing": {}}
for name in sys.argv[1:]:
    try:
        module = importlib.import_module(name)
        if getattr(module, "__file__", None) is None:  # any folder of that name, as PythonAPI/carla is one
            raise ImportError("only a folder of that name is there")
    except Exception as error:
        told["missing"][name] = "{}: {}".format(type(error).__name__, error)
    else:
        told[name] = str(getattr(module, "__version__", ""))
try:
    import pkg_resources
    told["carla"] = pkg_resources.get_distribution("carla").version
except Exception:
    pass
print("\\n" + json.dumps(told))
"""
_TIMEOUT_S = 60.0


@dataclass(frozen=True, slots=True)
class DoctorCheck:
    """One check. `ok` is None for a note that stops nothing; `advice` says what to do when `ok` is not True."""

    name: str
    ok: bool | None
    found: str
    advice: str = ""


def examine(
    root: Path, *, carla_root: Path | None = None, python: str = "", port: int = DEFAULT_PORT
) -> tuple[DoctorCheck, ...]:
    """Return all checks, in the order in which to fix them. Raises `UsageError` for an impossible port."""
    check_ports(port)
    given = carla_root or named_carla()
    checks = [*_checkout(root), *_server(given)]
    try:
        checkout = Checkout.find(root, carla_root=given, python=python)
    except UsageError:
        interpreter = DoctorCheck("python", None, "not looked at", "Put the checkout and CARLA right first.")
        checks.append(interpreter)
    else:
        checks += _python(checkout)
    return (*checks, *_ports(port), _gpu_numbers(), _gpu())


def checkout_version(root: Path) -> str:
    """Return `0.0.4` if that version's validation routes are there, else `0.0.3`: checkouts do not tell a version."""
    return "0.0.4" if (root / "leaderboard/data/bench2drive_0.0.4_val.xml").is_file() else "0.0.3"


def carla_version(carla_root: Path) -> str:
    """Return the text of CARLA's file `VERSION`, empty when there is no such file."""
    try:
        return (carla_root / "VERSION").read_text(encoding="utf-8", errors="replace").strip()
    except OSError:
        return ""


def _checkout(root: Path) -> Iterator[DoctorCheck]:
    clone = "Clone github.com/Thinklab-SJTU/Bench2Drive and give its folder."
    evaluator = root / EVALUATOR
    if not evaluator.is_file():
        yield DoctorCheck("checkout", False, f"no {evaluator}", clone)
        return
    yield DoctorCheck("checkout", True, f"{root}, version {checkout_version(root)}")
    missing = [
        name for name in ("scenario_runner/srunner", "leaderboard/data/weather.xml") if not (root / name).exists()
    ]
    if missing:
        yield DoctorCheck("checkout files", False, f"no {', '.join(missing)}", clone)
    lost = [f"{cls}.{method}" for file, (cls, method) in _SEAMS.items() if not _has_method(root / file, cls, method)]
    told = "SensorInterface.get_data, AgentWrapper.__call__" if not lost else f"no {', '.join(lost)}"
    yield DoctorCheck("seams", not lost, told, "This fork is built differently, so no failure can be injected into it.")


def _server(carla_root: Path | None) -> Iterator[DoctorCheck]:
    install = f"Unpack CARLA {_CARLA} with its additional maps; set CARLA_ROOT to its folder."
    if carla_root is None:
        yield DoctorCheck("server", False, "CARLA_ROOT is not set", install)
        return
    script = carla_root / SERVER
    if not script.is_file():
        yield DoctorCheck("server", False, f"no {script}", install)
        return
    if not os.access(script, os.X_OK):
        yield DoctorCheck("server", False, f"{script} cannot be executed", f"chmod +x {script}")
        return
    told = shell_trouble(carla_root)
    if told:
        yield DoctorCheck("server", False, told, "Move CARLA to a folder whose path has no such character.")
        return
    version = carla_version(carla_root)
    right = not version or version.startswith(_CARLA)
    yield DoctorCheck(
        "server", right, f"{carla_root}, version {version or 'unknown'}", f"Bench2Drive is made for {_CARLA}."
    )
    maps = carla_root / "CarlaUE4/Content/Carla/Maps"
    missing = [town for town in _LARGE_MAPS if not (maps / town).is_dir() and not (maps / f"{town}.umap").is_file()]
    yield DoctorCheck(
        "maps", not missing, f"{', '.join(missing)} missing" if missing else ", ".join(_LARGE_MAPS),
        "Import AdditionalMaps with ImportAssets.sh: 151 of the 220 routes are in Town12 and Town13.",
    )  # fmt: skip


def _python(checkout: Checkout) -> Iterator[DoctorCheck]:
    """Check which modules the evaluator's Python can import, with the evaluator's environment."""
    hint = "Give the Python of the agent's environment with --python."
    try:
        ended = subprocess.run(
            [checkout.python, "-c", _PROBE, *_MODULES],
            env=checkout.environment(os.environ), cwd=checkout.root, stdin=subprocess.DEVNULL,
            capture_output=True, text=True, errors="replace", timeout=_TIMEOUT_S, check=False,
        )  # fmt: skip
        told = json.loads(ended.stdout.splitlines()[-1])
    except (OSError, subprocess.TimeoutExpired, ValueError, IndexError) as error:
        yield DoctorCheck("python", False, f"{checkout.python}: {type(error).__name__}", hint)
        return
    version = tuple(told["python"])
    outdated = checkout.getchildren_files if version >= NO_GETCHILDREN else ()
    found = f"{checkout.python}, version {version[0]}.{version[1]}"
    if outdated:
        found += (
            f", in which {', '.join(str(file.relative_to(checkout.root)) for file in outdated)} fails: getchildren()"
        )
        hint = "Give a Python 3.7 or 3.8 with --python, or replace x.getchildren() by list(x) there."
    yield DoctorCheck("python", version >= (3, 7) and not outdated, found, hint)
    missing = dict(told["missing"])
    client = missing.pop("carla", "")
    eggs = ", ".join(egg.name for egg in checkout.eggs) or "no egg in PythonAPI/carla/dist"
    yield DoctorCheck(
        "client", not client, client or f"carla {told.get('carla') or 'of unknown version'} ({eggs})",
        f"{checkout.python} -m pip install carla=={_CARLA} (Python 3.7 to 3.10), or a Python that fits the egg.",
    )  # fmt: skip
    planner = missing.pop("agents.navigation.global_route_planner", "")
    if planner and not client:
        yield DoctorCheck(
            "PythonAPI", False, planner, "CARLA's folder PythonAPI/carla/agents is not there: unpack CARLA again."
        )
    found = "all there" if not missing else "; ".join(f"{name} ({why})" for name, why in missing.items())
    yield DoctorCheck(
        "modules", not missing, found,
        f"{checkout.python} -m pip install -r {checkout.root}/leaderboard/requirements.txt "
        f"-r {checkout.root}/scenario_runner/requirements.txt",
    )  # fmt: skip
    numbers = [int(part) for part in str(told.get("numpy", "")).split(".")[:2] if part.isdecimal()]
    if numbers:
        yield DoctorCheck("numpy", numbers >= [1, 17], told["numpy"], "The injection needs numpy 1.17 or later.")


def _ports(port: int) -> Iterator[DoctorCheck]:
    """Check the first ports: CARLA takes three in a row, the traffic manager one. Taken ports are only a note."""
    wanted = (port, port + 1, port + 2, port + TRAFFIC_OFFSET)
    held = [number for number in wanted if not _is_free(number)]
    yield DoctorCheck(
        "ports", None if held else True,
        f"{', '.join(map(str, held))} taken" if held else f"{', '.join(map(str, wanted))} free",
        "The next free ones are used. `pgrep -af carla-rpc-port` names a server that was left running.",
    )  # fmt: skip


def _is_free(port: int) -> bool:
    with socket.socket() as server:
        try:
            server.bind(("localhost", port))
        except OSError:
            return False
    return True


def _gpu_numbers() -> DoctorCheck:
    """Check the numbers of the GPUs for evaluators: a GPU given by name stops a drive."""
    try:
        gpus = visible_gpus(os.environ)
    except UsageError as error:
        return DoctorCheck("gpu numbers", False, str(error), "As in: export CUDA_VISIBLE_DEVICES=0")
    return DoctorCheck("gpu numbers", True, ", ".join(map(str, gpus)))


def _gpu() -> DoctorCheck:
    advice = "CARLA draws with Vulkan on a GPU, also with -RenderOffScreen: use a machine with one and its driver."
    tool = shutil.which("nvidia-smi")
    if tool is None:
        return DoctorCheck("gpu", False, "no nvidia-smi", advice)
    try:
        ended = subprocess.run(
            [tool, "--query-gpu=name,driver_version,memory.free", "--format=csv,noheader"],
            capture_output=True, text=True, errors="replace", timeout=_TIMEOUT_S, check=False,
        )  # fmt: skip
    except (OSError, subprocess.TimeoutExpired) as error:
        return DoctorCheck("gpu", False, f"nvidia-smi: {type(error).__name__}", advice)
    lines = [line.strip() for line in ended.stdout.splitlines() if line.strip()]
    return DoctorCheck(
        "gpu", ended.returncode == 0 and bool(lines), "; ".join(lines) or ended.stderr.strip()[:200], advice
    )


def _has_method(file: Path, cls: str, method: str) -> bool:
    text = file.read_text(encoding="utf-8", errors="replace") if file.is_file() else ""
    return re.search(rf"^class {cls}\b(?:(?!^class ).)*^    def {method}\(", text, re.MULTILINE | re.DOTALL) is not None
