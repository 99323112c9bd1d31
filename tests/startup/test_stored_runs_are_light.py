"""A run whose episodes are all stored loads no world, starts no process, and says what the first one said."""

from __future__ import annotations

import os
import subprocess
import sys

HEAVY = ("cv2", "gymnasium", "highway_env", "matplotlib", "numba", "onnxruntime", "pandas", "scipy", "torch")
UNUSED = ("engine.supervisor", "engine.fork_server", "plugin.probe_option", "runner.driver", "runner.episode.loop")
"""Of ours, too: nobody drives."""

CONFTEST = f"""
import subprocess
import sys

STARTED = []
begin = subprocess.Popen.__init__

def count(self, *args, **options):
    STARTED.append(args or options)
    begin(self, *args, **options)

subprocess.Popen.__init__ = count

OPENED = []
sys.addaudithook(lambda event, given: OPENED.append(str(given[0])) if event == "open" else None)

def pytest_unconfigure():
    unused = {{f"pytest_drive_robust.{{name}}" for name in {UNUSED!r}}}
    print("LOADED", *sorted(set(sys.modules) & ({{*{HEAVY!r}}} | unused)))
    records = [path for path in OPENED if path.endswith(".episode")]
    print("TWICE", *sorted({{path for path in records if records.count(path) > 1}}))
    print("READ", len(records))
    print("STARTED", len([command for command in STARTED if "pytest_drive_robust" in str(command)]))
"""

SUITE = """
import pytest
from pytest_drive_robust import requirements

@pytest.mark.parametrize("requirement", requirements("DS under clean >= 100\\nDS under 200 ms latency >= 1"))
def test_it(drive, requirement):
    drive.check(requirement)
"""

OPTIONS = ("--drive-robust", "--drive-agent", "expert", "--drive-routes", "dev10:501", "--drive-workers", "1")


def test_the_second_run_loads_no_world_and_starts_no_process(tmp_path, plugin_args):
    (tmp_path / "conftest.py").write_text(CONFTEST)
    (tmp_path / "test_suite.py").write_text(SUITE)
    (tmp_path / "pytest.ini").write_text("[pytest]\ndrive_stuck_stop = 5\n")

    def run():
        command = [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", *plugin_args, *OPTIONS]
        done = subprocess.run(command, cwd=tmp_path, env=os.environ, capture_output=True, text=True, check=False)
        lines = {line.split()[0]: line.split()[1:] for line in done.stdout.splitlines() if line.strip()}
        assert "LOADED" in lines, done.stdout + done.stderr
        table = [line for line in done.stdout.splitlines() if "ms latency" in line]
        return lines, table

    first, said = run()
    assert first["STARTED"] != ["0"]
    second, said_again = run()
    assert second["LOADED"] == []
    assert second["STARTED"] == ["0"]
    assert second["TWICE"] == []
    assert second["READ"] == ["2"]
    assert said
    assert said_again[-1] == said[-1]
