"""`--drive-vehicle`: what the agent drives, from the command line to the stored run."""

from __future__ import annotations

import json

AGENT = """
def gentle():
    return ScriptedAgent([Control(throttle=0.6, steer=0.02)])

AGENTS.append(gentle)
"""


OPTIONS = (
    *("--drive-robust", "--drive-sim", "embedded", "--drive-agent", "gentle", "--drive-routes", "201"),
    *("--drive-executor", "inline", "--drive-stuck-stop", "5"),
)


def driven(folder, name, *args):
    result = folder.runpytest_inprocess(*OPTIONS, "--drive-json", name, *args)
    assert result.ret == 0, result.outlines
    return json.loads((folder.path / name).read_text())


def test_another_vehicle_drives_otherwise_and_every_record_tells_it(suite):
    folder = suite("DS under clean <= 99", conftest=AGENT)
    usual, mkz = driven(folder, "usual.json"), driven(folder, "mkz.json", "--drive-vehicle", "mkz")
    assert "vehicle" not in usual["settings"]
    assert mkz["settings"]["vehicle"] == "mkz"
    (before,), (after,) = usual["episodes"], mkz["episodes"]
    assert before["trace_digest"] != after["trace_digest"]
    assert "vehicle" not in before["versions"]
    assert after["versions"]["vehicle"] == "mkz"
    with (folder.path / "tox.ini").open("a") as ini:
        ini.write("drive_vehicle = mkz\n")
    assert driven(folder, "again.json")["episodes"][0]["trace_digest"] == after["trace_digest"]
    compared = folder.runpytest_inprocess(*OPTIONS, "--drive-compare", "usual.json")
    assert "the vehicle was bicycle and is mkz" in "\n".join((*compared.outlines, *compared.errlines))
