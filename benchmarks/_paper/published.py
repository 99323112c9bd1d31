"""The paper's own numbers: every agent and setting of its table `tab:robust_full_combined`, as printed.

Source: Bench2Drive-Robust, section "Results". RD is a share, DS 0..100, SR, efficiency and comfort in percent. The
numbers were measured in CARLA with the original networks; we computed only averages of these numbers.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

__all__ = [
    "AGENTS",
    "AVERAGES",
    "CLEAN",
    "FAMILIES",
    "PUBLISHED",
    "SETTINGS",
    "SHORT",
    "Published",
    "published_average",
]

CLEAN = "clean"

FAMILIES: dict[str, tuple[str, ...]] = {
    "burst": ("1 s burst frame drop", "3 s burst frame drop"),
    "occlusion": ("occlusion 0.5", "occlusion 0.8"),
    "GPS": ("GPS noise 5 m", "GPS noise 15 m"),
    "speed": ("speed noise 0.5", "speed noise 0.2"),
    "latency": ("100 ms latency", "200 ms latency", "500 ms latency"),
}
"""The eleven settings by family, each from its mildest to its most severe (`tab:perturbation_summary`)."""

SETTINGS = tuple(setting for family in FAMILIES.values() for setting in family)
"""The eleven settings as `suites/paper` names them, without clean."""

AVERAGES: dict[str, tuple[str, ...]] = {
    "avg. perturbed": tuple(setting for setting in SETTINGS if setting not in FAMILIES["latency"]),
    "avg. latency": FAMILIES["latency"],
    "avg. all": SETTINGS,
}
"""The settings behind each of the table's rows of averages, which are plain means of the columns."""

SHORT = {
    "1 s burst frame drop": "burst 1 s",
    "3 s burst frame drop": "burst 3 s",
    "occlusion 0.5": "occlusion 0.5",
    "occlusion 0.8": "occlusion 0.8",
    "GPS noise 5 m": "GPS 5 m",
    "GPS noise 15 m": "GPS 15 m",
    "speed noise 0.5": "speed 0.5",
    "speed noise 0.2": "speed 0.2",
    "100 ms latency": "latency 100 ms",
    "200 ms latency": "latency 200 ms",
    "500 ms latency": "latency 500 ms",
}
"""Names of the settings for a picture or a narrow column."""


class Published(NamedTuple):
    """One row of the table; `efficiency` is percent of the traffic's speed, `comfort` percent of the segments."""

    rd: float
    ds: float
    sr_pct: float
    efficiency: float
    comfort: float


_ROWS: dict[str, tuple[tuple[float, float, float, float, float], ...]] = {
    "tcp": (  # TCP-traj
        (0.00, 59.90, 30.00, 76.54, 18.08),
        (0.01, 59.17, 28.64, 78.41, 23.84),
        (0.05, 56.80, 25.00, 78.26, 23.67),
        (0.16, 50.16, 24.09, 75.28, 30.24),
        (0.24, 45.54, 18.18, 76.10, 25.24),
        (0.30, 41.88, 18.18, 71.37, 20.04),
        (0.65, 21.12, 0.45, 58.37, 29.22),
        (0.04, 57.49, 27.72, 91.43, 23.82),
        (0.07, 55.61, 23.64, 123.01, 23.73),
        (-0.02, 60.91, 32.27, 77.75, 13.49),
        (0.44, 33.43, 0.00, 77.22, 2.35),
        (0.46, 32.22, 0.00, 80.22, 3.03),
    ),
    "uniad": (
        (0.00, 45.81, 16.36, 129.21, 43.58),
        (0.03, 44.26, 14.55, 134.70, 27.50),
        (0.08, 42.20, 13.64, 126.88, 43.82),
        (0.11, 40.71, 15.45, 127.46, 42.25),
        (0.39, 28.03, 2.27, 133.95, 46.66),
        (0.15, 39.07, 11.36, 141.52, 51.11),
        (0.55, 20.50, 0.00, 117.55, 48.91),
        (0.19, 37.27, 12.72, 184.92, 51.85),
        (0.37, 29.08, 4.55, 221.40, 54.46),
        (0.19, 37.01, 14.09, 123.44, 47.00),
        (0.26, 33.84, 10.45, 130.93, 8.12),
        (0.30, 31.85, 7.73, 143.88, 5.42),
    ),
    "vad": (
        (0.00, 42.35, 15.00, 157.94, 46.01),
        (-0.02, 43.04, 17.73, 151.75, 47.69),
        (0.08, 39.09, 13.18, 149.70, 50.76),
        (0.00, 42.21, 17.73, 163.26, 41.88),
        (0.22, 33.15, 6.39, 167.09, 49.50),
        (0.13, 37.02, 12.27, 163.82, 32.64),
        (0.62, 16.26, 0.00, 155.12, 57.99),
        (0.06, 39.64, 14.09, 213.24, 50.31),
        (0.19, 34.33, 8.64, 243.92, 54.21),
        (0.14, 36.52, 11.36, 144.35, 53.10),
        (0.36, 27.15, 3.64, 252.31, 11.70),
        (0.44, 23.55, 2.27, 242.62, 9.75),
    ),
    "simlingo": (
        (0.00, 85.94, 66.82, 244.18, 25.49),
        (0.01, 85.47, 66.36, 235.40, 31.01),
        (0.00, 85.82, 69.09, 236.16, 31.68),
        (0.29, 60.71, 25.00, 226.06, 37.57),
        (0.83, 14.79, 0.00, 199.93, 70.22),
        (-0.02, 87.91, 73.64, 238.02, 33.41),
        (-0.02, 87.53, 70.91, 238.64, 32.98),
        (0.28, 61.77, 29.09, 276.62, 33.51),
        (0.50, 42.73, 6.36, 282.45, 27.15),
        (0.67, 28.45, 2.27, 218.92, 63.66),
        (0.77, 19.47, 0.00, 189.95, 64.52),
        (0.82, 15.70, 0.00, 177.93, 59.78),
    ),
}

AGENTS = tuple(_ROWS)
"""The four agents, in the paper's order, as this repository names its re-implementations of them."""

PUBLISHED: dict[str, dict[str, Published]] = {
    agent: {setting: Published(*row) for setting, row in zip((CLEAN, *SETTINGS), rows, strict=True)}
    for agent, rows in _ROWS.items()
}
"""The rows of the table by agent and setting."""


def published_average(agent: str, settings: Sequence[str]) -> Published:
    """Return the means of an agent's columns over `settings`, as the paper's rows of averages have them.

    RD is computed from the mean DS, which equals the mean of the unrounded RDs.
    """
    rows = [PUBLISHED[agent][setting] for setting in settings]
    means = Published(*(sum(column) / len(rows) for column in zip(*rows, strict=True)))
    return means._replace(rd=1.0 - means.ds / PUBLISHED[agent][CLEAN].ds)
