"""What the registry calls for `leaderboard:FILE+CONFIG`, and what makes an agent the same agent for the store."""

from __future__ import annotations

import functools
import os
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pytest_drive_robust.bench2drive import agents as official_agents
from pytest_drive_robust.bench2drive.agents.adapter import OfficialAgent
from pytest_drive_robust.bench2drive.agents.loading import load_agent_class
from pytest_drive_robust.bench2drive.agents.reference import Reference
from pytest_drive_robust.runner.cache_key.source_files import code_digest

__all__ = ["OfficialAgentFactory", "leaderboard_agent"]

_ASKS_FOR = re.compile(r"""(?:environ(?:\.get\(|\[)|getenv\()\s*['"](\w+)['"]""")
_PROVIDER = "CarlaDataProvider"


class OfficialAgentFactory:
    """Makes agents of one file with one configuration.

    It wraps the agent's class, so that the code of the agent and all that it imports is a part of its identity; the
    content of its configuration files is, too, as are our side of the bridge and those environment variables that the
    agent file asks for by name.
    """

    def __init__(self, reference: Reference) -> None:
        self.reference = reference
        cls = load_agent_class(reference.file)
        self._class = cls
        self.__wrapped__ = cls
        self.__module__ = cls.__module__
        self.__qualname__ = cls.__qualname__
        self.num_cpus = getattr(cls, "num_cpus", 1)
        self.num_gpus = getattr(cls, "num_gpus", 0)

    def __call__(self) -> OfficialAgent:
        """Return a new agent. Raises `UsageError` when it cannot be set up or has sensors that nobody knows."""
        name = f"{self._class.__name__} of {self.reference.file.name}"
        return OfficialAgent(self._class, self.reference.config, name=name, sees_world=self._sees_world())

    def check(self) -> None:
        """Set up an agent and give it back, to say at collection what is wrong with it. Raises `UsageError`."""
        self()

    @property
    def weights(self) -> tuple[Path, ...]:
        """Every file that the configuration names."""
        return self.reference.config_files

    @property
    def configuration(self) -> Mapping[str, Any]:
        """What decides how the agent drives and is not in its own source."""
        asked = sorted({*_ASKS_FOR.findall(self._text), "IS_BENCH2DRIVE"})
        return {
            "config": self.reference.config,
            "environment": {name: os.environ.get(name, "") for name in asked},
            "bridge": code_digest([official_agents]),
        }

    def _sees_world(self) -> bool:
        """Return whether the agent's own file imports what shows the world."""
        return re.search(rf"^[ \t]*(?:from|import)\b.*\b{_PROVIDER}\b", self._text, re.MULTILINE) is not None

    @functools.cached_property
    def _text(self) -> str:
        return self.reference.file.read_text(errors="replace")


def leaderboard_agent(argument: str) -> OfficialAgentFactory:
    """Return what `leaderboard:argument` makes agents with. Raises `UsageError`."""
    return OfficialAgentFactory(Reference.parse(argument))
