from __future__ import annotations

import pytest

from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.perturbations import Setting, paper_variables

ON = {"ROBUSTNESS_ENABLE": "1"}
LATE = {"INFERENCE_LATENCY_ENABLE": "1"}


@pytest.mark.parametrize(
    ("environ", "sentence"),
    [
        ({}, "clean"),
        (ON, "clean"),
        ({"ROBUSTNESS_ENABLE": "off", "GPS_DRIFT_ENABLE": "1"}, "clean"),
        ({**ON, "FRAME_DROP_ENABLE": "1"}, "1 s burst frame drop (reading=released)"),
        ({**ON, "FRAME_DROP_ENABLE": "1", "BURST_MAX_TICKS": "60"}, "3 s burst frame drop (reading=released)"),
        (
            {**ON, "FRAME_DROP_ENABLE": "1", "BURST_MAX_TICKS": "60", "SIM_RATE": "10"},
            "6 s burst frame drop (reading=released)",
        ),
        (
            {**ON, "FRAME_DROP_ENABLE": "1", "BURST_PROBABILITY": "0.1"},
            "1 s burst frame drop (reading=released, probability=0.1)",
        ),
        ({**ON, "PARTIAL_OBS_ENABLE": "1"}, "occlusion 0.5 (fill=blur)"),
        ({**ON, "PARTIAL_OBS_ENABLE": "1", "PARTIAL_OBS_RATIO": "0.8"}, "occlusion 0.8 (fill=blur)"),
        ({**ON, "PARTIAL_OBS_ENABLE": "1", "PARTIAL_OBS_TYPE": "occlusion"}, "occlusion 0.5"),
        (
            {**ON, "PARTIAL_OBS_ENABLE": "true", "PARTIAL_OBS_TYPE": "OCCLUSION", "PARTIAL_OBS_RATIO": "0.8"},
            "occlusion 0.8",
        ),
        ({**ON, "GPS_DRIFT_ENABLE": "1"}, "GPS noise 5 m"),
        ({**ON, "GPS_DRIFT_ENABLE": "1", "GPS_DRIFT_MODE": "severe"}, "GPS noise 15 m"),
        ({**ON, "GPS_NOISE_STD": "7.5"}, "GPS noise 7.5 m"),
        ({**ON, "GPS_NOISE_STD": "7.5", "GPS_DRIFT_MODE": "severe"}, "GPS noise 7.5 m"),
        ({**ON, "GPS_NOISE_STD": "7.5", "GPS_DRIFT_ENABLE": "0"}, "clean"),
        ({**ON, "SPEED_BIAS_ENABLE": "1"}, "speed noise 0.5"),
        (
            {**ON, "SPEED_BIAS_ENABLE": "1", "SPEED_BIAS_MEAN": "0.2", "SPEED_BIAS_STD": "0.1"},
            "speed noise 0.2 (std=0.1)",
        ),
        ({**ON, "SENSOR_DELAY_CAM": "2"}, "100 ms sensor delay (ego_ms=0)"),
        ({**ON, "SENSOR_DELAY_EGO": "4"}, "0 ms sensor delay (ego_ms=200)"),
        ({**ON, "SENSOR_DELAY_EGO": "4", "SENSOR_DELAY_CAM": "4"}, "200 ms sensor delay"),
        ({**ON, "BLEND_ENABLE": "1"}, "3 frame blend"),
        ({**ON, "BLEND_ENABLE": "1", "BLEND_NUM": "5", "BLEND_MODE": "linear"}, "5 frame blend (weights=linear)"),
        (LATE, "100 ms latency (reading=released)"),
        ({**LATE, "INFERENCE_LATENCY_MS": "200", "WARMUP_STEPS": "0"}, "200 ms latency (mode=hold)"),
        ({**LATE, "INFERENCE_LATENCY_MODE": "measured"}, "measured latency (reading=released)"),
        ({**LATE, "INFERENCE_LATENCY_MODE": "measured", "WARMUP_STEPS": "5"}, "measured latency (warmup_ticks=5)"),
        ({**LATE, "INFERENCE_LATENCY_MS": "", "ROBUSTNESS_SEED": " "}, "100 ms latency (reading=released)"),
        (
            {
                **ON,
                **LATE,
                "SENSOR_DELAY_CAM": "1",
                "SENSOR_DELAY_EGO": "1",
                "BLEND_ENABLE": "1",
                "FRAME_DROP_ENABLE": "1",
                "PARTIAL_OBS_ENABLE": "1",
                "GPS_DRIFT_ENABLE": "1",
                "SPEED_BIAS_ENABLE": "1",
                "WARMUP_STEPS": "0",
            },
            "50 ms sensor delay and 3 frame blend and 1 s burst frame drop (reading=released) and "
            "occlusion 0.5 (fill=blur) and GPS noise 5 m and speed noise 0.5 and 100 ms latency (mode=hold)",
        ),
    ],
)
def test_the_released_variables_ask_for_this_setting(environ: dict[str, str], sentence: str) -> None:
    setting = Setting.from_env(environ)
    assert str(setting) == sentence
    assert Setting.parse(sentence) == setting


@pytest.mark.parametrize(
    ("environ", "sentence"),
    [
        ({"PARTIAL_OBS_RATIO": "0.8"}, "occlusion 0.8"),
        ({"PARTIAL_OBS_RATIO": "0.8", "PARTIAL_OBS_TYPE": "blur"}, "occlusion 0.8 (fill=blur)"),
        ({"BURST_MAX_TICKS": "60"}, "3 s burst frame drop (reading=released)"),
        ({"BURST_PROBABILITY": "0.1"}, "1 s burst frame drop (reading=released, probability=0.1)"),
        ({"BURST_MAX_TICKS": "60", "SIM_RATE": "10"}, "6 s burst frame drop (reading=released)"),
        ({"GPS_NOISE_STD": "15"}, "GPS noise 15 m"),
        ({"SPEED_BIAS_MEAN": "0.2"}, "speed noise 0.2"),
        ({"SPEED_BIAS_STD": "0.1"}, "speed noise 0.5 (std=0.1)"),
        ({**LATE, "INFERENCE_LATENCY_MS": "200", "WARMUP_STEPS": "0"}, "200 ms latency (mode=hold)"),
    ],
)
def test_the_variables_of_the_papers_table_need_no_other_switch(environ: dict[str, str], sentence: str) -> None:
    assert str(Setting.from_env({**ON, **environ})) == sentence


@pytest.mark.parametrize(
    ("environ", "given", "switches"),
    [
        ({"PARTIAL_OBS_RATIO": "0.8"}, "PARTIAL_OBS_RATIO is '0.8'", "without ROBUSTNESS_ENABLE=1."),
        ({"GPS_DRIFT_ENABLE": "1"}, "GPS_DRIFT_ENABLE is '1'", "without ROBUSTNESS_ENABLE=1."),
        ({"SENSOR_DELAY_CAM": "2"}, "SENSOR_DELAY_CAM is '2'", "without ROBUSTNESS_ENABLE=1."),
        ({"BLEND_NUM": "5"}, "BLEND_NUM is '5'", "without ROBUSTNESS_ENABLE=1 and BLEND_ENABLE=1."),
        ({**ON, "BLEND_MODE": "linear"}, "BLEND_MODE is 'linear'", "without BLEND_ENABLE=1."),
        ({**ON, "PARTIAL_OBS_TYPE": "blur"}, "PARTIAL_OBS_TYPE is 'blur'", "without PARTIAL_OBS_ENABLE=1."),
        ({**ON, "GPS_DRIFT_MODE": "severe"}, "GPS_DRIFT_MODE is 'severe'", "without GPS_DRIFT_ENABLE=1."),
        ({"INFERENCE_LATENCY_MS": "200"}, "INFERENCE_LATENCY_MS is '200'", "without INFERENCE_LATENCY_ENABLE=1."),
        ({**ON, "WARMUP_STEPS": "5"}, "WARMUP_STEPS is '5'", "without INFERENCE_LATENCY_ENABLE=1."),
        (
            {**LATE, "INFERENCE_LATENCY_MODE": "measured", "INFERENCE_LATENCY_MS": "200"},
            "INFERENCE_LATENCY_MS='200'",
            "set INFERENCE_LATENCY_MODE=fixed",
        ),
    ],
)
def test_a_severity_that_would_do_nothing_is_refused_with_its_switch(
    environ: dict[str, str], given: str, switches: str
) -> None:
    with pytest.raises(UsageError) as caught:
        Setting.from_env(environ)
    assert given in str(caught.value)
    assert switches in str(caught.value)


@pytest.mark.parametrize(
    "environ",
    [
        {"ROBUSTNESS_ENABLE": "0", "PARTIAL_OBS_RATIO": "0.8", "SENSOR_DELAY_CAM": "2", "BLEND_NUM": "5"},
        {**ON, "PARTIAL_OBS_ENABLE": "0", "PARTIAL_OBS_RATIO": "0.8", "PARTIAL_OBS_TYPE": "blur"},
        {"GPS_DRIFT_ENABLE": "0", "GPS_DRIFT_MODE": "severe", "SENSOR_DELAY_EGO": "0"},
        {"INFERENCE_LATENCY_ENABLE": "0", "INFERENCE_LATENCY_MS": "200"},
    ],
)
def test_what_is_switched_off_in_so_many_words_is_clean(environ: dict[str, str]) -> None:
    assert Setting.from_env(environ) == Setting.CLEAN


@pytest.mark.parametrize("name", ["ROBUSTNESS_SEED", "GPS_DRIFT_SEED"])
def test_a_seed_of_the_environment_is_refused_because_the_episodes_seed_decides(name: str) -> None:
    with pytest.raises(UsageError, match=rf"{name} is '42'.*--drive-seeds=42"):
        Setting.from_env({**ON, "GPS_DRIFT_ENABLE": "1", name: "42"})


@pytest.mark.parametrize(
    ("environ", "words"),
    [
        ({"ROBUSTNESS_ENABLE": "maybe"}, ["ROBUSTNESS_ENABLE is 'maybe'", "expected one of 1, true"]),
        ({"SIM_RATE": "0"}, ["SIM_RATE is '0'", "a number above 0"]),
        ({"SIM_RATE": "fast"}, ["SIM_RATE is 'fast'"]),
        ({**ON, "FRAME_DROP_ENABLE": "1", "BURST_MAX_TICKS": "1"}, ["BURST_MAX_TICKS is '1'", "of at least 2"]),
        ({**ON, "FRAME_DROP_ENABLE": "1", "BURST_PROBABILITY": "1.5"}, ["BURST_PROBABILITY='1.5'", "in 0..1"]),
        ({**ON, "FRAME_DROP_ENABLE": "1", "BURST_PROBABILITY": "nan"}, ["BURST_PROBABILITY is 'nan'"]),
        ({**ON, "PARTIAL_OBS_ENABLE": "1", "PARTIAL_OBS_TYPE": "blurr"}, ["PARTIAL_OBS_TYPE", "Did you mean 'blur'?"]),
        ({**ON, "PARTIAL_OBS_ENABLE": "1", "PARTIAL_OBS_RATIO": "5"}, ["PARTIAL_OBS_RATIO='5'", "a share in 0..1"]),
        ({**ON, "GPS_DRIFT_ENABLE": "1", "GPS_DRIFT_MODE": "sever"}, ["GPS_DRIFT_MODE", "Did you mean 'severe'?"]),
        ({**ON, "GPS_NOISE_STD": "-3"}, ["GPS_NOISE_STD='-3'", "metres of at least 0"]),
        ({**ON, "SPEED_BIAS_ENABLE": "1", "SPEED_BIAS_STD": "-1"}, ["SPEED_BIAS_STD='-1'"]),
        ({**ON, "SENSOR_DELAY_CAM": "-1"}, ["SENSOR_DELAY_CAM is '-1'"]),
        ({**ON, "SENSOR_DELAY_EGO": "1.5"}, ["SENSOR_DELAY_EGO is '1.5'"]),
        ({**ON, "BLEND_ENABLE": "1", "BLEND_NUM": "0"}, ["BLEND_NUM is '0'"]),
        ({**LATE, "INFERENCE_LATENCY_MS": "-100"}, ["INFERENCE_LATENCY_MS='-100'", "milliseconds of at least 0"]),
        ({**LATE, "INFERENCE_LATENCY_MODE": "fifo"}, ["INFERENCE_LATENCY_MODE is 'fifo'", "one of fixed, measured"]),
        ({**LATE, "WARMUP_STEPS": "ten"}, ["WARMUP_STEPS is 'ten'"]),
    ],
)
def test_a_bad_value_is_named_with_its_variable(environ: dict[str, str], words: list[str]) -> None:
    with pytest.raises(UsageError) as caught:
        Setting.from_env(environ)
    for word in words:
        assert word in str(caught.value)


def test_the_environment_of_the_process_is_the_default(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROBUSTNESS_ENABLE", "1")
    monkeypatch.setenv("GPS_DRIFT_ENABLE", "1")
    assert str(Setting.from_env()) == "GPS noise 5 m"


def test_the_docstring_lists_every_variable_that_is_read() -> None:
    class Spy(dict[str, str]):
        asked: set[str] = set()  # noqa: RUF012

        def get(self, name: str, default: str | None = None) -> str:  # type: ignore[override]
            self.asked.add(name)
            return super().get(name, default or "")

    switches = ("FRAME_DROP", "PARTIAL_OBS", "GPS_DRIFT", "SPEED_BIAS", "BLEND")
    Setting.from_env(Spy({**ON, **LATE, **{f"{name}_ENABLE": "1" for name in switches}}))
    documented = {
        line.split("`")[1]
        for line in (paper_variables.perturbations_from.__doc__ or "").splitlines()
        if line.startswith("    `")
    }
    assert Spy.asked == documented
