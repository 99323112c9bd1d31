"""A requirement on a setting that changed nothing is an error; the record says what every episode was given."""

from __future__ import annotations

import json

from report_pages import data_of

DEAF = """

def deaf():
    return ScriptedAgent([Control(throttle=1.0)], consumes=())

AGENTS.append(deaf)
"""


def run(suite, *args):
    return suite.runpytest_inprocess("--drive-robust", "--drive-json", "run.json", *args)


def test_a_camera_failure_judged_on_an_agent_without_cameras_is_an_error_that_says_so(suite):
    folder = suite("RD under occlusion 0.5 <= 0.30")
    result = run(folder, "-n2")
    assert result.ret == 1
    result.assert_outcomes(errors=1)
    result.stdout.fnmatch_lines(
        [
            "ERROR: not judged: RD under occlusion 0.5 <= 0.30",
            "occlusion 0.5 changed nothing in all 3 episodes of agent 'steady', *",
            "  occlusion 0.5: the agent has no camera.",
            "  the agent has no camera; of its sensors it declares to use cameras, compass, gps, imu, speed.",
        ]
    )


WORDLESS = """

@dataclass
class Nothing(Perturbation):
    share: float = 1.0
    phrase = "nothing {share}"

    def actuate(self, tick, control, inference_s):
        return control

    def idle_reason(self, cameras):
        return "it does nothing"


@pytest.hookimpl(optionalhook=True)
def pytest_drive_robust_register(registry, _known=pytest_drive_robust_register):
    _known(registry)
    registry.register_perturbation(Nothing)
"""


def test_a_failure_that_cannot_say_why_it_changed_nothing_is_an_error_all_the_same(suite):
    result = run(suite("RD under nothing 1 <= 0.30", conftest=WORDLESS))
    result.assert_outcomes(errors=1)
    result.stdout.fnmatch_lines(
        [
            "nothing 1 changed nothing in all 3 episodes of agent 'steady', *",
            "  nothing 1: its idle_reason raised TypeError: *",
        ]
    )
    result.stdout.no_fnmatch_line("*Traceback*")


def test_an_agent_that_ignores_what_was_changed_is_judged_and_named_as_immune(suite):
    folder = suite("RD under GPS noise 5 m <= 0.30", conftest=DEAF)
    result = run(folder, "--drive-agent", "deaf", "--drive-report", "look")
    result.assert_outcomes(passed=1)
    told = "GPS noise 5 m changed gps, which deaf does not use: the agent has no camera;"
    result.stdout.fnmatch_lines([f"{told}*"])
    document = json.loads((folder.path / "run.json").read_text())
    for notes in (document["notes"], data_of(folder.path / "look")["notes"]):
        assert [note.startswith(told) for note in notes] == [True]
    episodes = document["episodes"]
    clean, noisy = episodes[0]["reception"], episodes[-1]["reception"]
    ticks = episodes[0]["ticks"]
    assert clean == {"cameras": [], "consumes": [], "observations": ticks, "touched": []}
    assert noisy["touched"] == [{"signal": "gps", "ticks": noisy["observations"], "first_tick": 0}]
