"""The episode: the unit that is driven, stored, cached and retried."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, order=True)
class Episode:
    """(agent, route, setting, seed). `setting` is the sentence form (`str(Setting)`), `"clean"` for the empty stack."""

    agent: str
    route_id: str
    setting: str
    seed: int

    def __str__(self) -> str:
        return f"{self.agent} on {self.route_id} under {self.setting}, seed {self.seed}"
