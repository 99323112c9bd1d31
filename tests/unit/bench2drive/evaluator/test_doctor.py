"""`drive-robust doctor` names what is missing and what to do about it."""

from __future__ import annotations

import os
import socket
import sys
from pathlib import Path

import pytest
from fake_bench2drive import make

from pytest_drive_robust.bench2drive.evaluator.doctor import DoctorCheck, examine
from pytest_drive_robust.cli.main import main


def named(checks: tuple[DoctorCheck, ...]) -> dict[str, DoctorCheck]:
    return {check.name: check for check in checks}


def free_ports() -> int:
    """Return the first of four, below those that the system hands out, and of this worker of the tests only."""
    own = 12000 + 100 * int("0" + os.environ.get("PYTEST_XDIST_WORKER", "")[2:])
    for first in range(own, own + 100, 4):
        try:
            for number in (first, first + 1, first + 2, first + 6000):
                with socket.socket() as server:
                    server.bind(("localhost", number))
        except OSError:
            continue
        return first
    raise AssertionError("no free ports")


def test_an_empty_folder_lacks_everything_with_an_advice_each(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("CARLA_ROOT", raising=False)
    assert main(["doctor", "--root", str(tmp_path), "--port", str(free_ports())]) == 1
    told = capsys.readouterr().out
    assert "MISSING  checkout" in told
    assert "Clone github.com/Thinklab-SJTU/Bench2Drive" in told
    assert "CARLA_ROOT is not set" in told
    assert "Unpack CARLA 0.9.15" in told


def test_a_checkout_without_client_and_maps_says_so(tmp_path: Path) -> None:
    root, carla, _ = make(tmp_path)
    checks = named(examine(root, carla_root=carla, python=sys.executable, port=free_ports()))
    assert checks["checkout"].ok
    assert checks["seams"].ok
    assert checks["server"].ok
    assert checks["python"].ok
    assert checks["ports"].ok
    assert not checks["maps"].ok
    assert "Town12, Town13 missing" in checks["maps"].found
    assert "AdditionalMaps" in checks["maps"].advice
    assert not checks["modules"].ok
    assert "requirements.txt" in checks["modules"].advice
    assert all(check.advice for check in checks.values() if check.ok is False)


def test_the_folder_of_carlas_api_is_no_client(tmp_path: Path) -> None:
    root, carla, _ = make(tmp_path)
    (carla / "PythonAPI/carla/dist").mkdir(parents=True)
    check = named(examine(root, carla_root=carla, python=sys.executable, port=free_ports()))["client"]
    assert not check.ok
    assert "only a folder" in check.found
    assert "pip install carla" in check.advice


def test_a_fork_without_the_seams_is_recognised(tmp_path: Path) -> None:
    root, carla, _ = make(tmp_path)
    (root / "leaderboard/leaderboard/envs/sensor_interface.py").write_text("class SensorInterface:\n    pass\n")
    checks = named(examine(root, carla_root=carla, port=free_ports()))
    assert not checks["seams"].ok
    assert "SensorInterface.get_data" in checks["seams"].found


def test_a_python_without_getchildren_is_recognised_where_the_checkout_calls_it(tmp_path: Path) -> None:
    root, carla, _ = make(tmp_path)
    parser = root / "leaderboard/leaderboard/route_parser.py"
    parser.write_text("for item in scenario.getchildren():\n")
    check = named(examine(root, carla_root=carla, python=sys.executable, port=free_ports()))["python"]
    assert not check.ok
    assert "route_parser.py" in check.found
    assert "3.7 or 3.8" in check.advice
    parser.write_text("for item in list(scenario):\n")
    assert named(examine(root, carla_root=carla, python=sys.executable, port=free_ports()))["python"].ok


def test_a_wrong_server_a_taken_port_and_a_dead_python_are_found(tmp_path: Path) -> None:
    root, carla, _ = make(tmp_path)
    (carla / "VERSION").write_text("0.10.0")
    port = free_ports()
    with socket.socket() as server:
        server.bind(("localhost", port + 1))
        checks = named(examine(root, carla_root=carla, python=str(tmp_path / "no-python"), port=port))
    assert not checks["server"].ok
    assert "0.10.0" in checks["server"].found
    assert str(port + 1) in checks["ports"].found
    assert not checks["python"].ok
    (carla / "CarlaUE4.sh").chmod(0o644)
    assert "chmod +x" in named(examine(root, carla_root=carla, port=port))["server"].advice


def test_a_taken_port_stops_nothing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    port = free_ports()
    with socket.socket() as server:
        server.bind(("localhost", port))
        check = named(examine(tmp_path, port=port))["ports"]
        main(["doctor", "--root", str(tmp_path), "--port", str(port)])
    assert check.ok is None
    assert "The next free ones are used" in check.advice
    assert f"note     ports          {port} taken" in capsys.readouterr().out


@pytest.mark.parametrize("port", ["61000", "99999", "-5"])
def test_a_port_that_there_is_not_is_misuse(tmp_path: Path, capsys: pytest.CaptureFixture[str], port: str) -> None:
    assert main(["doctor", "--root", str(tmp_path), "--port", port]) == 4
    assert f"the first port is {port}: " in capsys.readouterr().err


@pytest.mark.parametrize(("variable", "ok", "told"), [("GPU-8f1c", False, "is 'GPU-8f1c'"), ("2,5", True, "2, 5")])
def test_gpus_that_carla_cannot_be_told_are_found(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, variable: str, ok: bool, told: str
) -> None:
    monkeypatch.setenv("CUDA_VISIBLE_DEVICES", variable)
    check = named(examine(tmp_path, port=free_ports()))["gpu numbers"]
    assert check.ok is ok
    assert told in check.found
