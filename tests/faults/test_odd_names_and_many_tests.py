"""Route ids that no file could be called, and more tests than anybody reads, through the front door."""

from __future__ import annotations

import csv
import json
import re
import sys
import xml.etree.ElementTree as ElementTree

import pytest

from pytest_drive_robust.store.folder import FolderStore

WORKERS = pytest.mark.parametrize(
    "workers",
    [("--drive-executor=inline",), ("--drive-executor=processes",), ("-n2",)],
    ids=["inline", "pool", "xdist"],
)
ODD = """

IDS = [
    "../../up", "/etc/passwd", "C:\\\\\\\\win", "CON", "a/b", "nul\\0byte", "\\udcff\\udc80 surrogate", "\\ud83d half",
    "\\U0001f697 car", "line\\nbreak", "\\x1b[31mred", "a  b", "'; rm -rf", "%s%d{0}",
    "x" * 300, "y" * 10_000, "e\\u0301", "\\u00e9",
]


class Odd(LoggedSimulator):
    name = "odd"

    def routes(self, names):
        from pytest_drive_robust.testing import fake_route
        return tuple(fake_route(name, length_m=10.0) for name in IDS if not names or name in names)

    def reset(self, route, *, seed, cameras):
        with LOG.open("a", encoding="utf-8", errors="surrogatepass") as log:
            log.write(ascii(route.id)[:50] + " 0\\\\n")
        return FakeSimulator.reset(self, route, seed=seed, cameras=cameras)


@pytest.hookimpl(optionalhook=True)
def pytest_drive_robust_register(registry, _known=pytest_drive_robust_register):
    _known(registry)
    registry.register_simulator("odd", lambda options: Odd(replace(options, tick_cap=60)))
""".replace("\\\\n", "\\n").replace("\\\\\\\\", "\\\\")
COUNT = 18
ODD_TESTS = """
import pytest
from pytest_drive_robust import requirement
from pytest_drive_robust import requirements

@pytest.mark.parametrize("name", ["a/b", "\\U0001f697", "x" * 300, "nul\\0byte", "line\\nbreak", "e\\u0301"])
def test_named(drive, name):
    drive.check(requirement("DS") >= 99.9)

@pytest.mark.parametrize("wanted", requirements("RD under throttle 0.1 <= 0.01"))
def test_broken(drive, wanted):
    drive.check(wanted)
"""
MANY = """
import pytest
from pytest_drive_robust import requirements

LIMITS = requirements("\\n".join(f"DS under throttle {number / 10_000:.4f} >= 0.001" for number in range(1, 10_001)))

@pytest.mark.parametrize("wanted", LIMITS)
def test_many(drive, wanted):
    drive.check(wanted)
"""
MEASURED = """

def pytest_unconfigure(config):
    # not getrusage: its peak is also that of the process that started this one
    lines = Path("/proc/self/status").read_text().splitlines()
    Path("peak.txt").write_text(next(line.split()[1] for line in lines if line.startswith("VmHWM:")))
"""


@WORKERS
def test_names_of_routes_are_only_ever_text(suite, driven, workers):
    folder = suite(test=ODD_TESTS, conftest=ODD)
    ini = folder.path / "tox.ini"
    ini.write_text(ini.read_text().replace("drive_routes = routes.xml\n", ""))
    files = ("--drive-json=run.json", "--drive-csv=run.csv", "--junit-xml=run.xml")
    arguments = ("--drive-robust", "--drive-sim=odd", *files, *workers)
    before = {path.name for path in folder.path.iterdir()}
    result = folder.runpytest_subprocess(*arguments)
    result.assert_outcomes(passed=6, failed=1)
    assert result.ret == 1
    assert "INTERNALERROR" not in result.stdout.str()
    episodes = json.loads((folder.path / "run.json").read_text())["episodes"]
    assert len({item["route_id"] for item in episodes}) == COUNT
    assert len(episodes) == len(driven()) == 2 * COUNT
    with (folder.path / "run.csv").open(newline="", encoding="utf-8") as file:
        assert len(list(csv.DictReader(file))) == 2 * COUNT
    ElementTree.parse(folder.path / "run.xml")
    usual = {"__pycache__", ".pytest_cache", "driven.log", "stdout", "stderr", "runpytest-0", "runpytest-current"}
    new = {path.name for path in folder.path.iterdir()} - before - usual
    assert new == {".drive-robust", "run.json", "run.csv", "run.xml"}
    names = [path.name for path in (folder.path / ".drive-robust").glob("episodes/*/*")]
    assert all(re.fullmatch(r"[0-9a-f]+\.episode", name) for name in names)
    store = FolderStore(folder.path / ".drive-robust")
    stored = [store.get(name.removesuffix(".episode")) for name in names]
    assert len({item.episode.route_id for item in stored if item is not None}) == COUNT
    assert folder.runpytest_subprocess(*arguments).ret == 1
    assert len(driven()) == 2 * COUNT


@pytest.mark.slow
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="looks at its memory in /proc")
@pytest.mark.parametrize("mode", ["--collect-only", "--drive-plan"])
def test_ten_thousand_requirements_are_planned_in_seconds_and_little_memory(suite, driven, mode, request):
    if mode == "--collect-only":  # a plan collects them, too
        request.getfixturevalue("whole_study")
    resource = pytest.importorskip("resource")
    folder = suite(test=MANY, conftest=MEASURED)
    before_s = resource.getrusage(resource.RUSAGE_CHILDREN)
    result = folder.runpytest_subprocess("--drive-robust", "-q", mode)
    after_s = resource.getrusage(resource.RUSAGE_CHILDREN)
    assert result.ret == 0
    assert driven() == []
    used_s = after_s.ru_utime + after_s.ru_stime - before_s.ru_utime - before_s.ru_stime
    assert used_s < 60.0  # a square of ten thousand would take far longer
    assert int((folder.path / "peak.txt").read_text()) * 1024 < 600e6
