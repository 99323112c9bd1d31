"""The file of a folder of data that says what the folder was collected for: `collect.json`."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

from drive_robust_agents.training.data.collection import Collection
from drive_robust_agents.training.data.dagger import weights_digest
from drive_robust_agents.training.data.frames import shard_name, shard_numbers
from drive_robust_agents.training.data.rigs import agent_rig
from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.regression.shape import misfit_of
from pytest_drive_robust.simulators.embedded import EmbeddedSimulator
from pytest_drive_robust.store.whole_file import write_whole

_ASKED = "collect.json"
_GROWS = ("per_type", "routes")
"""Fields that may grow in a later run, which appends routes to a folder."""
_NUMBER, _TEXTS = {"type": "number"}, {"type": "array", "items": {"type": "string"}}
_WHOLE_NUMBER, _SOME = {"type": "integer"}, {"type": "integer", "minimum": 1}
_SHAPE: dict[str, Any] = {
    "$schema": "http://json-schema.org/draft-04/schema#",  # later drafts take 1.0 for a whole number
    "type": "object",
    "required": ["agent", "beta", "dagger"],  # older files lack some of the others
    "properties": {
        "agent": {"type": "string"}, "route_seed": _WHOLE_NUMBER, "per_type": _WHOLE_NUMBER,
        "routes": {"type": ["integer", "null"]}, "episodes": _WHOLE_NUMBER, "data_seed": _WHOLE_NUMBER,
        "shard_routes": _SOME, "dagger": {"type": ["string", "null"]}, "beta": _NUMBER, "types": _TEXTS,
        "settings": _TEXTS, "room_s": _NUMBER, "halt_s": _NUMBER,
        "cameras": {"type": "array", "items": {"type": "object", "required": ["name"]}},
    },
}  # fmt: skip
"""The schema of a collection's file: the fields of `Collection`, and what `claim` adds and later calls read."""
_DRAWS = (
    "route_seed", "data_seed", "per_type", "routes", "episodes", "types", "settings", "room_s", "halt_s", "simulator",
)  # fmt: skip


def claim(collection: Collection, out: Path) -> None:
    """Write the collection's definition to the folder, or check that the folder's definition is equal or smaller."""
    asked: dict[str, Any] = {
        **asdict(collection),
        "types": sorted(collection.types),
        "settings": list(collection.settings),
    }
    asked["simulator"] = EmbeddedSimulator.version
    asked["dagger_weights"] = None if collection.mixture is None else weights_digest(collection.mixture)
    asked["cameras"] = [asdict(camera) for camera in agent_rig(collection.agent).cameras]
    was = _asked_in(out)
    if was:
        unsaid = {"room_s": 0.0, "halt_s": 0.0, "dagger_weights": asked["dagger_weights"]}  # in older folders
        there = {**unsaid, **was}
        other = sorted(name for name in asked if name not in _GROWS and there.get(name) != asked[name])
        if other:
            said = "; ".join(f"{name}: {there.get(name)!r} there, {asked[name]!r} now" for name in other[:3])
            raise UsageError(f"{out} holds other data ({said}). Give another folder, or the same arguments to go on.")
        _require_room(len(collection.shards(out)), out)
    elif out.is_dir() and any(out.iterdir()):
        raise UsageError(f"{out} is not empty and holds no {_ASKED}: give an empty or a new folder.")
    out.mkdir(parents=True, exist_ok=True)
    write_whole(out / _ASKED, json.dumps(asked, indent=1, sort_keys=True) + "\n")


def _require_room(asked: int, out: Path) -> None:
    """Raise `UsageError` for a folder with more shards than asked for, because `train` would read these shards, too."""
    last = max(shard_numbers(out), default=-1)
    if last >= asked:
        raise UsageError(
            f"{out} holds {shard_name(last)}, and the routes asked for end with {shard_name(asked - 1)}: training "
            "would read more than was asked for. Give another folder, or at least as many routes as before."
        )


def _asked_in(folder: Path) -> dict[str, Any]:
    """Return what a folder was collected for; empty for frames of another origin.

    Raises `UsageError` for a damaged file: without it nobody knows what the shards beside it hold.
    """
    file = folder / _ASKED
    if not file.is_file():
        return {}
    try:
        asked = json.loads(file.read_text(encoding="utf-8"))
        wrong = misfit_of(asked, _SHAPE)
    except (ValueError, RecursionError) as error:
        wrong = f"it is not valid JSON: {error}"
    if wrong:
        raise UsageError(
            f"{file} is damaged: {wrong}. It says what the shards beside it hold: put back a copy of it, or collect "
            "into a new folder."
        )
    return dict(asked)


def draws_of(folder: Path) -> dict[str, Any]:
    """Return the draws of routes and moments in a folder, for a manifest; empty for frames of another origin.

    `expert_share` is below 1 when an agent drove, too. The agent's name is left out, because its weights are a private
    file.
    """
    asked = _asked_in(folder)
    if not asked:
        return {}
    drawn = {name: asked[name] for name in _DRAWS if name in asked}
    return {**drawn, "expert_share": asked["beta"] if asked["dagger"] else 1.0}


def check_frames(folders: Sequence[Path], agent: str) -> None:
    """Raise `UsageError` for data that `agent` cannot be trained on; frames of no collection pass.

    That is data from another version of the world or of other cameras, and a collection that was broken off.
    """
    for folder in folders:
        asked = _asked_in(folder)
        if asked:
            _check_world(folder, asked)
            _check_cameras(folder, asked, agent)
            _check_complete(folder, asked)


def _check_world(folder: Path, asked: Mapping[str, Any]) -> None:
    world = asked.get("simulator", EmbeddedSimulator.version)
    if world != EmbeddedSimulator.version:
        raise UsageError(
            f"{folder} was collected in embedded {world}, and the world is embedded {EmbeddedSimulator.version} "
            "now: its car moves otherwise. Collect into a new folder."
        )


def _check_cameras(folder: Path, asked: Mapping[str, Any], agent: str) -> None:
    there = {camera["name"]: camera for camera in asked.get("cameras", ())}
    other = [one.name for one in agent_rig(agent).cameras if there.get(one.name) != asdict(one)]
    if there and other:
        raise UsageError(
            f"{folder} was collected for {asked['agent']!r}, whose cameras are not those of {agent!r}: "
            f"{', '.join(other)}. Collect for {agent!r} into a new folder."
        )


def _check_complete(folder: Path, asked: Mapping[str, Any]) -> None:
    known = {field.name: asked[field.name] for field in fields(Collection) if field.name in asked}
    shards = len(Collection(**known).shards(folder))
    there = sum(number < shards for number in shard_numbers(folder))
    if there < shards:
        raise UsageError(
            f"{folder} holds {there} of the {shards} shards that were asked for. The same `collect` command goes "
            "on; with fewer --routes it asks for no more than there is."
        )
