"""Collect data by drives of the expert: `python -m drive_robust_agents.training collect --agent tcp --out FOLDER`.

The written data depends only on the arguments, not on the number of workers or on interruptions: complete shards are
skipped, incomplete shards are written again.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

from drive_robust_agents.training.data.dagger import Mixture, agent_of, weights_digest
from drive_robust_agents.training.data.expert_episode import Teacher
from drive_robust_agents.training.data.frames import read_done, shard_name, shard_numbers
from drive_robust_agents.training.data.pool import written
from drive_robust_agents.training.data.rigs import agent_rig
from drive_robust_agents.training.data.routes import training_keys
from drive_robust_agents.training.data.shards import Shard, WrittenShard
from drive_robust_agents.training.prerequisites import require_packages
from pytest_drive_robust import Setting
from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.regression.shape import misfit_of
from pytest_drive_robust.simulators.embedded import EmbeddedSimulator
from pytest_drive_robust.store.whole_file import write_whole

__all__ = [
    "Collected", "Collection", "add_arguments", "check_frames", "collect", "collection_of", "draws_of", "run",
]  # fmt: skip

_ASKED = "collect.json"
_GROWS = ("per_type", "routes")
"""Fields that may grow in a later run, which appends routes to a folder."""
_MOST_S = 5.0
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
"""The schema of a collection's file: the fields of `Collection`, and what `_claim` adds and later calls read."""
_DRAWS = (
    "route_seed", "data_seed", "per_type", "routes", "episodes", "types", "settings", "room_s", "halt_s", "simulator",
)  # fmt: skip


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


@dataclass(frozen=True, slots=True)
class Collected:
    """The present content of a collection's folder."""

    rows: int
    shards: int


def collect(collection: Collection, out: Path, *, workers: int = 1, progress: bool = True) -> Collected:
    """Collect into a folder, continuing after an earlier run; return the content of the folder.

    One worker runs in this process. Raises `UsageError` for an impossible collection, and for a folder with another
    collection.
    """
    collection.check()
    if workers < 1:
        raise UsageError(f"--workers is {workers}, expected at least 1.")
    _claim(collection, out)
    shards = collection.shards(out)
    done = {shard.number: found for shard in shards if (found := _done(shard)) is not None}
    rows, left = sum(int(found["rows"]) for found in done.values()), [s for s in shards if s.number not in done]
    with _Bar(len(shards), len(done), shown=progress) as bar:
        for one in written(left, workers):
            rows += one.rows
            bar.add(one)
    return Collected(rows, len(shards))


def _done(shard: Shard) -> dict[str, Any] | None:
    """Return the content of `done.json` of a complete shard with these routes, else None."""
    found = read_done(shard.folder, shard.number)
    return found if found is not None and found["routes"] == [key.id for key in shard.keys] else None


def _claim(collection: Collection, out: Path) -> None:
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


class _Bar:
    """A progress bar of shards, frames per second and the remaining time."""

    def __init__(self, shards: int, done: int, *, shown: bool) -> None:
        from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

        self._progress = Progress(
            TextColumn("collect"), BarColumn(), MofNCompleteColumn(), TextColumn("shards"),
            TextColumn("{task.fields[rows]} frames, {task.fields[rate]:.0f}/s, {task.fields[mib]:.0f} MiB"),
            TimeRemainingColumn(), disable=not shown,
        )  # fmt: skip
        self._task = self._progress.add_task("", total=shards, completed=done, rows=0, rate=0.0, mib=0.0)
        self._rows = self._bytes = 0

    def __enter__(self) -> _Bar:
        self._progress.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._progress.stop()

    def add(self, written: WrittenShard) -> None:
        """Count one more shard."""
        self._rows += written.rows
        self._bytes += written.size_bytes
        seconds = self._progress.tasks[0].elapsed or 1.0
        self._progress.update(
            self._task, advance=1, rows=self._rows, rate=self._rows / seconds, mib=self._bytes / 2**20
        )


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `collect`."""
    parser.add_argument("--agent", required=True, help="whose cameras: tcp, uniad, vad or simlingo")
    parser.add_argument("--out", type=Path, required=True, help="folder of the data; goes on where it stopped")
    parser.add_argument("--route-seed", type=int, default=1, help="seed of the route generator, never 0")
    parser.add_argument("--per-type", type=int, default=20, help="routes of each of the 44 scenario types")
    parser.add_argument("--types", nargs="+", default=[], metavar="TYPE", help="only these scenario types")
    parser.add_argument("--routes", type=int, default=None, help="only the first so many of them")
    parser.add_argument("--episodes", type=int, default=1, help="episodes of each route, each with its own seed")
    parser.add_argument("--seed", type=int, default=0, dest="data_seed", help="names all draws of noise and poses")
    parser.add_argument("--shard-routes", type=int, default=4, help="routes in a shard")
    parser.add_argument("--workers", type=int, default=1, help="processes")
    parser.add_argument("--dagger", default=None, metavar="WEIGHTS_OR_AGENT", help="an agent that shares the driving")
    parser.add_argument("--beta", type=float, default=0.5, help="with --dagger: the expert's share of the time")
    parser.add_argument(
        "--room", type=float, default=0.0, dest="room_s", help="seconds more that the expert leaves others"
    )
    parser.add_argument("--halt", type=float, default=0.0, dest="halt_s", help="seconds that it stands at a stop sign")
    parser.add_argument(
        "--settings", nargs="+", default=[], metavar="SETTING",
        help='with --dagger: each episode is under one of these, such as "GPS noise 15 m" or clean',
    )  # fmt: skip


def collection_of(given: argparse.Namespace) -> Collection:
    """Return the `Collection` of the options."""
    values = {field.name: getattr(given, field.name) for field in fields(Collection)}
    return Collection(**values | {"types": tuple(given.types), "settings": tuple(given.settings)})


def run(given: argparse.Namespace) -> int:
    """Collect as the options say; return the exit code, 130 when interrupted. Raises `UsageError`."""
    require_packages("rich")
    try:
        found = collect(collection_of(given), given.out, workers=given.workers)
    except KeyboardInterrupt:
        print(f"stopped; the same command goes on with what {given.out} holds")
        return 130
    print(f"{given.out}: {found.rows} frames in {found.shards} shards")
    return 0
