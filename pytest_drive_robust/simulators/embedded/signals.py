"""What traffic lights show: a state until the scenario starts, then scripted phases."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pytest_drive_robust.domain.truth import LightState

__all__ = ["GREEN", "RED", "Program", "compile_programs", "green_then_red", "red_then_green"]

MAX_PHASES = 4
_YELLOW_S = 2.0


@dataclass(frozen=True, slots=True)
class Program:
    """`before` holds until the scenario starts; each phase is (state, seconds after that at which it ends).

    The last phase holds for ever, whatever its time.
    """

    before: LightState
    phases: tuple[tuple[LightState, float], ...]


GREEN = Program(LightState.GREEN, ((LightState.GREEN, np.inf),))
RED = Program(LightState.RED, ((LightState.RED, np.inf),))


def red_then_green(red_s: float) -> Program:
    """Return a program: red until `red_s` seconds after the scenario started, green from then on."""
    return Program(LightState.RED, ((LightState.RED, red_s), (LightState.GREEN, np.inf)))


def green_then_red(green_s: float, red_s: float) -> Program:
    """Return a program: green for `green_s` after the scenario started, yellow for a second, red for `red_s`, green."""
    return Program(
        LightState.GREEN,
        (
            (LightState.GREEN, green_s),
            (LightState.YELLOW, green_s + _YELLOW_S),
            (LightState.RED, green_s + _YELLOW_S + red_s),
            (LightState.GREEN, np.inf),
        ),
    )


def compile_programs(
    programs: list[Program],
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64]]:
    """Return (state before, states (lines, 4), ends in seconds (lines, 4)) for the kernels."""
    before = np.array([int(program.before) for program in programs], dtype=np.int64)
    states = np.zeros((len(programs), MAX_PHASES), dtype=np.int64)
    until = np.full((len(programs), MAX_PHASES), np.inf)
    for k, program in enumerate(programs):
        for phase in range(MAX_PHASES):
            state, end_s = program.phases[min(phase, len(program.phases) - 1)]
            states[k, phase] = int(state)
            until[k, phase] = end_s
    return before, states, until
