"""Our perturbations inside an official Bench2Drive evaluation, without a change to any of its files.

One file for itself: the standard library and numpy 1.17 or later, Python 3.7 or later, nothing else of this package::

    PDR_SETTING='{"seed": 0, "stack": [...]}' python inject.py .../leaderboard_evaluator.py --routes=... --agent=...

wraps two methods of the checkout that is on the path, then runs the evaluator as if it had been started directly:

* `SensorInterface.get_data`: what it returns is perturbed, once per tick, however often it is called;
* `AgentWrapper.__call__`: while a latency keeps the agent's computer busy the agent is not called, and the command that
  is due reaches the vehicle.

`ScenarioManager.load_scenario` tells which route begins: everything is seeded and cleared there. Every number is drawn
as in the package itself, from Philox streams named by (seed, route, perturbation, sensor, tick), where a camera goes by
its place among the cameras of the agent's `sensors()`, so the same images and measurements come out the same to the
last bit as in the embedded simulator. The rules, with their sources, are in the docstrings of
`pytest_drive_robust.perturbations`; the package's tests hold the two together.

=================== ==================================================================================================
variable            meaning
=================== ==================================================================================================
`PDR_SETTING`       JSON: `seed`, `stack` (a list of `name` and `parameters`), and if wanted `dt_s` (0.05), `setting`
                    (the sentence, for the log) and `log`. `setting_as_json` of the package writes it.
`PDR_LOG`           a file that gets one line of JSON for each route: what was injected, and in which ticks
`PDR_ROUTE`         the name of the route where no `ScenarioManager` tells it
=================== ==================================================================================================

Without `PDR_SETTING` the variables of the paper's released code decide (`ROBUSTNESS_ENABLE`, `GPS_NOISE_STD`, ...), and
`ROBUSTNESS_SEED` is the seed. A repetition of a route adds its number to the seed.

Payloads are known by their form: uint8 (height, width, 4) is a camera, three numbers are a GNSS fix, seven an IMU, a
mapping with `speed` the speedometer; lidar, radar and maps stay as they are. So does the debug camera `bev`, which
agents save and do not look at. Frame numbers stay those of the tick, also on a stale image. What goes wrong here ends a
route as "Simulation crashed": it is never counted against the agent.
"""

from __future__ import annotations

import atexit
import copy
import hashlib
import importlib
import inspect
import json
import math
import os
import runpy
import sys
import time
from bisect import bisect_right
from collections import deque
from collections.abc import Callable, Iterable, Mapping
from typing import Any, ClassVar

import numpy as np

__all__ = ["InjectionPlan", "Injector", "SettingRefusedError", "install", "main", "plan_from", "wrap"]

DEBUG_CAMERAS = ("bev",)
DT_S = 0.05
REFUSED = 78
"""Exit code when the setting cannot be used: the configuration error of sysexits.h."""
_MARK = "_pdr_original"
_EGO = ("gps", "compass", "imu", "speed")


class SettingRefusedError(Exception):
    """The environment asks for something that cannot be injected."""


# ---------------------------------------------------------------------------------------------------------------------
# Elementary functions: `arithmetic/series.py` and `arithmetic/scalars.py`, so far as they are used here
# ---------------------------------------------------------------------------------------------------------------------

_LARGEST_ANGLE_RAD = 1.0e6
_ROUNDER = 6755399441055744.0  # 1.5 * 2**52: a double of that size has no room for a fraction
_PER_QUARTER = 0.6366197723675814  # 2 / pi
# pi / 2 in three parts: the first two have 33 bits, so that their products with a whole number below 2**20 are exact
_QUARTER_1, _QUARTER_2, _QUARTER_3 = 1.5707963267341256, 6.077100506303966e-11, 2.0222662487959506e-21
_LN2_HIGH, _LN2_LOW = 0.6931471803691238, 1.9082149292705877e-10  # the first has 33 bits
_ROOT_OF_HALF = 0.7071067811865476


def nearest_whole(x: float) -> float:
    """Return the whole number nearest to `x`, |x| < 2**51, ties to even."""
    return (x + _ROUNDER) - _ROUNDER


def quarter_turns(x: float) -> tuple[float, float, float]:
    """Return (quarter, y, tail): `x` is `y + tail` and some quarter turns, `quarter` of them beyond whole turns.

    `x` in rad, at most `_LARGEST_ANGLE_RAD`; `quarter` from -2 to 2, |y| <= pi / 4.
    """
    count = nearest_whole(x * _PER_QUARTER)
    first, part = x - count * _QUARTER_1, count * _QUARTER_2
    rest = first - part
    back = rest - first
    lost = (first - (rest - back)) - (part + back)  # rest + lost is first - part without an error
    low = count * _QUARTER_3 - lost
    y = rest - low
    return count - 4.0 * nearest_whole(0.25 * count), y, (rest - y) - low


def sine(y: float, tail: float) -> float:
    """Return the sine of `y + tail`, |y| <= pi / 4."""
    z = y * y
    odd = 8.33333333332248946124e-03 + z * (
        -1.98412698298579493134e-04
        + z * (2.75573137070700676789e-06 + z * (-2.50507602534068634195e-08 + z * 1.58969099521155010221e-10))
    )
    cube = z * y
    return y - ((z * (0.5 * tail - cube * odd) - tail) - cube * -1.66666666666666324348e-01)


def cosine(y: float, tail: float) -> float:
    """Return the cosine of `y + tail`, |y| <= pi / 4."""
    z = y * y
    even = z * (
        4.16666666666666019037e-02
        + z
        * (
            -1.38888888888741095749e-03
            + z
            * (
                2.48015872894767294178e-05
                + z * (-2.75573143513906633035e-07 + z * (2.08757232129817482790e-09 + z * -1.13596475577881948265e-11))
            )
        )
    )
    half = 0.5 * z
    near = 1.0 - half
    return near + (((1.0 - near) - half) + (z * even - y * tail))


def arctangent(t: float, high: float, low: float) -> float:
    """Return the arctangent of `t` plus `high + low`, |t| <= 7 / 16."""
    z = t * t
    w = z * z
    odd = z * (
        3.33333333333329318027e-01
        + w
        * (
            1.42857142725034663711e-01
            + w
            * (
                9.09088713343650656196e-02
                + w * (6.66107313738753120669e-02 + w * (4.97687799461593236017e-02 + w * 1.62858201153657823623e-02))
            )
        )
    )
    even = w * (
        -1.99999999998764832476e-01
        + w
        * (
            -1.11111104054623557880e-01
            + w * (-7.69187620504482999495e-02 + w * (-5.83357013379057348645e-02 + w * -3.65315727442169155270e-02))
        )
    )
    return high - ((t * (odd + even) - low) - t)


def exponential(x: float) -> tuple[float, float]:
    """Return (y, twos): the exponential of `x` is `y * 2**twos`, |x| < 800, `twos` a whole number."""
    twos = nearest_whole(x * 1.4426950408889634)
    high, low = x - twos * _LN2_HIGH, twos * _LN2_LOW
    rest = high - low
    z = rest * rest
    c = rest - z * (
        1.66666666666666019037e-01
        + z
        * (
            -2.77777777770155933842e-03
            + z * (6.61375632143793436117e-05 + z * (-1.65339022054652515390e-06 + z * 4.13813679705723846039e-08))
        )
    )
    return 1.0 - ((low - (rest * c) / (2.0 - c)) - high), twos


def logarithm(f: float, twos: float) -> float:
    """Return the natural logarithm of `(1 + f) * 2**twos`, `1 + f` between the square roots of 0.5 and 2."""
    s = f / (2.0 + f)
    z = s * s
    w = z * z
    even = w * (3.999999999940941908e-01 + w * (2.222219843214978396e-01 + w * 1.531383769920937332e-01))
    odd = z * (
        6.666666666666735130e-01
        + w * (2.857142874366239149e-01 + w * (1.818357216161805012e-01 + w * 1.479819860511658591e-01))
    )
    half = 0.5 * f * f
    return twos * _LN2_HIGH - ((half - (s * (half + (odd + even)) + twos * _LN2_LOW)) - f)


def _usual_angle(x: float) -> float:
    """Return an angle within the usual range that is `x` but for whole turns; NaN for what has none."""
    return x if abs(x) <= _LARGEST_ANGLE_RAD else x % _TURN


def sin(x: float) -> float:
    """Return the sine of `x` rad."""
    quarter, y, tail = quarter_turns(_usual_angle(float(x)))
    value = sine(y, tail) if quarter * quarter != 1.0 else cosine(y, tail)
    return value if quarter == 0.0 or quarter == 1.0 else -value


def cos(x: float) -> float:
    """Return the cosine of `x` rad."""
    quarter, y, tail = quarter_turns(_usual_angle(float(x)))
    value = cosine(y, tail) if quarter * quarter != 1.0 else sine(y, tail)
    return value if quarter == 0.0 or quarter == -1.0 else -value


def tan(x: float) -> float:
    """Return the tangent of `x` rad."""
    quarter, y, tail = quarter_turns(_usual_angle(float(x)))
    above, below = sine(y, tail), cosine(y, tail)
    return above / below if quarter * quarter != 1.0 else -below / above


def atan(x: float) -> float:
    """Return the arctangent of `x` in rad, from -pi / 2 to pi / 2."""
    x = float(x)
    size = abs(x)
    if size < 0.4375:
        t, high, low = size, 0.0, 0.0
    elif size < 0.6875:
        t, high, low = (2.0 * size - 1.0) / (2.0 + size), 0.4636476090008061, 2.2698777452961687e-17
    elif size < 1.1875:
        t, high, low = (size - 1.0) / (size + 1.0), 0.7853981633974483, 3.061616997868383e-17
    elif size < 2.4375:
        t, high, low = (size - 1.5) / (1.0 + 1.5 * size), 0.982793723247329, 1.3903311031230998e-17
    else:
        t, high, low = -1.0 / size, 1.5707963267948966, 6.123233995736766e-17
    return math.copysign(arctangent(t, high, low), x)


def exp(x: float) -> float:
    """Return e to the power of `x`."""
    x = float(x)
    if x > 709.782712893384:
        return math.inf
    if x < -745.2:
        return 0.0
    if x != x:
        return x
    y, twos = exponential(x)
    return math.ldexp(y, int(twos))


def log(x: float) -> float:
    """Return the natural logarithm of `x`."""
    x = float(x)
    if not 0.0 < x < math.inf:
        return -math.inf if x == 0.0 else (x if x > 0.0 else math.nan)
    part, twos = math.frexp(x)
    if part < _ROOT_OF_HALF:
        part, twos = 2.0 * part, twos - 1
    return logarithm(part - 1.0, float(twos))


# ---------------------------------------------------------------------------------------------------------------------
# Random numbers: `perturbations/draws.py`
# ---------------------------------------------------------------------------------------------------------------------

_BLOCK_TICKS = 256
_UNIT = 2.0**-53
_TURN = 2.0 * math.pi
_PERSON = b"drive-robust v1"


class InjectedDraws:
    """Four random numbers for each sensor and tick, a pure function of the names."""

    def __init__(self, seed: int, route: str, stream: str) -> None:
        self._names = (str(int(seed)), route, stream)
        self._blocks: dict[str, Any] = {}

    def uniform(self, sensor: str, tick: int) -> tuple[float, float, float, float]:
        """Return four numbers, uniform in [0, 1)."""
        number, row = divmod(tick, _BLOCK_TICKS)
        cached = self._blocks.get(sensor)
        if cached is None or cached[0] != number:
            generator = np.random.Philox(key=_key((*self._names, sensor)), counter=number * _BLOCK_TICKS)
            words = generator.random_raw(4 * _BLOCK_TICKS).reshape(_BLOCK_TICKS, 4)
            cached = self._blocks[sensor] = (number, ((words >> np.uint64(11)) * _UNIT).tolist())
        four = cached[1][row]
        return four[0], four[1], four[2], four[3]

    def normal(self, sensor: str, tick: int) -> tuple[float, float]:
        """Return two numbers of the standard normal distribution."""
        u, v, _, _ = self.uniform(sensor, tick)
        first = math.sqrt(-2.0 * log(1.0 - u))
        return first * cos(_TURN * v), first * sin(_TURN * v)


def _key(names: Iterable[str]) -> int:
    digest = hashlib.blake2b(digest_size=16, person=_PERSON)
    for name in names:
        encoded = name.encode("utf-8", "surrogatepass")
        digest.update(len(encoded).to_bytes(8, "little") + encoded)
    return int.from_bytes(digest.digest(), "little")


def whole_ticks(duration_s: float, dt_s: float) -> int:
    """Return how many whole ticks fit into a duration."""
    ticks = duration_s / dt_s
    return math.floor(ticks + 1e-9 * max(1.0, ticks))


def delay_ticks(name: str, duration_ms: float, dt_s: float) -> int:
    """Count whole ticks as `whole_ticks` does, but refuse a delay between 0 and one tick."""
    ticks = whole_ticks(duration_ms / 1000.0, dt_s)
    if ticks == 0 and duration_ms > 0.0:
        raise SettingRefusedError(f"{name} is {duration_ms:g} ms, expected 0 or at least one tick of {dt_s:g} s")
    return ticks


# ---------------------------------------------------------------------------------------------------------------------
# What the sensors say
# ---------------------------------------------------------------------------------------------------------------------

EARTH_RADIUS_M = 6378137.0


def to_geodetic(x_m: float, y_m: float) -> tuple[float, float]:
    """Return (latitude, longitude) in degrees of a point (x east, y south) in metres."""
    latitude = 2.0 * atan(exp(-y_m / EARTH_RADIUS_M)) - math.pi / 2.0
    return math.degrees(latitude), math.degrees(x_m / EARTH_RADIUS_M)


def to_metric(latitude_deg: float, longitude_deg: float) -> tuple[float, float]:
    """Return (x east, y south) in metres of a latitude and longitude in degrees."""
    if not -90.0 < latitude_deg < 90.0:
        raise ValueError(f"latitude {latitude_deg!r} degrees, expected more than -90 and less than 90")
    y = -EARTH_RADIUS_M * log(tan(math.pi / 4.0 + math.radians(latitude_deg) / 2.0))
    return EARTH_RADIUS_M * math.radians(longitude_deg), y


class GnssFix:
    """A GNSS payload within a stack, in metres: there and back again between two noises would cost the last bit."""

    def __init__(self, payload: Any, x_m: float, y_m: float, moved: bool = False) -> None:
        self._payload = payload
        self._moved = moved
        self.x_m = x_m
        self.y_m = y_m

    @classmethod
    def read(cls, payload: Any) -> GnssFix:
        """Return the position of a payload."""
        return cls(payload, *to_metric(float(payload[0]), float(payload[1])))

    @property
    def ground_scale(self) -> float:
        """Mercator metres of a metre on the ground: 1 at the equator, where nearly all towns are."""
        latitude = float(self._payload[0])
        return 1.0 if abs(latitude) < 1.0 else 1.0 / cos(math.radians(latitude))

    def at(self, x_m: float, y_m: float) -> GnssFix:
        """Return the same fix elsewhere."""
        return GnssFix(self._payload, x_m, y_m, self._moved or (x_m, y_m) != (self.x_m, self.y_m))

    def own(self) -> GnssFix:
        """Return the same with a payload of its own."""
        return GnssFix(self._payload.copy(), self.x_m, self.y_m, self._moved)

    def written(self) -> Any:
        """Return the payload: the very one that was read when nobody moved it."""
        if not self._moved:
            return self._payload
        payload = self._payload.copy()
        payload[0], payload[1] = to_geodetic(self.x_m, self.y_m)
        return payload


def rig_of(sensors: Iterable[Mapping[str, Any]]) -> dict[str, str]:
    """Return what the draws for each camera are asked by: its place among the cameras of the agent, not its id."""
    cameras = [str(sensor["id"]) for sensor in sensors if str(sensor["type"]).startswith("sensor.camera.")]
    return {tag: f"camera {position}" for position, tag in enumerate(cameras)}


def kind_of(payload: Any) -> str:
    """Return `camera`, `gps`, `imu`, `speed`, or nothing for what is never perturbed."""
    if isinstance(payload, np.ndarray):
        if payload.ndim == 3 and payload.dtype == np.uint8:
            return "camera"
        if payload.ndim == 1:
            return {3: "gps", 7: "imu"}.get(len(payload), "")
    elif isinstance(payload, Mapping) and "speed" in payload:
        return "speed"
    return ""


class SensedTick:
    """The perturbed part of one tick: payloads by tag, a `GnssFix` for the position. No array is ever written to."""

    def __init__(self, tick: int, cameras: dict[str, Any], ego: dict[str, Any]) -> None:
        self.tick = tick
        self.cameras = cameras
        self.ego = ego


def _own(payload: Any) -> Any:
    if isinstance(payload, GnssFix):
        return payload.own()
    return payload.copy() if isinstance(payload, np.ndarray) else copy.deepcopy(payload)


class InjectedSpans:
    """First and last touched tick of each signal."""

    def __init__(self) -> None:
        self._first: dict[str, int] = {}
        self._last = 0

    def touch(self, tick: int, signals: Iterable[str]) -> None:
        """Note that these were perturbed in `tick`."""
        for signal in signals:
            self._first.setdefault(signal, tick)
        self._last = tick

    def schedule(self, stream: str) -> list[list[Any]]:
        """Return one stretch for each signal."""
        return [[stream, signal, first, self._last] for signal, first in self._first.items()]


# ---------------------------------------------------------------------------------------------------------------------
# The failures, one class each: `perturbations/*.py`
# ---------------------------------------------------------------------------------------------------------------------


class InjectedFailure:
    """Base: touches nothing."""

    defaults: ClassVar[Mapping[str, Any]] = {}
    observes = False

    def __init__(
        self, given: Mapping[str, Any], draws: InjectedDraws, stream: str, dt_s: float, rig: Mapping[str, str]
    ) -> None:
        self.draws = draws
        self.rig = rig
        self.stream = stream
        self.dt_s = dt_s
        self.spans = InjectedSpans()
        self.begin(dict(self.defaults, **given))

    def begin(self, p: dict[str, Any]) -> None:
        """Take the severities."""

    def observe(self, sight: SensedTick) -> SensedTick:
        """Return what the agent gets instead."""
        return sight

    def schedule(self) -> list[list[Any]]:
        """Return what was injected so far: perturbation, signal, first and last tick."""
        return self.spans.schedule(self.stream)


class InjectedBursts(InjectedFailure):
    """A camera repeats its last valid image for a while."""

    defaults: ClassVar[Mapping[str, Any]] = {"length_s": 1.0, "probability": 0.01, "length": "fixed"}
    observes = True

    def begin(self, p: dict[str, Any]) -> None:
        """Take the severities. Raises when a burst is shorter than it can be."""
        self._probability = p["probability"]
        self._uniform = p["length"] == "uniform"
        self._longest = whole_ticks(p["length_s"], self.dt_s)
        if self._longest < (2 if self._uniform else 1):
            raise SettingRefusedError(
                "a burst of {:g} s is too short: a tick lasts {:g} s".format(p["length_s"], self.dt_s)
            )
        self._bursts: dict[str, CameraBursts] = {}
        self._valid: dict[str, Any] = {}
        self._last_tick = 0

    def observe(self, sight: SensedTick) -> SensedTick:
        """Let frozen cameras show their last valid image."""
        self._last_tick = sight.tick
        cameras = {tag: self._delivered(tag, pixels, sight.tick) for tag, pixels in sight.cameras.items()}
        return SensedTick(sight.tick, cameras, sight.ego)

    def schedule(self) -> list[list[Any]]:
        """Return every burst of every camera."""
        return [
            [self.stream, tag, first, last]
            for tag, bursts in self._bursts.items()
            for first, last in bursts.until(self._last_tick)
        ]

    def _delivered(self, tag: str, pixels: Any, tick: int) -> Any:
        bursts = self._bursts.get(tag)
        if bursts is None:
            bursts = self._bursts[tag] = CameraBursts(
                self.draws, self.rig[tag], self._probability, self._longest, self._uniform
            )
        valid = self._valid.get(tag)
        if valid is not None and bursts.is_frozen(tick):
            return valid
        self._valid[tag] = pixels.copy()
        return pixels


class CameraBursts:
    """The bursts of one camera, decided tick by tick from tick 1."""

    def __init__(self, draws: InjectedDraws, camera: str, probability: float, longest: int, uniform: bool) -> None:
        self._draws = draws
        self._camera = camera
        self._probability = probability
        self._longest = longest
        self._uniform = uniform
        self._firsts: list[int] = []
        self._lasts: list[int] = []
        self._next = 1

    def is_frozen(self, tick: int) -> bool:
        """Return True within a burst."""
        while self._next <= tick:
            self._decide()
        index = bisect_right(self._firsts, tick) - 1
        return index >= 0 and tick <= self._lasts[index]

    def until(self, tick: int) -> list[tuple[int, int]]:
        """Return those that began until `tick`."""
        self.is_frozen(tick)
        return [(first, min(last, tick)) for first, last in zip(self._firsts, self._lasts) if first <= tick]  # noqa: B905

    def _decide(self) -> None:
        trigger, length, _, _ = self._draws.uniform(self._camera, self._next)
        if trigger >= self._probability:
            self._next += 1
            return
        ticks = 2 + int(length * (self._longest - 1)) if self._uniform else self._longest
        self._firsts.append(self._next)
        self._lasts.append(self._next + ticks - 1)
        self._next += ticks


class InjectedOcclusion(InjectedFailure):
    """A rectangle of every image shows nothing. The fourth channel stays."""

    defaults: ClassVar[Mapping[str, Any]] = {"ratio": 0.5, "area": False, "fill": "black", "hold_s": 0.0}
    observes = True

    def begin(self, p: dict[str, Any]) -> None:
        """Take the severities."""
        self._ratio, self._area, self._fill = p["ratio"], p["area"], p["fill"]
        self._hold_ticks = max(1, whole_ticks(p["hold_s"], self.dt_s))

    def observe(self, sight: SensedTick) -> SensedTick:
        """Return masked copies of all images."""
        drawn_at = sight.tick - sight.tick % self._hold_ticks
        self.spans.touch(sight.tick, sight.cameras)
        cameras = {tag: self._masked(tag, pixels, drawn_at) for tag, pixels in sight.cameras.items()}
        return SensedTick(sight.tick, cameras, sight.ego)

    def _masked(self, tag: str, pixels: Any, drawn_at: int) -> Any:
        rows, columns = pixels.shape[:2]
        height, width = self._size(rows, columns)
        if height == 0 or width == 0:
            return pixels
        down, right, _, _ = self.draws.uniform(self.rig[tag], drawn_at)
        top, left = int(down * (rows - height + 1)), int(right * (columns - width + 1))
        masked = pixels.copy()
        rectangle = masked[top : top + height, left : left + width, :3]
        rectangle[...] = blurred(rectangle) if self._fill == "blur" else 0 if self._fill == "black" else 128
        return masked

    def _size(self, rows: int, columns: int) -> tuple[int, int]:
        if not self._area:
            return int(rows * self._ratio), int(columns * self._ratio)
        height = round(rows * math.sqrt(self._ratio))
        return height, min(columns, round(rows * columns * self._ratio / max(1, height)))


_TAPS = (20, 20, 19, 17, 15, 13, 10, 7, 6, 4, 3, 2, 1, 0, 1)
"""Right half of OpenCV's Gaussian of 31 taps (sigma 5) in 256ths, its rounding errors carried on from the outside."""


def blurred(image: Any) -> Any:
    """Blur a uint8 image by a Gaussian of 31 x 31 pixels, mirrored at its edges; to the bit `cv2.GaussianBlur`."""
    reach = len(_TAPS) - 1
    rows, columns = image.shape[:2]
    wide = image[:, _mirrored(columns, reach)].astype(np.uint16)
    across = wide[:, reach : reach + columns] * np.uint16(_TAPS[0])
    for step, tap in enumerate(_TAPS[1:], 1):
        if tap:
            sides = wide[:, reach - step : reach - step + columns] + wide[:, reach + step : reach + step + columns]
            across += sides * np.uint16(tap)
    tall = across[_mirrored(rows, reach)].astype(np.uint32)
    total = tall[reach : reach + rows] * np.uint32(_TAPS[0])
    for step, tap in enumerate(_TAPS[1:], 1):
        if tap:
            sides = tall[reach - step : reach - step + rows] + tall[reach + step : reach + step + rows]
            total += sides * np.uint32(tap)
    return ((total + np.uint32(1 << 15)) >> np.uint32(16)).astype(np.uint8)


def _mirrored(length: int, reach: int) -> Any:
    """Return the indices of a line with `reach` more at both ends, mirrored without repeating the edge."""
    places = np.arange(-reach, length + reach)
    if length == 1:
        return places * 0
    places %= 2 * (length - 1)
    return np.where(places < length, places, 2 * (length - 1) - places)


class InjectedGpsNoise(InjectedFailure):
    """Every fix is off by an independent error in metres."""

    defaults: ClassVar[Mapping[str, Any]] = {"std_m": 5.0}
    observes = True

    def begin(self, p: dict[str, Any]) -> None:
        """Take the severity."""
        self._std_m = p["std_m"]

    def observe(self, sight: SensedTick) -> SensedTick:
        """Move latitude and longitude; altitude stays."""
        east, south = self.draws.normal("gps", sight.tick)
        self.spans.touch(sight.tick, ("gps",))
        ego = {
            tag: self._moved(item, east, south) if isinstance(item, GnssFix) else item
            for tag, item in sight.ego.items()
        }
        return SensedTick(sight.tick, sight.cameras, ego)

    def _moved(self, fix: GnssFix, east: float, south: float) -> GnssFix:
        std_m = self._std_m * fix.ground_scale
        return fix.at(fix.x_m + std_m * east, fix.y_m + std_m * south)


class InjectedSpeedNoise(InjectedFailure):
    """The speed is multiplied by a random factor."""

    defaults: ClassVar[Mapping[str, Any]] = {"mean": 0.5, "std": 0.2, "clip": False}
    observes = True

    def begin(self, p: dict[str, Any]) -> None:
        """Take the severities."""
        self._mean, self._std, self._clip = p["mean"], p["std"], p["clip"]

    def observe(self, sight: SensedTick) -> SensedTick:
        """Return a scaled speed."""
        factor = self._mean + self._std * self.draws.normal("speed", sight.tick)[0]
        if self._clip:
            factor = max(0.0, factor)
        self.spans.touch(sight.tick, ("speed",))
        ego = {
            tag: dict(payload, speed=factor * payload["speed"]) if kind_of(payload) == "speed" else payload
            for tag, payload in sight.ego.items()
        }
        return SensedTick(sight.tick, sight.cameras, ego)


class InjectedDelay(InjectedFailure):
    """Sensors arrive late."""

    defaults: ClassVar[Mapping[str, Any]] = {"camera_ms": 100.0, "ego_ms": None}
    observes = True

    def begin(self, p: dict[str, Any]) -> None:
        """Take the severities. Raises for a delay between 0 and one tick."""
        self._camera_ticks = delay_ticks("camera_ms", p["camera_ms"], self.dt_s)
        ego_ms = p["camera_ms"] if p["ego_ms"] is None else p["ego_ms"]
        self._ego_ticks = delay_ticks("ego_ms", ego_ms, self.dt_s)
        self._captures: deque[SensedTick] = deque()

    def observe(self, sight: SensedTick) -> SensedTick:
        """Return the current tick with the signals of earlier ones."""
        now = sight.tick
        longest = max(self._camera_ticks, self._ego_ticks)
        if longest == 0:
            return sight
        kept = {tag: pixels.copy() for tag, pixels in sight.cameras.items()} if self._camera_ticks else {}
        self._captures.append(SensedTick(now, kept, {tag: _own(payload) for tag, payload in sight.ego.items()}))
        while len(self._captures) > 1 and self._captures[1].tick <= now - longest:
            self._captures.popleft()
        cameras, ego = sight.cameras, sight.ego
        if self._camera_ticks:
            cameras = self._captured(now - self._camera_ticks).cameras
            self.spans.touch(now, sight.cameras)
        if self._ego_ticks:
            ego = self._captured(now - self._ego_ticks).ego
            self.spans.touch(now, _EGO)
        return SensedTick(now, cameras, ego)

    def _captured(self, tick: int) -> SensedTick:
        found = self._captures[0]
        for capture in self._captures:
            if capture.tick > tick:
                break
            found = capture
        return found


class InjectedBlend(InjectedFailure):
    """Each image is the mean of the last few."""

    defaults: ClassVar[Mapping[str, Any]] = {"frames": 3, "weights": "uniform"}
    observes = True

    def begin(self, p: dict[str, Any]) -> None:
        """Take the severities."""
        self._frames, self._linear = p["frames"], p["weights"] == "linear"
        self._means: dict[str, RunningImageMean] = {}

    def observe(self, sight: SensedTick) -> SensedTick:
        """Return blended images."""
        if self._frames == 1:
            return sight
        self.spans.touch(sight.tick, sight.cameras)
        return SensedTick(sight.tick, {tag: self._blended(tag, item) for tag, item in sight.cameras.items()}, sight.ego)

    def _blended(self, tag: str, pixels: Any) -> Any:
        if tag not in self._means:
            self._means[tag] = RunningImageMean(self._frames, pixels.shape, self._linear)
        return self._means[tag].push(pixels)


class RunningImageMean:
    """The mean of the last images, weighted 1, 2, ... from the oldest when `linear`, rounded to the nearest."""

    def __init__(self, frames: int, shape: tuple[int, ...], linear: bool) -> None:
        self._linear = linear
        self._pushed = 0
        self._images = np.zeros((frames, *tuple(shape)), dtype=np.uint8)
        self._plain = np.zeros(shape, dtype=np.uint32)
        self._ramp = np.zeros(shape, dtype=np.uint32)

    def push(self, pixels: Any) -> Any:
        """Add an image and give the mean."""
        frames = len(self._images)
        slot = self._images[self._pushed % frames]
        full = self._pushed >= frames
        self._pushed += 1
        count = min(self._pushed, frames)
        if self._linear and full:
            self._ramp -= self._plain
        self._plain -= slot
        slot[...] = pixels
        self._plain += slot
        if self._linear:
            self._ramp += slot * np.uint32(count)
        total, weight = (self._ramp, count * (count + 1) // 2) if self._linear else (self._plain, count)
        return ((total + np.uint32(weight // 2)) // np.uint32(weight)).astype(np.uint8)


# ---------------------------------------------------------------------------------------------------------------------
# Late commands: `perturbations/inference_latency.py`
# ---------------------------------------------------------------------------------------------------------------------

NEUTRAL = "neutral"
_FIELDS = ("throttle", "steer", "brake", "hand_brake", "reverse", "manual_gear_shift", "gear")


class InjectedLatency(InjectedFailure):
    """The command of an image reaches the vehicle only later."""

    defaults: ClassVar[Mapping[str, Any]] = {"ms": None, "mode": "fifo", "warmup_ticks": 0, "replay_s": ()}

    def begin(self, p: dict[str, Any]) -> None:
        """Take the severities. Raises for a latency between 0 and one tick."""
        self._mode, self._warmup_ticks, self._replay_s = p["mode"], p["warmup_ticks"], tuple(p["replay_s"])
        self._ticks = delay_ticks("ms", p["ms"] or 0.0, self.dt_s)
        self._buffer: LatencyPipe | LatencyHold = LatencyPipe(self._ticks) if self._mode == "fifo" else LatencyHold()
        self.times_s: list[float] = []

    def is_free(self, tick: int) -> bool:
        """Return False while the agent's computer is busy."""
        return self._buffer.is_free(tick)

    def actuate(self, tick: int, control: Any, inference_s: float) -> Any:
        """Return the command that is due."""
        delay = self._ticks
        if self._mode == "measured" and control is not None and self.is_free(tick):
            delay = whole_ticks(self._time_s(inference_s), self.dt_s)
        due = self._buffer.exchange(tick, control, delay)
        if self._mode == "measured" or self._ticks or tick < self._warmup_ticks:
            self.spans.touch(tick, ("control",))
        return NEUTRAL if tick < self._warmup_ticks else due

    def _time_s(self, inference_s: float) -> float:
        if self._replay_s:
            count = len(self.times_s)
            if count == len(self._replay_s):
                raise SettingRefusedError(f"replay_s holds {count} times, but the agent ran once more")
            inference_s = self._replay_s[count]
        self.times_s.append(inference_s)
        return inference_s


class LatencyPipe:
    """A pipe of commands, filled with the neutral one."""

    def __init__(self, ticks: int) -> None:
        self._pipe: deque[Any] = deque([NEUTRAL] * ticks)
        self._newest: Any = NEUTRAL

    def is_free(self, tick: int) -> bool:
        """Return True always."""
        return True

    def exchange(self, tick: int, control: Any, delay: int) -> Any:
        """Put one in, take one out."""
        if control is not None:
            self._newest = control
        self._pipe.append(self._newest)
        return self._pipe.popleft()


class LatencyHold:
    """Busy until its command is due, which then holds."""

    def __init__(self) -> None:
        self._current: Any = NEUTRAL
        self._pending: Any = None
        self._due = 0

    def is_free(self, tick: int) -> bool:
        """Return True from the tick on in which the last command is due."""
        return tick >= self._due

    def exchange(self, tick: int, control: Any, delay: int) -> Any:
        """Release what is due, start on what is new."""
        if self._pending is not None and tick >= self._due:
            self._current, self._pending = self._pending, None
        if control is not None and tick >= self._due:
            self._due = tick + delay
            if delay == 0:
                self._current = control
            else:
                self._pending = control
        return self._current


def copied(control: Any) -> Any:
    """Return a command of its own: agents and scenarios change theirs in place."""
    try:
        made = type(control)()
    except TypeError:
        return copy.copy(control)
    for name in _FIELDS:
        if hasattr(control, name):
            setattr(made, name, getattr(control, name))
    return made


def neutral_like(control: Any) -> Any:
    """Return no throttle, no steering, no brake; of the class of `control`, or CARLA's when there was none yet."""
    made = importlib.import_module("carla").VehicleControl() if control is None else copied(control)
    made.throttle = made.steer = made.brake = 0.0
    made.hand_brake = made.reverse = False
    return made


FAILURES: dict[str, type[InjectedFailure]] = {
    "burst-frame-drop": InjectedBursts,
    "partial-observation": InjectedOcclusion,
    "gps-noise": InjectedGpsNoise,
    "speed-noise": InjectedSpeedNoise,
    "inference-latency": InjectedLatency,
    "sensor-delay": InjectedDelay,
    "frame-blend": InjectedBlend,
}


# ---------------------------------------------------------------------------------------------------------------------
# What to inject
# ---------------------------------------------------------------------------------------------------------------------


class InjectionPlan:
    """What the environment asks for. `stack` is a list of (name, severities)."""

    def __init__(self, stack: list[tuple[str, dict[str, Any]]], seed: int, dt_s: float, setting: str, log: str) -> None:
        self.stack = stack
        self.seed = seed
        self.dt_s = dt_s
        self.setting = setting
        self.log = log
        self.started("", 0, {})  # a severity that cannot be is refused before anything is driven

    def started(self, route: str, repetition: int, rig: Mapping[str, str]) -> list[InjectedFailure]:
        """Make fresh failures for one route. `rig` is what the draws for each camera are asked by."""
        counts: dict[str, int] = {}
        failures = []
        for name, given in self.stack:
            counts[name] = counts.get(name, 0) + 1
            stream = name if counts[name] == 1 else f"{name}#{counts[name]}"
            draws = InjectedDraws(self.seed + repetition, route, stream)
            failures.append(FAILURES[name](given, draws, stream, self.dt_s, rig))
        return failures


def plan_from(environ: Mapping[str, str]) -> InjectionPlan:
    """Return the plan of an environment. Raises `SettingRefusedError`."""
    text = environ.get("PDR_SETTING", "").strip()
    log = environ.get("PDR_LOG", "")
    if not text:
        stack, seed, dt_s = _paper(PaperVariables(environ))
        return InjectionPlan(stack, seed, dt_s, "variables of the released code" if stack else "clean", log)
    try:
        document = json.loads(text)
        stack = [(item["name"], dict(item.get("parameters", {}))) for item in document["stack"]]
        seed, dt_s = int(document.get("seed", 0)), float(document.get("dt_s", DT_S))
    except (ValueError, TypeError, KeyError, AttributeError) as error:
        raise SettingRefusedError(f"PDR_SETTING is no setting ({error!r}): {text:.200}") from None
    for name, given in stack:
        if name not in FAILURES:
            raise SettingRefusedError("no perturbation {!r}; known: {}".format(name, ", ".join(sorted(FAILURES))))
        unknown = sorted(set(given) - set(FAILURES[name].defaults))
        if unknown:
            raise SettingRefusedError(f"{name} has no severity {unknown[0]!r}")
    return InjectionPlan(stack, seed, dt_s, str(document.get("setting", "")), log or str(document.get("log", "")))


_OBSERVATION = "ROBUSTNESS_ENABLE"
_LATENCY = "INFERENCE_LATENCY_ENABLE"
_DELAYS = ("SENSOR_DELAY_CAM", "SENSOR_DELAY_EGO")
_SEVERITIES: dict[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "BLEND_ENABLE": ((), ("BLEND_NUM", "BLEND_MODE")),
    "FRAME_DROP_ENABLE": (("BURST_MAX_TICKS", "BURST_PROBABILITY"), ()),
    "PARTIAL_OBS_ENABLE": (("PARTIAL_OBS_RATIO",), ("PARTIAL_OBS_TYPE",)),
    "GPS_DRIFT_ENABLE": (("GPS_NOISE_STD",), ("GPS_DRIFT_MODE",)),
    "SPEED_BIAS_ENABLE": (("SPEED_BIAS_MEAN", "SPEED_BIAS_STD"), ()),
    _LATENCY: ((), ("INFERENCE_LATENCY_MS", "INFERENCE_LATENCY_MODE", "WARMUP_STEPS")),
}
"""The severities of each switch: the paper's, which switch it on themselves, then the released code's."""


class PaperVariables:
    """Typed reading of the released code's variables. An empty one counts as not set."""

    def __init__(self, environ: Mapping[str, str]) -> None:
        self._environ = environ

    def text(self, name: str) -> str:
        """Return the value without blanks around it, `""` when not set."""
        return self._environ.get(name, "").strip()

    def switch(self, name: str) -> bool:
        """Read 1/0, true/false, yes/no, on/off; where it is not set, on when a severity of the paper's table is."""
        text = self.text(name).lower()
        if not text:
            return any(map(self.text, _SEVERITIES.get(name, ((), ()))[0]))
        if text in ("1", "true", "yes", "on"):
            return True
        if text in ("0", "false", "no", "off"):
            return False
        raise self._refused(name, "1 or 0")

    def refuse_idle(self) -> None:
        """Refuse a severity that would do nothing, because nobody said whether its switch is on or off."""
        for switch, (paper, released) in _SEVERITIES.items():
            needed = [_LATENCY] if switch == _LATENCY else [_OBSERVATION, switch]
            self._refuse_without(needed, [name for name in (switch, *paper, *released) if self.text(name)])
        self._refuse_without([_OBSERVATION], [name for name in _DELAYS if self.whole(name, 0)])

    def _refuse_without(self, needed: list[str], given: list[str]) -> None:
        if not given or any(self.text(name) and not self.switch(name) for name in needed):
            return
        missing = [name + "=1" for name in needed if not self.switch(name)]
        if missing:
            raise self._refused(given[0], " and ".join(missing) + ", without which it does nothing")

    def number(self, name: str, default: float, low: float = 0.0, high: float = math.inf) -> float:
        """Read a finite number in range."""
        text = self.text(name)
        if not text:
            return default
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not (math.isfinite(value) and low <= value <= high):
            raise self._refused(
                name, "a number of at least {:g}{}".format(low, "" if high == math.inf else ", at most 1")
            )
        return value

    def whole(self, name: str, default: int, low: int = 0) -> int:
        """Read a whole number of at least `low`."""
        text = self.text(name)
        if not text:
            return default
        if not text.lstrip("+-").isdecimal() or int(text) < low:
            raise self._refused(name, f"a whole number of at least {low}")
        return int(text)

    def choice(self, name: str, default: str, choices: tuple[str, ...]) -> str:
        """Read one of `choices`."""
        text = self.text(name).lower() or default
        if text not in choices:
            raise self._refused(name, "one of {}".format(", ".join(choices)))
        return text

    def _refused(self, name: str, expected: str) -> SettingRefusedError:
        return SettingRefusedError(f"{name} is {self._environ[name]!r}, expected {expected}")


def _paper(variables: PaperVariables) -> tuple[list[tuple[str, dict[str, Any]]], int, float]:
    """Return stack, seed and seconds per tick of the released code's variables: `perturbations/paper_variables.py`."""
    rate_hz = variables.number("SIM_RATE", 20.0)
    if rate_hz <= 0.0:
        raise SettingRefusedError("SIM_RATE is 0, expected ticks per second")
    seed = variables.whole("ROBUSTNESS_SEED", 0, -(1 << 62))
    if variables.text("GPS_DRIFT_SEED"):
        raise SettingRefusedError("GPS_DRIFT_SEED is set, expected ROBUSTNESS_SEED, which seeds everything")
    variables.refuse_idle()
    stack: list[tuple[str, dict[str, Any]]] = []
    if variables.switch(_OBSERVATION):
        stack += _paper_timing(variables, rate_hz) + _paper_camera(variables, rate_hz) + _paper_ego_state(variables)
    if variables.switch(_LATENCY):
        warmup_ticks = variables.whole("WARMUP_STEPS", 20)
        if variables.choice("INFERENCE_LATENCY_MODE", "fixed", ("fixed", "measured")) == "measured":
            if variables.text("INFERENCE_LATENCY_MS"):
                raise SettingRefusedError("INFERENCE_LATENCY_MS does nothing with INFERENCE_LATENCY_MODE=measured")
            stack.append(("inference-latency", {"mode": "measured", "warmup_ticks": warmup_ticks}))
        else:
            ms = variables.number("INFERENCE_LATENCY_MS", 100.0)
            stack.append(("inference-latency", {"ms": ms, "mode": "hold", "warmup_ticks": warmup_ticks}))
    return stack, seed, DT_S


def _paper_timing(variables: PaperVariables, rate_hz: float) -> list[tuple[str, dict[str, Any]]]:
    found: list[tuple[str, dict[str, Any]]] = []
    camera_ticks, ego_ticks = variables.whole("SENSOR_DELAY_CAM", 0), variables.whole("SENSOR_DELAY_EGO", 0)
    if camera_ticks or ego_ticks:
        delays = {"camera_ms": 1000.0 * camera_ticks / rate_hz, "ego_ms": 1000.0 * ego_ticks / rate_hz}
        found.append(("sensor-delay", delays))
    if variables.switch("BLEND_ENABLE"):
        weights = variables.choice("BLEND_MODE", "uniform", ("uniform", "linear"))
        found.append(("frame-blend", {"frames": variables.whole("BLEND_NUM", 3, 1), "weights": weights}))
    return found


def _paper_camera(variables: PaperVariables, rate_hz: float) -> list[tuple[str, dict[str, Any]]]:
    found: list[tuple[str, dict[str, Any]]] = []
    if variables.switch("FRAME_DROP_ENABLE"):
        length_s = variables.whole("BURST_MAX_TICKS", 20, 2) / rate_hz
        probability = variables.number("BURST_PROBABILITY", 0.01, 0.0, 1.0)
        found.append(("burst-frame-drop", {"length_s": length_s, "probability": probability, "length": "uniform"}))
    if variables.switch("PARTIAL_OBS_ENABLE"):
        usual = "blur" if variables.text("PARTIAL_OBS_ENABLE") else "occlusion"  # the released code's, the paper's
        fill = variables.choice("PARTIAL_OBS_TYPE", usual, ("blur", "occlusion"))
        ratio = variables.number("PARTIAL_OBS_RATIO", 0.5, 0.0, 1.0)
        found.append(("partial-observation", {"ratio": ratio, "fill": "black" if fill == "occlusion" else fill}))
    return found


def _paper_ego_state(variables: PaperVariables) -> list[tuple[str, dict[str, Any]]]:
    found: list[tuple[str, dict[str, Any]]] = []
    if variables.switch("GPS_DRIFT_ENABLE"):
        level_m = {"medium": 5.0, "severe": 15.0}[variables.choice("GPS_DRIFT_MODE", "medium", ("medium", "severe"))]
        found.append(("gps-noise", {"std_m": variables.number("GPS_NOISE_STD", level_m)}))
    if variables.switch("SPEED_BIAS_ENABLE"):
        mean, std = variables.number("SPEED_BIAS_MEAN", 0.5), variables.number("SPEED_BIAS_STD", 0.2)
        found.append(("speed-noise", {"mean": mean, "std": std}))
    return found


# ---------------------------------------------------------------------------------------------------------------------
# At the seams of the evaluator
# ---------------------------------------------------------------------------------------------------------------------


class Injector:
    """The failures of the route that is being driven. `trouble` is the exception that stands for our own mistakes.

    `sensors` is the method of the agent that lists its sensors; it is asked once for each route.
    """

    def __init__(self, plan: InjectionPlan, trouble: type[Exception] = RuntimeError) -> None:
        self.plan = plan
        self.sensors: Callable[[], Iterable[Mapping[str, Any]]] = tuple
        self._trouble = trouble
        self._frame: Any = None
        self._given: dict[str, Any] | None = None
        self._reading_s = 0.0
        self._begin_fresh("", 0)
        self._begun = False

    def begin(self, route: str, repetition: int) -> None:
        """Begin a route: everything about the last one is forgotten."""
        self.end()
        self._begin_fresh(route, repetition)

    def end(self) -> None:
        """End a route: its line of the log is written. Calling it twice does no harm."""
        if not self._begun:
            return
        self._begun = False
        if self.plan.log:
            with open(self.plan.log, "a") as file:
                file.write(json.dumps(self._line()) + "\n")

    def data(self, read: Callable[[], dict[str, Any]], frame: Any) -> dict[str, Any]:
        """Return what `get_data` returns: `read` is asked once per tick."""
        if self._in_call:
            known = self._given is not None
        else:
            known = self._given is not None and frame is not None and frame == self._frame
            if not known:
                self._next_tick()
        if not known:
            asked_s = time.perf_counter()
            raw = read()
            self._frame = frame
            try:
                self._given = self._perturbed(raw)
            except Exception as error:
                raise self._trouble(f"the injection failed: {error!r}") from error
            self._reading_s += time.perf_counter() - asked_s
        assert self._given is not None
        return dict(self._given)

    def step(self, call: Callable[[], Any], look: Callable[[], Any]) -> Any:
        """Drive one tick: `call` asks the agent, `look` only reads the sensors, for a tick in which it is not asked."""
        self._next_tick()
        self._in_call = True
        control, inference_s = None, 0.0
        try:
            if all(item.is_free(self._tick) for item in self._late):
                asked_s = time.perf_counter()
                control = call()
                inference_s = max(0.0, time.perf_counter() - asked_s - self._reading_s)
            else:
                look()
        finally:
            self._in_call = False
        return self._due(control, inference_s) if self._late else control

    def _begin_fresh(self, route: str, repetition: int) -> None:
        self._route, self._repetition = route, repetition
        self._rig: dict[str, str] = {}
        failures = self.plan.started(route, repetition, self._rig)
        self._failures = failures
        self._observing = [item for item in failures if item.observes]
        self._late = [item for item in failures if isinstance(item, InjectedLatency)]
        self._tick = -1
        self._frame = None
        self._given = None
        self._reading_s = 0.0
        self._in_call = False
        self._seen: Any = None
        self._last: Any = NEUTRAL
        self._begun = True

    def _next_tick(self) -> None:
        if not self._begun:
            self._begin_fresh(os.environ.get("PDR_ROUTE", ""), 0)
        self._tick += 1
        self._given = None
        self._reading_s = 0.0

    def _perturbed(self, raw: Mapping[str, Any]) -> dict[str, Any]:
        if not self._observing:
            return dict(raw)
        kinds = {tag: "" if tag in DEBUG_CAMERAS else kind_of(item[1]) for tag, item in raw.items()}
        cameras = {tag: raw[tag][1] for tag in sorted(raw) if kinds[tag] == "camera"}
        if cameras and not self._rig:
            self._rig.update(rig_of(self.sensors()))
        ego = {tag: raw[tag][1] for tag in sorted(raw) if kinds[tag] in ("imu", "speed")}
        ego.update({tag: GnssFix.read(raw[tag][1]) for tag in sorted(raw) if kinds[tag] == "gps"})
        sight = SensedTick(self._tick, cameras, ego)
        for failure in self._observing:
            sight = failure.observe(sight)
        given = dict(raw)
        for tag, item in [*sight.cameras.items(), *sight.ego.items()]:
            payload = item.written() if isinstance(item, GnssFix) else item
            if tag in raw and payload is not raw[tag][1]:
                given[tag] = (raw[tag][0], _own(payload))
        return given

    def _due(self, control: Any, inference_s: float) -> Any:
        try:
            if control is not None:
                self._seen = control = copied(control)
            for item in self._late:
                control = item.actuate(self._tick, control, inference_s)
            if control is not None:
                self._last = control
            return neutral_like(self._seen) if self._last is NEUTRAL else copied(self._last)
        except Exception as error:
            raise self._trouble(f"the injection failed: {error!r}") from error

    def _line(self) -> dict[str, Any]:
        return {
            "route": self._route,
            "repetition": self._repetition,
            "seed": self.plan.seed + self._repetition,
            "setting": self.plan.setting,
            "dt_s": self.plan.dt_s,
            "ticks": self._tick + 1,
            "schedule": [line for item in self._failures for line in item.schedule()],
            "inference_s": next((item.times_s for item in self._late if item.times_s), []),
        }


def wrap(
    injector: Injector, interface: type[Any], wrapper: type[Any], manager: Any, frame_now: Callable[[], int]
) -> None:
    """Put the injector between the classes of a checkout. `frame_now` gives the number of the current frame.

    Raises `SettingRefusedError` when they are wrapped already.
    """
    if hasattr(interface, _MARK):
        raise SettingRefusedError("this evaluator is already wrapped")
    get_data, call, cleanup = interface.get_data, wrapper.__call__, wrapper.cleanup
    takes_frame = len(inspect.signature(get_data).parameters) > 1

    def given_data(self: Any, *frame: Any) -> dict[str, Any]:
        return injector.data(lambda: get_data(self, *frame), frame[0] if frame else None)

    def given_control(self: Any) -> Any:
        agent = self._agent
        if "ROS" in type(self).__name__ and injector.plan.stack:
            raise injector._trouble("a ROS agent reads its sensors elsewhere: nothing can be injected")
        injector.sensors = lambda: agent.sensors()  # looked up only where there is a camera
        frame = (frame_now(),) if takes_frame else ()
        return injector.step(lambda: call(self), lambda: agent.sensor_interface.get_data(*frame))

    def cleaned_up(self: Any) -> Any:
        injector.end()
        return cleanup(self)

    setattr(interface, _MARK, get_data)
    interface.get_data, wrapper.__call__, wrapper.cleanup = given_data, given_control, cleaned_up
    if manager is not None:
        load_scenario = manager.load_scenario

        def begun(self: Any, scenario: Any, agent: Any, route_index: Any, rep_number: int = 0) -> Any:
            injector.begin(route_of(scenario, route_index), rep_number)
            return load_scenario(self, scenario, agent, route_index, rep_number)

        manager.load_scenario = begun


def route_of(scenario: Any, route_index: Any) -> str:
    """Return the id of a route scenario: `2091` of `RouteScenario_2091`."""
    name = str(getattr(getattr(scenario, "config", None), "name", route_index))
    prefix = "RouteScenario_"
    return name[len(prefix) :] if name.startswith(prefix) else name


def install(environ: Mapping[str, str] = os.environ) -> Injector:
    """Wrap the leaderboard that is on the path. Raises `SettingRefusedError`."""
    plan = plan_from(environ)
    sensors = importlib.import_module("leaderboard.envs.sensor_interface")
    agents = importlib.import_module("leaderboard.autoagents.agent_wrapper")
    managers = importlib.import_module("leaderboard.scenarios.scenario_manager")
    timer = importlib.import_module("srunner.scenariomanager.timer")
    # The evaluator takes this exception, alone of all, for a fault that is not the agent's.
    trouble = type("InjectionError", (sensors.SensorReceivedNoData,), {})
    injector = Injector(plan, trouble)
    wrap(injector, sensors.SensorInterface, agents.AgentWrapper, managers.ScenarioManager, timer.GameTime.get_frame)
    atexit.register(injector.end)
    print(f"drive-robust: injecting {plan.setting or plan.stack} with seed {plan.seed}", flush=True)
    return injector


def main(arguments: list[str]) -> None:
    """Run an evaluator with the injection: `inject.py EVALUATOR.py [its arguments]`."""
    if not arguments:
        print("usage: inject.py LEADERBOARD_EVALUATOR.py [its arguments]", file=sys.stderr)
        sys.exit(REFUSED)
    evaluator = os.path.abspath(arguments[0])
    sys.argv = [evaluator, *list(arguments[1:])]
    sys.path[0] = os.path.dirname(evaluator)  # as if it had been started itself; our own folder has nothing for it
    try:
        install()
    except SettingRefusedError as error:
        print(f"drive-robust: {error}", file=sys.stderr, flush=True)
        sys.exit(REFUSED)
    runpy.run_path(evaluator, run_name="__main__")


if __name__ == "__main__":
    main(sys.argv[1:])
