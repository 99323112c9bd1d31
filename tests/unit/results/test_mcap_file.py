"""`drive-robust export --format mcap`: what Foxglove opens."""

from __future__ import annotations

import json
import math
import sys
from itertools import pairwise

import numpy as np
import pytest

from pytest_drive_robust.cli.main import main
from pytest_drive_robust.results import read_run
from pytest_drive_robust.verdict.infraction_words import infraction_words

pytestmark = pytest.mark.slow
NAMES = ("clean", "perturbed")
OF_EACH = ("ego", "actors", "location", "told", "state", "log")


@pytest.fixture
def opened(project, tmp_path):
    """Return the messages of the one file by topic: (seconds, message)."""
    pytest.importorskip("mcap", reason="mcap is not installed: pip install -e '.[mcap]'")
    pytest.importorskip("foxglove_schemas_protobuf", reason="Foxglove's schemas are not installed")
    from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
    from mcap.reader import make_reader

    assert main(["export", "one", str(tmp_path), "--format", "mcap"]) == 0
    (path,) = tmp_path.glob("*.mcap")
    assert path.name == "3901-VanillaSignalizedTurnEncounterGreenLight-GPS-noise-15-m-blind-seed-0.mcap"
    found, classes = {}, {}
    with path.open("rb") as file:
        for schema, channel, message in make_reader(file).iter_messages():
            if schema.encoding == "protobuf" and schema.name not in classes:
                pool = descriptor_pool.DescriptorPool()  # as Foxglove does it: from the file alone
                for described in descriptor_pb2.FileDescriptorSet.FromString(schema.data).file:
                    pool.Add(described)
                classes[schema.name] = message_factory.GetMessageClass(pool.FindMessageTypeByName(schema.name))
            read = json.loads if schema.encoding == "jsonschema" else classes[schema.name].FromString
            found.setdefault(channel.topic, []).append((message.log_time / 1e9, read(message.data)))
    return found


def test_both_episodes_lie_side_by_side_on_one_time_axis(opened):
    assert set(opened) == {"/road", "/tf", *(f"/{name}/{topic}" for name in NAMES for topic in OF_EACH)}
    for name, result in zip(NAMES, read_run("one").episodes, strict=True):
        seconds = [second for second, _ in opened[f"/{name}/state"]]
        assert seconds == pytest.approx([(tick + 1) * result.dt_s for tick in range(result.ticks)])
        speeds = [state["speed_mps"] for _, state in opened[f"/{name}/state"]]
        assert speeds == result.trace.column("speed_mps").tolist()
    assert opened["/road"][0][0] == 0.0


def test_the_ego_drives_along_the_route_to_the_north_of_what_is_south(opened):
    (route,) = [line for line in opened["/road"][0][1].entities[0].lines if round(line.color.g, 2) == 0.63]
    line = np.array([(point.x, point.y) for point in route.points])
    line = np.concatenate([np.linspace(a, b, 100) for a, b in pairwise(line)])
    (clean, _) = read_run("one").episodes
    places = [m for _, m in opened["/tf"] if m.child_frame_id == "clean"]
    assert len(places) == clean.ticks
    path = np.array([(m.translation.x, m.translation.y) for m in places])
    assert path[:, 1].tolist() == (-clean.trace.column("y_m")).tolist()
    assert np.hypot(*(path[:, None] - line).transpose(2, 0, 1)).min(axis=1).max() < 5.0
    moved = np.diff(path, axis=0)
    yaw = np.array([2.0 * math.atan2(m.rotation.z, m.rotation.w) for m in places])[1:]
    fast = np.hypot(*moved.T) > 0.1
    ahead = (moved * np.column_stack((np.cos(yaw), np.sin(yaw)))).sum(axis=1)
    assert (ahead[fast] > 0.95 * np.hypot(*moved[fast].T)).mean() > 0.95  # not where it is pushed
    assert abs(np.unwrap(yaw)[-1] - yaw[0]) > 1.0  # it does turn


def test_every_message_of_the_actors_is_whole(opened):
    for name, result in zip(NAMES, read_run("one").episodes, strict=True):
        counts = np.zeros(len(result.tracks.lights), int)
        for first, count in result.tracks.actors[:, 4:].tolist():
            counts[first : first + count] += 1
        updates = [update for _, update in opened[f"/{name}/actors"]]
        assert [len(update.entities) - 1 for update in updates] == counts.tolist()
        assert all(update.deletions[0].type == 1 for update in updates)
        assert len(updates[0].entities[0].lines) == result.tracks.lights.shape[1]


def test_infractions_are_told_when_they_happen(opened):
    for name, result in zip(NAMES, read_run("one").episodes, strict=True):
        told = sorted((round(second, 6), log.message) for second, log in opened[f"/{name}/log"] if log.level == 4)
        events = [
            (round(i.tick * result.dt_s, 6), f"{i.kind.value}: {infraction_words(i.detail)}")
            for i in result.infractions
        ]
        assert told == sorted(events)
    assert any(log.level == 4 for _, log in opened["/perturbed/log"])
    assert any("GpsNoise" in log.message or "gps" in log.message for _, log in opened["/perturbed/log"])


def test_what_it_needs_is_named(project, tmp_path, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "mcap.writer", None)
    assert main(["export", "one", str(tmp_path), "--format", "mcap"]) == 4
    assert "pip install 'pytest-drive-robust[mcap]'" in capsys.readouterr().err


def test_episodes_that_are_not_in_the_store_are_missed(project, tmp_path, capsys):
    pytest.importorskip("mcap", reason="mcap is not installed: pip install -e '.[mcap]'")
    assert main(["export", "one", str(tmp_path), "--format", "mcap", "--episodes", str(tmp_path)]) == 4
    assert "none of these episodes is in the store" in capsys.readouterr().err
