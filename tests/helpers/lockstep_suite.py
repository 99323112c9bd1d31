"""Agents with `act_batch` in a conftest.py, as people write them."""

from __future__ import annotations

import time
from collections.abc import Sequence

from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.domain.observation import CameraSpec, Observation
from pytest_drive_robust.domain.route import GlobalPlan

LOCKSTEP_CONFTEST = '''
import ctypes
import os
import time

import numpy as np

_RNG = np.random.default_rng(5)
_IN, _OUT = _RNG.normal(size=(4, 16)), _RNG.normal(size=(16, 3))


class Row:
    """A small recurrent network, the same sums in the same order for every row. `fault` breaks it on one route."""

    fault = None
    length_m = 11

    def sensors(self):
        return []

    def reset(self, route, seed):
        self.tick, self.memory = 0, float(seed)
        self.breaks = self.fault is not None and round(route.points[-1].x_m) == self.length_m

    def act(self, observation):
        return self.act_batch([self], [observation])[0]

    @classmethod
    def act_batch(cls, agents, observations):
        rows = np.array([
            [one.memory, seen.gps.x_m / 10.0, seen.speed.mps, 1.0]
            for one, seen in zip(agents, observations, strict=True)
        ])
        controls = []
        for one, (throttle, steer, memory) in zip(agents, cls.forward(rows), strict=True):
            if one.breaks and one.tick == 20:
                one.fault()
            one.tick, one.memory = one.tick + 1, float(memory)
            controls.append(Control(throttle=0.8 + 0.2 * float(throttle), steer=0.01 * float(steer)))
        return controls

    @staticmethod
    def forward(rows):
        hidden = np.tanh(np.einsum("bi,io->bo", rows, _IN))
        return np.tanh(np.einsum("bi,io->bo", hidden, _OUT))


class Segfaults(Row):
    def fault(self):
        ctypes.string_at(0)


class LeavesAtOnce(Row):
    length_m = 10

    def fault(self):
        os._exit(7)


class Hangs(Row):
    def fault(self):
        time.sleep(600.0)


class Raises(Row):
    def fault(self):
        raise ZeroDivisionError("no way")


class RaisesAtOnce(Raises):
    length_m = 10


class Social(Row):
    """Looks at the others: as batch normalisation in training mode does."""

    @staticmethod
    def forward(rows):
        return Row.forward(rows - rows.mean(axis=0))


def made_elsewhere() -> Row:
    return Row()


AGENTS += [Row, Segfaults, LeavesAtOnce, Hangs, Raises, RaisesAtOnce, Social, made_elsewhere]
'''


class HangsTogether:
    """Never comes back from the first tick of an episode with seed 1."""

    def sensors(self) -> list[CameraSpec]:
        return []

    def reset(self, route: GlobalPlan, seed: int) -> None:
        self.seed = seed

    def act(self, observation: Observation) -> Control:
        return Control(throttle=1.0)

    @classmethod
    def act_batch(cls, agents: Sequence[HangsTogether], observations: Sequence[Observation]) -> list[Control]:
        if any(agent.seed == 1 for agent in agents):
            time.sleep(600.0)
        return [agent.act(seen) for agent, seen in zip(agents, observations, strict=True)]
