"""What reaches an official agent through `inject.py` is what the package's own loop would have given it, to the bit."""

from __future__ import annotations

import ast
import importlib.util
import json
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st
from official_stream import (
    CAMERAS,
    FIRST_FRAME,
    OfficialDrive,
    fresh_classes,
    recorded,
    same_bits,
    through_package,
)

from pytest_drive_robust.bench2drive.evaluator import inject
from pytest_drive_robust.bench2drive.evaluator.injection.injector import Injector
from pytest_drive_robust.bench2drive.evaluator.injection.payloads import cameras_of
from pytest_drive_robust.bench2drive.evaluator.injection.plan import SettingRefusedError, plan_from
from pytest_drive_robust.bench2drive.evaluator.injection.seams import wrap
from pytest_drive_robust.bench2drive.evaluator.setup import setting_as_json
from pytest_drive_robust.errors import PerturbationError, UsageError
from pytest_drive_robust.perturbations import (
    BUILTIN,
    BurstFrameDrop,
    FrameBlend,
    GpsNoise,
    InferenceLatency,
    PartialObservation,
    Perturbation,
    SensorDelay,
    Setting,
    SpeedNoise,
)

TICKS = 24
_shares = st.floats(0.0, 1.0)
_ms = st.sampled_from([0.0, 50.0, 100.0, 149.0, 200.0, 500.0, 2000.0])
_counts = st.integers(0, 25)
_one: dict[str, st.SearchStrategy[Perturbation]] = {
    "burst-frame-drop": st.builds(
        BurstFrameDrop,
        st.floats(0.1, 2.0),
        st.sampled_from([0.0, 0.05, 0.3, 1.0]),
        st.sampled_from(["fixed", "uniform"]),
    ),
    "partial-observation": st.builds(
        PartialObservation,
        _shares,
        st.booleans(),
        st.sampled_from(["black", "gray", "blur"]),
    ),
    "gps-noise": st.builds(GpsNoise, st.floats(0.0, 50.0)),
    "speed-noise": st.builds(SpeedNoise, st.floats(0.0, 2.0), st.floats(0.0, 1.0), st.booleans()),
    "inference-latency": st.one_of(
        st.builds(InferenceLatency, _ms, st.sampled_from(["fifo", "hold"]), _counts),
        st.builds(
            InferenceLatency,
            ms=st.none(),
            mode=st.just("measured"),
            warmup_ticks=_counts,
            replay_s=st.lists(st.floats(0.0, 0.4), min_size=TICKS, max_size=TICKS),
        ),
    ),
    "sensor-delay": st.builds(SensorDelay, _ms, st.one_of(st.none(), _ms)),
    "frame-blend": st.builds(FrameBlend, st.integers(1, 30), st.sampled_from(["uniform", "linear"])),
}


def injected(stream: list[dict[str, Any]], environ: dict[str, str], route: str, log: Path | None = None) -> Any:
    classes = fresh_classes()
    if log is not None:
        environ = {**environ, "PDR_LOG": str(log)}
    drive = OfficialDrive(classes, stream)
    injector = Injector(plan_from(environ))
    wrap(injector, classes.interface, classes.wrapper, classes.manager, lambda: drive.frame)
    return drive.drive(route)


def agree(perturbations: tuple[Perturbation, ...], *, seed: int, route: str, stream_seed: int, log: Path) -> None:
    setting = Setting.of(*perturbations)
    stream = recorded(TICKS, seed=stream_seed)
    log.unlink(missing_ok=True)
    outside = injected(stream, {"PDR_SETTING": setting_as_json(setting, seed=seed, log=str(log))}, route)
    inside = through_package(stream, setting, route=route, seed=seed)
    same_bits(outside, inside)
    (line,) = [json.loads(text) for text in log.read_text().splitlines()]
    assert sorted(map(tuple, line["schedule"])) == inside.schedule
    assert line["inference_s"] == inside.inference_s
    assert (line["route"], line["seed"], line["setting"], line["ticks"]) == (route, seed, str(setting), TICKS)


def test_every_builtin_perturbation_is_tried_here() -> None:
    assert set(BUILTIN) == set(_one)


@pytest.mark.parametrize("name", sorted(_one))
def test_one_perturbation_gives_the_same_bits_as_the_package(name: str, tmp_path: Path) -> None:
    @settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.too_slow])
    @given(_one[name], st.integers(-5, 2**63), st.text(max_size=8), st.integers(0, 3))
    def agrees(perturbation: Perturbation, seed: int, route: str, stream_seed: int) -> None:
        agree((perturbation,), seed=seed, route=route, stream_seed=stream_seed, log=tmp_path / "log.jsonl")

    agrees()


def test_stacks_give_the_same_bits_as_the_package(tmp_path: Path) -> None:
    @settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.too_slow])
    @given(st.lists(st.one_of(*_one.values()), max_size=5), st.integers(0, 2**40))
    @example([], 0)
    @example([BurstFrameDrop(1, 0.3), PartialObservation(0.5, fill="blur"), BurstFrameDrop(0.5, 0.3)], 3)
    @example([InferenceLatency(100, "hold"), GpsNoise(5), InferenceLatency(200)], 1)
    @example([SensorDelay(100), SpeedNoise(0.2), GpsNoise(15), GpsNoise(15), SensorDelay(100, 0)], 2)
    def agrees(perturbations: list[Perturbation], seed: int) -> None:
        agree(tuple(perturbations), seed=seed, route="2091", stream_seed=1, log=tmp_path / "log.jsonl")

    agrees()


@pytest.mark.parametrize(
    "variables",
    [
        {},
        {"ROBUSTNESS_ENABLE": "1", "FRAME_DROP_ENABLE": "yes", "BURST_PROBABILITY": "0.2", "BURST_MAX_TICKS": "6"},
        {"ROBUSTNESS_ENABLE": "1", "PARTIAL_OBS_ENABLE": "1", "PARTIAL_OBS_RATIO": "0.8"},
        {"ROBUSTNESS_ENABLE": "1", "PARTIAL_OBS_ENABLE": "1", "PARTIAL_OBS_TYPE": "occlusion"},
        {"ROBUSTNESS_ENABLE": "1", "GPS_DRIFT_ENABLE": "1", "GPS_DRIFT_MODE": "severe", "SPEED_BIAS_ENABLE": "on"},
        {"ROBUSTNESS_ENABLE": "1", "GPS_NOISE_STD": "7", "SENSOR_DELAY_CAM": "2", "BLEND_ENABLE": "1"},
        {"INFERENCE_LATENCY_ENABLE": "1", "INFERENCE_LATENCY_MS": "200", "WARMUP_STEPS": "3"},
        {"ROBUSTNESS_ENABLE": "1", "PARTIAL_OBS_RATIO": "0.8"},
        {"ROBUSTNESS_ENABLE": "1", "BURST_PROBABILITY": "0.2", "SPEED_BIAS_STD": "0.4"},
        {"ROBUSTNESS_ENABLE": "1", "PARTIAL_OBS_RATIO": "0.8", "PARTIAL_OBS_TYPE": "blur", "GPS_DRIFT_ENABLE": "0"},
        {"ROBUSTNESS_ENABLE": "0", "GPS_DRIFT_ENABLE": "1", "SENSOR_DELAY_CAM": "2"},
    ],
)
def test_the_variables_of_the_released_code_mean_the_same_as_in_the_package(variables: dict[str, str]) -> None:
    stream = recorded(TICKS)
    inside = through_package(stream, Setting.from_env(variables), route="17", seed=11)
    same_bits(injected(stream, {**variables, "ROBUSTNESS_SEED": "11"}, "17"), inside)


@pytest.mark.parametrize(
    "variables",
    [
        {"ROBUSTNESS_ENABLE": "perhaps"},
        {"ROBUSTNESS_ENABLE": "1", "GPS_NOISE_STD": "-1"},
        {"ROBUSTNESS_ENABLE": "1", "PARTIAL_OBS_ENABLE": "1", "PARTIAL_OBS_RATIO": "1.5"},
        {"ROBUSTNESS_ENABLE": "1", "FRAME_DROP_ENABLE": "1", "BURST_MAX_TICKS": "1"},
        {"ROBUSTNESS_ENABLE": "1", "BLEND_ENABLE": "1", "BLEND_MODE": "cubic"},
        {"INFERENCE_LATENCY_ENABLE": "1", "INFERENCE_LATENCY_MS": "fast"},
        {"ROBUSTNESS_SEED": "x"},
        {"GPS_DRIFT_SEED": "7"},
        {"GPS_DRIFT_ENABLE": "1"},
        {"PARTIAL_OBS_RATIO": "0.8"},
        {"SENSOR_DELAY_CAM": "2"},
        {"INFERENCE_LATENCY_MS": "200"},
        {"ROBUSTNESS_ENABLE": "1", "PARTIAL_OBS_TYPE": "blur"},
        {"INFERENCE_LATENCY_ENABLE": "1", "INFERENCE_LATENCY_MODE": "measured", "INFERENCE_LATENCY_MS": "200"},
    ],
)
def test_variables_that_the_package_refuses_are_refused_with_their_name(variables: dict[str, str]) -> None:
    with pytest.raises(UsageError):
        Setting.from_env(variables)
    with pytest.raises(SettingRefusedError, match=list(variables)[-1]):
        plan_from(variables)


@pytest.mark.parametrize(
    "text",
    [
        "{", "[]", "3", '{"seed": 1}', '{"stack": [{"name": "fog"}]}',
        '{"stack": [{"name": "gps-noise", "parameters": {"ratio": 1}}]}',
        '{"stack": [{"name": "inference-latency", "parameters": {"ms": 20}}]}',
    ],
)  # fmt: skip
def test_a_setting_that_cannot_be_injected_is_refused_before_anything_is_driven(text: str) -> None:
    with pytest.raises(SettingRefusedError):
        plan_from({"PDR_SETTING": text})


def test_masks_and_bursts_are_those_of_the_cameras_places_whatever_their_ids() -> None:
    sensors = [{"type": "sensor.other.imu", "id": "IMU"}, *({"type": "sensor.camera.rgb", "id": tag} for tag in "ba")]
    assert [camera.name for camera in cameras_of(sensors)] == ["b", "a"]


def test_the_clean_setting_hands_over_the_very_objects() -> None:
    stream = recorded(2)
    injector = Injector(plan_from({"PDR_SETTING": setting_as_json(Setting.CLEAN, seed=0)}))
    raw = {tag: (FIRST_FRAME, payload) for tag, payload in stream[0].items()}
    control = object()

    def agent() -> object:
        given_data = injector.data(lambda: raw, FIRST_FRAME)
        assert all(given_data[tag][1] is payload for tag, (_, payload) in raw.items())
        return control

    assert injector.step(agent, lambda: None) is control


def test_the_debug_camera_and_the_lidar_stay_as_they_are() -> None:
    stream = recorded(8)
    setting = PartialObservation(1.0) + SensorDelay(200) + FrameBlend(3)
    driven = injected(stream, {"PDR_SETTING": setting_as_json(setting, seed=0)}, "1")
    for tick, payloads in enumerate(driven.given):
        assert payloads is not None
        assert np.array_equal(payloads["bev"], stream[tick]["bev"])
        assert np.array_equal(payloads["LIDAR"], stream[tick]["LIDAR"])
        assert all(payloads[camera][..., :3].max() == 0 for camera in CAMERAS)


def test_a_second_route_in_the_same_process_starts_from_nothing(tmp_path: Path) -> None:
    setting = BurstFrameDrop(1, 0.4) + SensorDelay(300) + InferenceLatency(300) + GpsNoise(5)
    classes, log = fresh_classes(), tmp_path / "log.jsonl"
    stream = recorded(TICKS)
    drive = OfficialDrive(classes, stream)
    plan = plan_from({"PDR_SETTING": setting_as_json(setting, seed=5, log=str(log))})
    wrap(Injector(plan), classes.interface, classes.wrapper, classes.manager, lambda: drive.frame)
    for route, rep in (("7", 0), ("8", 0), ("7", 1), ("7", 0)):
        drive.sensor_interface.reads.clear()
        same_bits(drive.drive(route, rep=rep), through_package(stream, setting, route=route, seed=5 + rep))
    lines = [json.loads(text) for text in log.read_text().splitlines()]
    assert [(line["route"], line["repetition"], line["seed"]) for line in lines] == [
        ("7", 0, 5), ("8", 0, 5), ("7", 1, 6), ("7", 0, 5),
    ]  # fmt: skip
    assert lines[0] == lines[3]


def test_noise_far_from_the_equator_is_as_many_metres_on_the_ground() -> None:
    fix = np.array([42.0, 2.0, 11.0])
    plan = plan_from({"PDR_SETTING": setting_as_json(Setting.of(GpsNoise(10.0)), seed=0)})
    injector = Injector(plan)
    injector.begin("1", 0)
    moved = [injector.data(lambda: {"GPS": (tick, fix)}, tick)["GPS"][1] for tick in range(2000)]  # noqa: B023
    metres_per_degree = np.array([111_194.9, 111_194.9 * np.cos(np.radians(42.0))])
    spread_m = np.std([(item[:2] - fix[:2]) * metres_per_degree for item in moved], axis=0)
    assert spread_m == pytest.approx([10.0, 10.0], rel=0.06)
    assert all(item[2] == 11.0 for item in moved)


def test_a_perturbation_of_ones_own_is_not_sent_into_another_python() -> None:
    class Fog(Perturbation):
        phrase = "fog"

    with pytest.raises(PerturbationError, match=r"'fog'.*Fog.*gps-noise"):
        setting_as_json(Setting.of(GpsNoise(), Fog()), seed=0)


def test_a_fault_of_ours_is_raised_as_the_exception_that_does_not_blame_the_agent() -> None:
    class NoDataError(Exception):
        pass

    injector = Injector(plan_from({"PDR_SETTING": setting_as_json(Setting.of(GpsNoise()), seed=0)}), NoDataError)
    broken = {"GPS": (1, np.array([91.0, 0.0, 0.0]))}
    with pytest.raises(NoDataError, match="the injection failed"):
        injector.step(lambda: injector.data(lambda: broken, 1), lambda: None)


def test_wrapping_twice_is_refused() -> None:
    classes = fresh_classes()
    injector = Injector(plan_from({}))
    wrap(injector, classes.interface, classes.wrapper, classes.manager, lambda: 0)
    with pytest.raises(SettingRefusedError, match="already wrapped"):
        wrap(injector, classes.interface, classes.wrapper, classes.manager, lambda: 0)


def test_the_module_and_all_that_it_imports_are_python_3_7_with_numpy_alone() -> None:
    code = (
        "import json, runpy, sys; before = set(sys.modules); runpy.run_path(sys.argv[1]); "
        "new = {name: module for name, module in sys.modules.items() if name not in before}; "
        "own = [module.__file__ for name, module in new.items() if name.startswith('pytest_drive_robust')]; "
        "print(json.dumps([sorted({name.partition('.')[0] for name in new}), own]))"
    )
    told = subprocess.run([sys.executable, "-c", code, inject.__file__], check=True, capture_output=True, text=True)
    packages, files = json.loads(told.stdout)
    own = [inject.__file__, *files]
    assert len(files) > 20
    assert set(packages) - sys.stdlib_module_names <= {"numpy", "pytest_drive_robust"}
    for file in own:
        tree = ast.parse(Path(file).read_text(encoding="utf-8"), feature_version=(3, 7))
        assert not [node for node in ast.walk(tree) if isinstance(node, ast.NamedExpr)], file
    if importlib.util.find_spec("vermin") is not None:
        code = "from vermin import main; main()"
        options = ["--no-tips", "--no-eval-annotations", "--format", "parsable"]
        told = subprocess.run([sys.executable, "-c", code, *options, *own], capture_output=True, text=True)
        later = re.findall(r"3\.(?:8|9|\d\d):(.+)", told.stdout)
        unexpected = [feature for feature in later if not any(name in feature for name in _EXPECTED)]
        assert len(later) > 5
        assert not [feature for feature in unexpected if feature.strip()]


def test_what_pythons_before_3_9_cannot_subscript_is_not_subscripted() -> None:
    code = (
        "import runpy, sys, types; runpy.run_path(sys.argv[1]); "
        "modules = [module for name, module in sys.modules.items() if name.startswith('pytest_drive_robust')]; "
        "print(len(modules), [name for module in modules for name, value in vars(module).items() "
        "if isinstance(value, types.GenericAlias)])"
    )
    told = subprocess.run([sys.executable, "-c", code, inject.__file__], check=True, capture_output=True, text=True)
    count, _, made = told.stdout.partition(" ")
    assert int(count) > 20
    assert made.strip() == "[]"


_EXPECTED = (
    "dataclasses.dataclass(slots)", "typing.Literal", "typing.Protocol",  # inject gives them to older ones
    "literal variable annotations",
    "importlib.metadata", "types.UnionType", "typing.get_args", "typing.get_origin",  # in functions not called there
)  # fmt: skip
