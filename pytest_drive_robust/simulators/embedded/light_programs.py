"""Programs of traffic lights: phases over time, and their arrays for the kernels."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pytest_drive_robust.domain.truth import LightState
from pytest_drive_robust.jit.arrays import Floats, Ints

YELLOW_S = 2.0
"""Duration of yellow: at town speeds, a driver can either stop before the line or pass it."""
_MOST_PHASES = 4


@dataclass(frozen=True, slots=True)
class Program:
    """State `before` the scenario starts, then phases (state, end in seconds after that start); the last never ends."""

    before: LightState
    phases: tuple[tuple[LightState, float], ...]


GREEN = Program(LightState.GREEN, ((LightState.GREEN, np.inf),))
RED = Program(LightState.RED, ((LightState.RED, np.inf),))


def red_then_green(red_s: float) -> Program:
    """Return a program: red until `red_s` seconds after the scenario started, green from then on."""
    return Program(LightState.RED, ((LightState.RED, red_s), (LightState.GREEN, np.inf)))


def green_then_red(green_s: float, red_s: float) -> Program:
    """Return a program: green for `green_s` after the scenario started, yellow for two, red for `red_s`, green."""
    return Program(
        LightState.GREEN,
        (
            (LightState.GREEN, green_s),
            (LightState.YELLOW, green_s + YELLOW_S),
            (LightState.RED, green_s + YELLOW_S + red_s),
            (LightState.GREEN, np.inf),
        ),
    )


def green_between(start_s: float, end_s: float) -> Program:
    """Return a program that is red except for one green phase, which ends with yellow."""
    return Program(
        LightState.RED if start_s > 0.0 else LightState.GREEN,
        (
            (LightState.RED, start_s),
            (LightState.GREEN, end_s),
            (LightState.YELLOW, end_s + YELLOW_S),
            (LightState.RED, np.inf),
        ),
    )


def compile_programs(programs: list[Program]) -> tuple[Ints, Ints, Floats]:
    """Return (state before, states (lines, 4), ends in seconds (lines, 4)) for the kernels."""
    before = np.array([int(program.before) for program in programs], dtype=np.int64)
    states = np.zeros((len(programs), _MOST_PHASES), dtype=np.int64)
    until = np.full((len(programs), _MOST_PHASES), np.inf)
    for k, program in enumerate(programs):
        for phase in range(_MOST_PHASES):
            state, end_s = program.phases[min(phase, len(program.phases) - 1)]
            states[k, phase] = int(state)
            until[k, phase] = end_s
    return before, states, until
