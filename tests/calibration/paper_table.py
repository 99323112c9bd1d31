"""DS and SR (percent) of the benchmark's result table: clean, then its eleven perturbations.

Source: Bench2Drive-Robust, "Robustness results", table of all models and settings.
"""

from __future__ import annotations

SETTINGS = (
    "clean",
    "occlusion 0.5",
    "occlusion 0.8",
    "burst 1 s",
    "burst 3 s",
    "GPS 5 m",
    "GPS 15 m",
    "speed noise 0.5",
    "speed noise 0.2",
    "latency 100 ms",
    "latency 200 ms",
    "latency 500 ms",
)

PAPER: dict[str, tuple[float, tuple[tuple[float, float], ...]]] = {
    "TCP-traj": (
        0.43,
        (
            (59.90, 30.00),
            (50.16, 24.09),
            (45.54, 18.18),
            (59.17, 28.64),
            (56.80, 25.00),
            (41.88, 18.18),
            (21.12, 0.45),
            (57.49, 27.72),
            (55.61, 23.64),
            (60.91, 32.27),
            (33.43, 0.00),
            (32.22, 0.00),
        ),
    ),
    "UniAD": (
        0.28,
        (
            (45.81, 16.36),
            (40.71, 15.45),
            (28.03, 2.27),
            (44.26, 14.55),
            (42.20, 13.64),
            (39.07, 11.36),
            (20.50, 0.00),
            (37.27, 12.72),
            (29.08, 4.55),
            (37.01, 14.09),
            (33.84, 10.45),
            (31.85, 7.73),
        ),
    ),
    "VAD": (
        0.28,
        (
            (42.35, 15.00),
            (42.21, 17.73),
            (33.15, 6.39),
            (43.04, 17.73),
            (39.09, 13.18),
            (37.02, 12.27),
            (16.26, 0.00),
            (39.64, 14.09),
            (34.33, 8.64),
            (36.52, 11.36),
            (27.15, 3.64),
            (23.55, 2.27),
        ),
    ),
    "SimLingo": (
        0.50,
        (
            (85.94, 66.82),
            (60.71, 25.00),
            (14.79, 0.00),
            (85.47, 66.36),
            (85.82, 69.09),
            (87.91, 73.64),
            (87.53, 70.91),
            (61.77, 29.09),
            (42.73, 6.36),
            (28.45, 2.27),
            (19.47, 0.00),
            (15.70, 0.00),
        ),
    ),
}
"""Model to the share of the seed in its luck (assumed) and its rows (DS, SR)."""
