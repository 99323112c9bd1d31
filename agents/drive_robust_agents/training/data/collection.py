"""The definition of a data set: whose cameras, which routes, who drives, and the shards that this makes."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from drive_robust_agents.training.data.dagger import Mixture, agent_of
from drive_robust_agents.training.data.expert_episode import Teacher
from drive_robust_agents.training.data.rigs import agent_rig
from drive_robust_agents.training.data.routes import training_keys
from drive_robust_agents.training.data.shards import Shard
from pytest_drive_robust import Setting
from pytest_drive_robust.errors import UsageError

_MOST_S = 5.0


@dataclass(frozen=True, slots=True)
class Collection:
    """The definition of a data set.

    The routes are `per_type` routes of each scenario type in `types` (empty: of all types) of the generator's seed
    `route_seed`; the first `routes` are driven (None: all), `episodes` times each. `dagger` is an agent or a weights
    file that shares the driving, each episode under one of `settings` (empty: clean). The expert leaves others `room_s`
    more than needed and stops for `halt_s` at stop signs (`Teacher`).
    """

    agent: str
    route_seed: int = 1
    per_type: int = 20
    routes: int | None = None
    episodes: int = 1
    data_seed: int = 0
    shard_routes: int = 4
    dagger: str | None = None
    beta: float = 0.5
    types: tuple[str, ...] = ()
    settings: tuple[str, ...] = ()
    room_s: float = 0.0
    halt_s: float = 0.0

    def check(self) -> None:
        """Raise `UsageError` for an impossible collection."""
        agent_rig(self.agent)
        training_keys(seed=self.route_seed, per_type=self.per_type, types=self.types)
        for name in ("episodes", "shard_routes"):
            if getattr(self, name) < 1:
                raise UsageError(f"--{name.replace('_', '-')} is {getattr(self, name)}, expected at least 1.")
        if self.routes is not None and self.routes < 1:
            raise UsageError(f"--routes is {self.routes}, expected at least 1.")
        if not 0.0 <= self.beta <= 1.0:
            raise UsageError(f"--beta is {self.beta!r}, expected the expert's share of the time: 0 to 1.")
        for name in ("room_s", "halt_s"):
            if not 0.0 <= getattr(self, name) <= _MOST_S:
                raise UsageError(f"--{name[:-2]} is {getattr(self, name)!r}, expected 0 to {_MOST_S:g} seconds.")
        for sentence in self.settings:
            Setting.parse(sentence)
        if self.settings and self.dagger is None:
            raise UsageError(
                "--settings are for the agent of --dagger, which is lacking: nothing fails for the expert."
            )
        if self.mixture is not None:
            agent_of(self.mixture)  # fail early for an agent that cannot be made

    def shards(self, folder: Path) -> tuple[Shard, ...]:
        """Return all shards of the collection."""
        keys = training_keys(seed=self.route_seed, per_type=self.per_type, types=self.types)[: self.routes]
        step, teacher = self.shard_routes, Teacher(self.room_s, self.halt_s)
        return tuple(
            Shard(
                folder, k, keys[k * step : (k + 1) * step], k * step, self.agent, self.episodes, self.data_seed,
                self.mixture, teacher,
            )
            for k in range(-(-len(keys) // step))
        )  # fmt: skip

    @property
    def mixture(self) -> Mixture | None:
        """The agent that shares the driving with the expert, or None without DAgger."""
        if self.dagger is None:
            return None
        return Mixture(self.agent, self.dagger, self.beta, self.settings)
