"""Fingerprints of runs, and the mismatches that decide whether two runs may be compared.

=========== =============================================================== ==========
kind        what differs                                                    by default
=========== =============================================================== ==========
simulator   its name, version, when it stops a stuck episode                refuse
routes      the content of a route that both call by the same id; routes    refuse
            that only the old run drove, that it did not score, or
            that a verdict did without
versions    libraries that decide the numbers, Python, the machine's bits   warn
agent       its distribution, source or weights: that is what is compared   tell
=========== =============================================================== ==========
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Literal, get_args

from pytest_drive_robust.domain.result import MACHINE_FACTS
from pytest_drive_robust.options.option import GivenText
from pytest_drive_robust.options.parsers import one_of

MismatchPolicy = Literal["default", "warn", "refuse"]
Kind = Literal["simulator", "routes", "versions", "agent"]

parse_policy: Callable[[GivenText], MismatchPolicy] = one_of(get_args(MismatchPolicy), "policy for mismatches")
"""Returns the policy that an option names."""

_NOT_NUMBERS = frozenset({"pytest", "pytest-drive-robust"})
"""Packages whose recorded versions decide no score; the embedded simulators have their own versions."""


@dataclass(frozen=True, slots=True)
class AgentPrint:
    """The distribution and the digests of source and weights of an agent; empty when unknown (see `identity`).

    The distribution of an agent that a hook registered is the place of its definition: `"conftest.py:MyAgent"`.
    """

    distribution: str = ""
    source: str = ""
    weights: str = ""


@dataclass(frozen=True, slots=True)
class Fingerprint:
    """The simulator, agent and versions that drove the episodes of one agent; `simulator` is the name in the options.

    `versions` come from the records of the episodes; an agent with equal bits everywhere records only the simulator.
    `plugins` are needed to drive the episodes again; they are not compared.
    """

    simulator: str
    stuck_stop_s: float | None = None
    agent: AgentPrint = AgentPrint()
    versions: Mapping[str, str] = field(default_factory=dict)
    plugins: tuple[str, ...] = field(default=(), compare=False)

    @property
    def world(self) -> str:
        """The name of the simulator, with the version that its episodes recorded."""
        version = self.versions.get("simulator") or self.versions.get(self.simulator.partition(":")[0], "")
        return f"{self.simulator} ({version})" if version else self.simulator


@dataclass(frozen=True, slots=True)
class Mismatch:
    """One difference, as a sentence without a full stop; `advice` says how to avoid the difference."""

    kind: Kind
    text: str
    advice: str = "Drive both runs in the same way"

    def refuses(self, policy: MismatchPolicy) -> bool:
        """Return whether the comparison is forbidden. A changed agent never is: a comparison is made to judge it."""
        if self.kind == "agent" or policy == "warn":
            return False
        return policy == "refuse" or self.kind in ("simulator", "routes")


def mismatches(before: Fingerprint, after: Fingerprint, *, agent: str) -> tuple[Mismatch, ...]:
    """Return the differences between two fingerprints of `agent`, except for routes; unknown versions are skipped."""
    return (*_simulators(before, after), *_versions(before, after), *_agents(before.agent, after.agent, agent))


def _simulators(before: Fingerprint, after: Fingerprint) -> Iterable[Mismatch]:
    if before.world != after.world:
        yield Mismatch("simulator", f"the simulator was {before.world} and is {after.world}")
    yield from stuck_stops(before.stuck_stop_s, after.stuck_stop_s)


def stuck_stops(before_s: float | None, after_s: float | None) -> Iterable[Mismatch]:
    """Yield a mismatch if two runs stop episodes of a stuck agent after different times (seconds; None: never)."""
    if before_s != after_s:
        was, now = _stop(before_s), _stop(after_s)
        yield Mismatch("simulator", f"episodes of a stuck agent were {was} and are {now}")


def _stop(seconds: float | None) -> str:
    return "never stopped early" if seconds is None else f"stopped after {seconds:g} s"


def _versions(before: Fingerprint, after: Fingerprint) -> Iterable[Mismatch]:
    told = {
        "simulator",
        before.simulator.partition(":")[0],
        after.simulator.partition(":")[0],
        *_NOT_NUMBERS,
    }
    for name in sorted({*before.versions, *after.versions} - told):
        was, now = before.versions.get(name), after.versions.get(name)
        if was == now or was is None or now is None:
            continue
        if name in MACHINE_FACTS:
            yield Mismatch(
                "versions",
                f"the {MACHINE_FACTS[name]} of this machine gives other bits than that of the other machine: the same "
                "agent may score a little differently here; drive-robust replay FILE.episode --stored-controls drives "
                "a stored episode again to the same bits anywhere",
            )
        else:
            yield Mismatch("versions", f"{name} was {was} and is {now}")


def _agents(before: AgentPrint, after: AgentPrint, agent: str) -> Iterable[Mismatch]:
    changes = []
    places = before.distribution, after.distribution
    # two places are not compared: how they are called depends on the folder of the call, and the source counts anyway
    if before.distribution != after.distribution and all(places) and not all(":" in place for place in places):
        changes.append(f"{before.distribution} became {after.distribution}")
    for what in ("source", "weights"):
        was, now = getattr(before, what), getattr(after, what)
        if was != now and (was or what == "weights"):
            changes.append(f"{what} {was or 'unknown'} became {now or 'unknown'}")
    if changes:
        yield Mismatch("agent", f"the agent {agent} changed: {', '.join(changes)}")
