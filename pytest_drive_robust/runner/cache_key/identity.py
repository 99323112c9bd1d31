"""Computes digests of what an agent, a simulator and a set of routes are made of.

`identify` is recorded once per scope, for people and for `fingerprint` to compare. `identity_of` is part of every key
of the store: whatever it does not cover may change without an episode being driven again.

Versions of Python and of libraries are part of an identity only where they may decide a bit:

================================= ====================================================================================
the embedded world, metrics       none: their arithmetic is our own (`pytest_drive_robust.arithmetic`)
other simulators                  their `versions()`, Python, and all that the code of their environments imports
agents with `portable_bits`       none
agents with `computed_by`         Python and the modules that they name
other agents                      Python and all that their code imports
perturbations that are not ours   Python and all that their code imports
================================= ====================================================================================

What the processor decides is in no key, but in the records (`runner.episode.machine`).
"""

from __future__ import annotations

import re
from types import ModuleType

from pytest_drive_robust import simulators
from pytest_drive_robust.domain.agent import computing_modules, has_portable_bits
from pytest_drive_robust.domain.route import Route
from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.registry.registry import Registry
from pytest_drive_robust.runner.before_driving import facts_of, sources_of
from pytest_drive_robust.runner.cache_key import distributions, source_files
from pytest_drive_robust.runner.cache_key.canonical_text import canonical_text, digest_of
from pytest_drive_robust.runner.cache_key.code_text import code_of, session
from pytest_drive_robust.runner.cache_key.digests import hex_of
from pytest_drive_robust.runner.cache_key.named_files import file_digests
from pytest_drive_robust.runner.cache_key.weights import weights_digest
from pytest_drive_robust.runner.plan import Scope
from pytest_drive_robust.simulators import embedded
from pytest_drive_robust.simulators.base import Simulator, SimulatorOptions
from pytest_drive_robust.store.events import Identified
from pytest_drive_robust.store.record import FORMAT_VERSION

_DECIDING = tuple(
    f"pytest_drive_robust.{name}"
    for name in (
        *("arithmetic", "jit", "domain", "perturbations", "runner.driver", "runner.episode.loop"),
        *("runner.episode.contract", "runner.episode.surroundings"),
        *("runner.episode.watch", "runner.episode.witness", "runner.episode.world_contract"),
        *("runner.episode.generators", "runner.episode.after_import"),
        *("simulators.base", "simulators.criteria", "simulators.infractions"),
    )
)
"""Our modules that decide the numbers of every episode, by name: a run from the store does not import them.

The package of the simulator is added to these.
"""
_LOCKSTEP = "pytest_drive_robust.runner.lockstep.batch"

_DEVELOPMENT = re.compile(r"(\.dev\d+)?(\+\S+)?\Z")


def identify(scope: Scope, registry: Registry) -> Identified:
    """Return the digests of a scope's agent and routes. Raises `UsageError` for weights that cannot be read."""
    entry = registry.entry("agents", scope.agent)
    factory = entry.load()
    return Identified(
        agent=scope.agent,
        distribution=entry.origin,
        source=source_files.source_digest(factory),
        weights=weights_digest(factory, agent=scope.agent),
        routes=tuple(f"{route.id}={route_digest(route)}" for route in scope.routes),
    )


def identity_of(
    agent: str, registry: Registry, *, simulator: str, world: Simulator, options: SimulatorOptions, mode: str = "single"
) -> str:
    """Return a digest of everything but route, setting and seed that decides how an episode ends, 32 hex digits.

    `world` is an undriven world of `simulator`; `mode` is `"single"` or `"lockstep"`. Unknown code gives an identity
    that holds for this session only. Raises `UsageError` for weights or a configuration that cannot be read.
    """
    driving = source_files.code_digest((_LOCKSTEP,)) if mode == "lockstep" else ""
    world_digest = simulator_identity(simulator, registry, world, options)
    return digest_of(agent_identity(agent, registry), world_digest, mode, driving)


def agent_identity(agent: str, registry: Registry) -> str:
    """Return a digest of an agent, 32 hex digits.

    The digest covers its name, distribution, code, weights, the `configuration` of its factory, and the versions of the
    libraries that decide what it computes (see the table of this module).
    """
    entry = registry.entry("agents", agent)
    factory = entry.load()
    given = getattr(factory, "configuration", None)
    try:
        configuration = canonical_text(given)
    except TypeError as error:
        raise UsageError(
            f"the configuration of the agent {agent!r} is {given!r}, expected plain values that can be compared with "
            f"those of an earlier run (numbers, text, lists, mappings, dataclasses): {error}."
        ) from None
    weights = weights_digest(factory, agent=agent)
    modules = computing_modules(factory)
    code, versions = code_of(factory, libraries=modules is None), distributions.versions_of(modules) if modules else {}
    # Not the place of a hook, nor the commit in "agents 1.3.dev5+g1a2b3c4": the code itself counts.
    distribution = "" if entry.registered else _DEVELOPMENT.sub("", entry.origin)
    return digest_of(agent, distribution, code, weights, configuration, versions)


def simulator_identity(name: str, registry: Registry, world: Simulator, options: SimulatorOptions) -> str:
    """Return a digest of a world, 32 hex digits: its name, version, libraries, options and code, and our own code.

    The `sources` of a world name further modules whose code counts, such as an environment's, and `files` name files
    whose content counts. The version of Python does not count for a world with `portable_bits`. Raises `UsageError` for
    a part that cannot be read or compared.
    """
    factory = registry.entry("simulators", name).load()
    others = [_source_of(module) for module in sources_of(world)]
    others += file_digests(world)
    facts = (FORMAT_VERSION, name, *facts_of(world), options)
    place = f"{getattr(factory, '__module__', '')}."
    # A world that is not `embedded` may use its sensors and criteria, so the whole package counts.
    ours = source_files.code_digest((*_DECIDING, embedded if place.startswith(f"{embedded.__name__}.") else simulators))
    own = "" if place.startswith(f"{simulators.__name__}.") else code_of(factory)
    return digest_of(facts, {} if has_portable_bits(world) else distributions.versions_of(()), ours, own, others)


def _source_of(module: ModuleType) -> str:
    try:
        return source_files.module_digest(source_files.file_of(module), module.__name__)
    except source_files.UnknownSourceError as error:
        return f"session {session()} {error}"


def route_digest(route: Route) -> str:
    """Return a digest of the whole route, 12 hex digits."""
    return hex_of(repr(route).encode())
