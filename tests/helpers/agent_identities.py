"""The source of an agent, and the identity of a factory, for tests of keys."""

from __future__ import annotations

from pytest_drive_robust.registry.registry import AgentFactory, Registry
from pytest_drive_robust.runner.cache_key.identity import agent_identity

AGENT = """
class Agent:
    gain = 1.0
    def sensors(self): return ()
    def reset(self, route, seed): pass
    def act(self, observation): return None

def make(gain): return lambda: Agent(gain)
"""


def identity_with(factory: AgentFactory, name: str = "mine") -> str:
    registry = Registry()
    registry.register_agent(name, factory)
    return agent_identity(name, registry)
