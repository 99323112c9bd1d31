"""The environment variables of the paper's released code, read into a `Setting`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from pytest_drive_robust.perturbations.base import Perturbation
from pytest_drive_robust.perturbations.blend import FrameBlend
from pytest_drive_robust.perturbations.camera import BurstFrameDrop, PartialObservation
from pytest_drive_robust.perturbations.compute import InferenceLatency
from pytest_drive_robust.perturbations.delay import SensorDelay
from pytest_drive_robust.perturbations.ego_state import GpsNoise, SpeedNoise
from pytest_drive_robust.perturbations.setting import Setting
from pytest_drive_robust.perturbations.variables import Variables

__all__ = ["setting_from"]

_GPS_LEVELS_M = {"medium": 5.0, "severe": 15.0}


def setting_from(environ: Mapping[str, str]) -> Setting:
    """The stack that the variables ask for, in the order of the released code and with its readings.

    ========================== ======== =============================================================================
    variable                   default  meaning
    ========================== ======== =============================================================================
    `SIM_RATE`                 20       ticks per second, converts the variables that count ticks
    `ROBUSTNESS_ENABLE`        0        1 switches the perturbations of observations on: all but the latency
    `ROBUSTNESS_SEED`          none     must be a whole number; not used, the seed of the episode decides
    `SENSOR_DELAY_CAM`         0        ticks by which images come late
    `SENSOR_DELAY_EGO`         0        ticks by which GPS, compass, IMU and speed come late
    `BLEND_ENABLE`             0        1: each image is the mean of the last few
    `BLEND_NUM`                3        how many images
    `BLEND_MODE`               uniform  `uniform` or `linear` weights
    `FRAME_DROP_ENABLE`        0        1: bursts of frozen images of 2 to `BURST_MAX_TICKS` ticks (`length="uniform"`)
    `BURST_PROBABILITY`        0.01     that a burst starts, per camera and tick
    `BURST_MAX_TICKS`          20       the longest burst in ticks, 2 or more
    `PARTIAL_OBS_ENABLE`       0        1: a rectangle of every image shows nothing
    `PARTIAL_OBS_TYPE`         blur     `blur` or `occlusion` (black)
    `PARTIAL_OBS_RATIO`        0.5      share of each side of the image
    `GPS_DRIFT_ENABLE`         0        1: noise on the position; `GPS_NOISE_STD` alone switches it on as well
    `GPS_DRIFT_MODE`           medium   `medium` (5 m) or `severe` (15 m)
    `GPS_NOISE_STD`            none     metres, wins over `GPS_DRIFT_MODE` (named in the paper only)
    `GPS_DRIFT_SEED`           none     must be a whole number; not used, the seed of the episode decides
    `SPEED_BIAS_ENABLE`        0        1: the speed is multiplied by a random factor
    `SPEED_BIAS_MEAN`          0.5      mean of the factor
    `SPEED_BIAS_STD`           0.2      standard deviation of the factor
    `INFERENCE_LATENCY_ENABLE` 0        1: late commands, whatever `ROBUSTNESS_ENABLE` says
    `INFERENCE_LATENCY_MODE`   fixed    `fixed` (our `mode="hold"`) or `measured`
    `INFERENCE_LATENCY_MS`     100      milliseconds, for `fixed`
    `WARMUP_STEPS`             20       ticks with neutral commands at the start of an episode under latency
    ========================== ======== =============================================================================

    Switches take 1/0, true/false, yes/no, on/off. An empty variable counts as not set. Raises `UsageError` with the
    variable and its value.

    >>> str(setting_from({"INFERENCE_LATENCY_ENABLE": "1", "INFERENCE_LATENCY_MS": "200"}))
    '200 ms latency (mode=hold, warmup_ticks=20)'
    """
    variables = Variables(environ)
    for seed in ("ROBUSTNESS_SEED", "GPS_DRIFT_SEED"):
        variables.whole(seed, 0, low=None)
    rate_hz = variables.number("SIM_RATE", 20.0, above=0.0)
    stack: list[Perturbation] = []
    if variables.switch("ROBUSTNESS_ENABLE"):
        stack += [*_timing(variables, rate_hz), *_camera(variables, rate_hz), *_ego_state(variables)]
    if variables.switch("INFERENCE_LATENCY_ENABLE"):
        stack.append(_latency(variables))
    return Setting.of(*stack)


def _timing(variables: Variables, rate_hz: float) -> Iterator[Perturbation]:
    camera_ticks = variables.whole("SENSOR_DELAY_CAM", 0)
    ego_ticks = variables.whole("SENSOR_DELAY_EGO", 0)
    if camera_ticks or ego_ticks:
        yield SensorDelay(camera_ms=1000.0 * camera_ticks / rate_hz, ego_ms=1000.0 * ego_ticks / rate_hz)
    if variables.switch("BLEND_ENABLE"):
        frames = variables.whole("BLEND_NUM", 3, low=1)
        weights = variables.choice("BLEND_MODE", "uniform", ("uniform", "linear"))
        yield variables.made(FrameBlend, ("BLEND_NUM", "BLEND_MODE"), {"frames": frames, "weights": weights})


def _camera(variables: Variables, rate_hz: float) -> Iterator[Perturbation]:
    if variables.switch("FRAME_DROP_ENABLE"):
        severities = {
            "length_s": variables.whole("BURST_MAX_TICKS", 20, low=2) / rate_hz,
            "probability": variables.number("BURST_PROBABILITY", 0.01),
            "length": "uniform",
        }
        yield variables.made(BurstFrameDrop, ("BURST_MAX_TICKS", "BURST_PROBABILITY"), severities)
    if variables.switch("PARTIAL_OBS_ENABLE"):
        fill = variables.choice("PARTIAL_OBS_TYPE", "blur", ("blur", "occlusion"))
        severities = {
            "ratio": variables.number("PARTIAL_OBS_RATIO", 0.5),
            "fill": "black" if fill == "occlusion" else fill,
        }
        yield variables.made(PartialObservation, ("PARTIAL_OBS_RATIO",), severities)


def _ego_state(variables: Variables) -> Iterator[Perturbation]:
    if variables.switch("GPS_DRIFT_ENABLE", default=bool(variables.text("GPS_NOISE_STD"))):
        level_m = _GPS_LEVELS_M[variables.choice("GPS_DRIFT_MODE", "medium", tuple(_GPS_LEVELS_M))]
        yield variables.made(GpsNoise, ("GPS_NOISE_STD",), {"std_m": variables.number("GPS_NOISE_STD", level_m)})
    if variables.switch("SPEED_BIAS_ENABLE"):
        severities = {
            "mean": variables.number("SPEED_BIAS_MEAN", 0.5),
            "std": variables.number("SPEED_BIAS_STD", 0.2),
        }
        yield variables.made(SpeedNoise, ("SPEED_BIAS_MEAN", "SPEED_BIAS_STD"), severities)


def _latency(variables: Variables) -> InferenceLatency:
    warmup_ticks = variables.whole("WARMUP_STEPS", 20)
    if variables.choice("INFERENCE_LATENCY_MODE", "fixed", ("fixed", "measured")) == "measured":
        return InferenceLatency(mode="measured", warmup_ticks=warmup_ticks)
    ms = variables.number("INFERENCE_LATENCY_MS", 100.0)
    severities = {"ms": ms, "mode": "hold", "warmup_ticks": warmup_ticks}
    return variables.made(InferenceLatency, ("INFERENCE_LATENCY_MS",), severities)
