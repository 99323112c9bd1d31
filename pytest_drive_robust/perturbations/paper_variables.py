"""The environment variables of the paper and of its released code, read into perturbations."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Generic, TypeVar

from pytest_drive_robust.errors import PerturbationError, UsageError, did_you_mean

_P = TypeVar("_P")

_GPS_LEVELS_M = {"medium": 5.0, "severe": 15.0}
_ON_OFF = {"1": True, "true": True, "yes": True, "on": True, "0": False, "false": False, "no": False, "off": False}
_SEEDS = ("ROBUSTNESS_SEED", "GPS_DRIFT_SEED")
_DELAYS = ("SENSOR_DELAY_CAM", "SENSOR_DELAY_EGO")
_LATENCY = "INFERENCE_LATENCY_ENABLE"
_OBSERVATION = "ROBUSTNESS_ENABLE"
_SEVERITIES: dict[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "BLEND_ENABLE": ((), ("BLEND_NUM", "BLEND_MODE")),
    "FRAME_DROP_ENABLE": (("BURST_MAX_TICKS", "BURST_PROBABILITY"), ()),
    "PARTIAL_OBS_ENABLE": (("PARTIAL_OBS_RATIO",), ("PARTIAL_OBS_TYPE",)),
    "GPS_DRIFT_ENABLE": (("GPS_NOISE_STD",), ("GPS_DRIFT_MODE",)),
    "SPEED_BIAS_ENABLE": (("SPEED_BIAS_MEAN", "SPEED_BIAS_STD"), ()),
    _LATENCY: ((), ("INFERENCE_LATENCY_MS", "INFERENCE_LATENCY_MODE", "WARMUP_STEPS")),
}
"""The severities of each switch, in two groups. The first group is in the paper's table, which has no switch but
`ROBUSTNESS_ENABLE` and `INFERENCE_LATENCY_ENABLE`, so each of these severities switches its perturbation on. The second
group does nothing without the switch."""


def perturbations_from(environ: Mapping[str, str], known: Mapping[str, Callable[..., _P]]) -> list[_P]:
    """Return what the variables ask for, built from the classes `known`, in the order of the released code.

    ========================== ======== =============================================================================
    variable                   default  meaning
    ========================== ======== =============================================================================
    `SIM_RATE`                 20       ticks per second, converts the variables that count ticks but `WARMUP_STEPS`
    `ROBUSTNESS_ENABLE`        0        1 switches the perturbations of observations on: all but the latency
    `ROBUSTNESS_SEED`          none     refused: the seed of the episode decides, `--drive-seeds`
    `SENSOR_DELAY_CAM`         0        ticks by which images come late
    `SENSOR_DELAY_EGO`         0        ticks by which GPS, compass, IMU and speed come late
    `BLEND_ENABLE`             0        1: each image is the mean of the last few
    `BLEND_NUM`                3        how many images
    `BLEND_MODE`               uniform  `uniform` or `linear` weights
    `FRAME_DROP_ENABLE`        (*)      1: bursts of frozen images of 2 to `BURST_MAX_TICKS` ticks (`length="uniform"`)
    `BURST_PROBABILITY`        0.01     that a burst starts, per camera and tick
    `BURST_MAX_TICKS`          20       the longest burst in ticks, 2 or more
    `PARTIAL_OBS_ENABLE`       (*)      1: a rectangle of every image shows nothing
    `PARTIAL_OBS_TYPE`         blur     `blur` or `occlusion` (black, the default where the ratio alone is given)
    `PARTIAL_OBS_RATIO`        0.5      share of each side of the image
    `GPS_DRIFT_ENABLE`         (*)      1: noise on the position
    `GPS_DRIFT_MODE`           medium   `medium` (5 m) or `severe` (15 m)
    `GPS_NOISE_STD`            none     metres, wins over `GPS_DRIFT_MODE` (named in the paper only)
    `GPS_DRIFT_SEED`           none     refused: the seed of the episode decides, `--drive-seeds`
    `SPEED_BIAS_ENABLE`        (*)      1: the speed is multiplied by a random factor
    `SPEED_BIAS_MEAN`          0.5      mean of the factor
    `SPEED_BIAS_STD`           0.2      standard deviation of the factor
    `INFERENCE_LATENCY_ENABLE` 0        1: late commands, whatever `ROBUSTNESS_ENABLE` says
    `INFERENCE_LATENCY_MODE`   fixed    `fixed` (our `mode="hold"`) or `measured`
    `INFERENCE_LATENCY_MS`     100      milliseconds, for `fixed`
    `WARMUP_STEPS`             20       ticks with neutral commands at the start of an episode under latency
    ========================== ======== =============================================================================

    (*) The paper's table has no such switch: there `BURST_MAX_TICKS`, `BURST_PROBABILITY`, `PARTIAL_OBS_RATIO`,
    `GPS_NOISE_STD`, `SPEED_BIAS_MEAN` and `SPEED_BIAS_STD` switch their perturbation on. The released code needs the
    switch. Both work: the default is 1 where one of those severities is given, else 0; a 0 that is given holds.

    Switches take 1/0, true/false, yes/no, on/off. An empty variable counts as not set. Raises `UsageError` with the
    variable and its value, also for a severity that would do nothing because a switch is not set.

    >>> from pytest_drive_robust.perturbations import BUILTIN
    >>> [str(item) for item in perturbations_from({"ROBUSTNESS_ENABLE": "1", "PARTIAL_OBS_RATIO": "0.8"}, BUILTIN)]
    ['occlusion 0.8']
    >>> environ = {"INFERENCE_LATENCY_ENABLE": "1", "INFERENCE_LATENCY_MS": "200"}
    >>> [str(item) for item in perturbations_from(environ, BUILTIN)]
    ['200 ms latency (reading=released)']
    """
    variables = _Variables(environ, known)
    for name in _SEEDS:
        variables.refuse_seed(name)
    variables.refuse_idle()
    rate_hz = variables.number("SIM_RATE", 20.0, above=0.0)
    stack = [*_observed(variables, rate_hz)] if variables.switch(_OBSERVATION) else []
    if variables.switch(_LATENCY):
        stack.append(_latency(variables))
    return stack


class _Variables(Generic[_P]):
    """A view of an environment. An empty or blank variable counts as not set. Every method raises `UsageError`."""

    def __init__(self, environ: Mapping[str, str], known: Mapping[str, Callable[..., _P]]) -> None:
        self._environ = environ
        self._known = known

    def text(self, name: str) -> str:
        """Return the value without blanks around it, `""` when not set."""
        return self._environ.get(name, "").strip()

    def switch(self, name: str) -> bool:
        """Read 1/0, true/false, yes/no, on/off in any case; unset is on where a severity of the paper is set."""
        text = self.text(name).lower()
        if text and text not in _ON_OFF:
            raise self._refused(name, f"one of {', '.join(_ON_OFF)}")
        paper, _ = _SEVERITIES.get(name, ((), ()))
        return _ON_OFF.get(text, any(map(self.text, paper)))

    def number(self, name: str, default: float, *, above: float = -math.inf) -> float:
        """Read a finite number above `above`."""
        text = self.text(name)
        if not text:
            return default
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not (math.isfinite(value) and value > above):
            raise self._refused(name, "a number" + (f" above {above:g}" if math.isfinite(above) else ""))
        return value

    def whole(self, name: str, default: int, *, low: int = 0) -> int:
        """Read a whole number of at least `low`."""
        text = self.text(name) or str(default)
        if not re.fullmatch(r"[+-]?[0-9]+", text) or int(text) < low:
            raise self._refused(name, f"a whole number of at least {low}")
        return int(text)

    def choice(self, name: str, default: str, choices: Sequence[str]) -> str:
        """Read one of `choices`, in any case."""
        text = self.text(name).lower() or default
        if text not in choices:
            raise self._refused(name, f"one of {', '.join(choices)}.{did_you_mean(text, choices)}")
        return text

    def made(self, name: str, names: Sequence[str], **severities: object) -> _P:
        """Build the perturbation `name`. The error for a refused severity tells which variables of `names` are set."""
        try:
            return self._known[name](**severities)
        except PerturbationError as error:
            given = ", ".join(f"{name}={self._environ[name]!r}" for name in names if self.text(name))
            raise UsageError(f"{given}: {error}") from error

    def refuse_seed(self, name: str) -> None:
        """Refuse a seed, which would do nothing: every draw is keyed by the seed of its episode."""
        text = self.text(name)
        if text:
            advice = f"Use --drive-seeds={text} instead (--seed={text} of bench2drive.evaluator)"
            raise self._refused(name, f"it unset: the seed of the episode keys every draw. {advice}")

    def refuse_idle(self) -> None:
        """Refuse a severity that would do nothing because its switch is not set."""
        for switch, (paper, released) in _SEVERITIES.items():
            given = [name for name in (switch, *paper, *released) if self.text(name)]
            self._refuse_without(switch, given)
        self._refuse_without("", [name for name in _DELAYS if self.whole(name, 0)])

    def _refuse_without(self, switch: str, given: Sequence[str]) -> None:
        needed = [_LATENCY] if switch == _LATENCY else [_OBSERVATION, switch] if switch else [_OBSERVATION]
        if not given or any(self.text(name) and not self.switch(name) for name in needed):
            return  # nothing is asked for, or it is switched off in so many words
        missing = [name for name in needed if not self.switch(name)]
        if missing:
            raise UsageError(
                f"the environment variable {given[0]} is {self._environ[given[0]]!r}, which does nothing without "
                f"{' and '.join(f'{name}=1' for name in missing)}. Set that too, or {missing[0]}=0 to leave it out"
            )

    def _refused(self, name: str, expected: str) -> UsageError:
        return UsageError(f"the environment variable {name} is {self._environ[name]!r}, expected {expected}")


def _observed(variables: _Variables[_P], rate_hz: float) -> Iterator[_P]:
    made = variables.made
    camera_ms, ego_ms = (1000.0 * variables.whole(name, 0) / rate_hz for name in _DELAYS)
    if camera_ms or ego_ms:
        ego = None if ego_ms == camera_ms else ego_ms
        yield made("sensor-delay", _DELAYS, camera_ms=camera_ms, ego_ms=ego)
    if variables.switch("BLEND_ENABLE"):
        frames = variables.whole("BLEND_NUM", 3, low=1)
        weights = variables.choice("BLEND_MODE", "uniform", ("uniform", "linear"))
        yield made("frame-blend", ("BLEND_NUM", "BLEND_MODE"), frames=frames, weights=weights)
    if variables.switch("FRAME_DROP_ENABLE"):
        length_s = variables.whole("BURST_MAX_TICKS", 20, low=2) / rate_hz
        probability, names = variables.number("BURST_PROBABILITY", 0.01), ("BURST_MAX_TICKS", "BURST_PROBABILITY")
        yield made("burst-frame-drop", names, length_s=length_s, probability=probability, length="uniform")
    if variables.switch("PARTIAL_OBS_ENABLE"):
        # The paper has a black rectangle and no switch; the code that has the switch blurs unless it is told otherwise.
        usual = "blur" if variables.text("PARTIAL_OBS_ENABLE") else "occlusion"
        fill = variables.choice("PARTIAL_OBS_TYPE", usual, ("blur", "occlusion")).replace("occlusion", "black")
        ratio = variables.number("PARTIAL_OBS_RATIO", 0.5)
        yield made("partial-observation", ("PARTIAL_OBS_RATIO",), ratio=ratio, fill=fill)
    if variables.switch("GPS_DRIFT_ENABLE"):
        level_m = _GPS_LEVELS_M[variables.choice("GPS_DRIFT_MODE", "medium", tuple(_GPS_LEVELS_M))]
        yield made("gps-noise", ("GPS_NOISE_STD",), std_m=variables.number("GPS_NOISE_STD", level_m))
    if variables.switch("SPEED_BIAS_ENABLE"):
        mean, std = variables.number("SPEED_BIAS_MEAN", 0.5), variables.number("SPEED_BIAS_STD", 0.2)
        yield made("speed-noise", ("SPEED_BIAS_MEAN", "SPEED_BIAS_STD"), mean=mean, std=std)


def _latency(variables: _Variables[_P]) -> _P:
    warmup_ticks = variables.whole("WARMUP_STEPS", 20)
    if variables.choice("INFERENCE_LATENCY_MODE", "fixed", ("fixed", "measured")) == "measured":
        if variables.text("INFERENCE_LATENCY_MS"):
            raise UsageError(
                f"INFERENCE_LATENCY_MS={variables.text('INFERENCE_LATENCY_MS')!r} does nothing with "
                "INFERENCE_LATENCY_MODE=measured: set INFERENCE_LATENCY_MODE=fixed, or leave the milliseconds out"
            )
        return variables.made("inference-latency", ("WARMUP_STEPS",), mode="measured", warmup_ticks=warmup_ticks)
    ms = variables.number("INFERENCE_LATENCY_MS", 100.0)
    names = ("INFERENCE_LATENCY_MS", "WARMUP_STEPS")
    return variables.made("inference-latency", names, ms=ms, mode="hold", warmup_ticks=warmup_ticks)
