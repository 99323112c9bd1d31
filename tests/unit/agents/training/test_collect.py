"""Collecting: the same bytes with any number of workers and after any number of interruptions."""

from __future__ import annotations

import json
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest
from training_drives import data_seed, key_of, route_of, samples_of

from drive_robust_agents._nets.manifest import WeightsEntry, write_entry
from drive_robust_agents.expert import Expert
from drive_robust_agents.training import collect as collect_module
from drive_robust_agents.training.__main__ import main
from drive_robust_agents.training.collect import collect
from drive_robust_agents.training.data import collection as collection_module
from drive_robust_agents.training.data import collection_file
from drive_robust_agents.training.data.collection import Collection
from drive_robust_agents.training.data.collection_file import check_frames, draws_of
from drive_robust_agents.training.data.expert_episode import Teacher
from drive_robust_agents.training.data.frames import Frames
from drive_robust_agents.training.data.pool import written
from drive_robust_agents.training.data.rigs import agent_rig
from drive_robust_agents.training.data.rollouts import ON_WAY
from drive_robust_agents.training.data.rows import rows
from drive_robust_agents.training.data.shards import Shard
from pytest_drive_robust import CameraSpec
from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.perturbations import Setting
from pytest_drive_robust.runner.episode.loop import drive_episode
from pytest_drive_robust.runner.episode.watch import Watch
from pytest_drive_robust.simulators.embedded import EmbeddedSimulator

WAY = "ControlLoss"


def content(folder: Path) -> dict[str, bytes]:
    return {str(file.relative_to(folder)): file.read_bytes() for file in sorted(folder.rglob("*")) if file.is_file()}


def shards(folder: Path) -> list[Shard]:
    """Two shards of a short route each."""
    return [Shard(folder, k, (key_of(WAY, k),), k, "tcp", 1, 0) for k in range(2)]


@pytest.fixture(scope="module")
def collected(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Written by two processes."""
    folder = tmp_path_factory.mktemp("frames")
    assert {one.number for one in written(shards(folder), 2)} == {0, 1}
    return folder


def test_one_process_writes_what_two_have_written_over_what_an_interruption_left(
    collected: Path, tmp_path: Path
) -> None:
    broken = tmp_path / ".shard-00001.part"
    broken.mkdir()
    (broken / "speed.npy").write_bytes(b"half")
    found = list(written(shards(tmp_path), 1))
    assert [one.number for one in found] == [0, 1]
    assert content(tmp_path) == content(collected)
    done = json.loads((tmp_path / "shard-00001" / "done.json").read_text())
    assert done["routes"] == [key_of(WAY, 1).id]
    assert done["rows"] == found[1].rows == len(np.load(tmp_path / "shard-00001" / "speed.npy"))


def test_pictures_are_what_the_agent_is_given_at_that_tick() -> None:
    cameras = agent_rig("tcp").cameras

    class Looking(Expert):
        """The expert, with the cameras of the learner."""

        def sensors(self) -> tuple[CameraSpec, ...]:
            return cameras

    route, given = route_of(WAY), {}

    class Seeing(Watch):
        def ticked(self, tick: int, state: object, observation: object, asked: object, applied: object) -> None:
            given[tick] = observation.cameras["front"].pixels.copy()

    drive_episode(
        EmbeddedSimulator(), Looking(), route=route, setting=Setting.CLEAN, seed=0, agent_name="x", watch=Seeing()
    )
    samples = samples_of(WAY)
    assert data_seed(route, noisy=False) >= 0
    compared = 0
    for row in rows(samples, route, agent_rig("tcp"), tag=0, episode=0):
        if row["source"] == ON_WAY:
            assert np.array_equal(row["cam_front"], given[int(row["tick"])])
            compared += 1
    assert compared > 20


def fake_write(monkeypatch: pytest.MonkeyPatch) -> list[tuple[str, ...]]:
    """Shards without a drive; the ids of the routes of each that is asked for."""
    from drive_robust_agents.training.data.frames import write_shard
    from drive_robust_agents.training.data.shards import WrittenShard

    asked = []

    def driven(left: list[Shard], workers: int):
        for shard in left:
            ids = [key.id for key in shard.keys]
            asked.append(tuple(ids))
            about = {"routes": ids, "seed": 0, "skipped": []}
            rows_ = [{"speed": np.float32(1.0)}]
            yield WrittenShard(shard.number, 1, write_shard(shard.folder, shard.number, rows_, about))

    monkeypatch.setattr(collect_module, "written", driven)
    return asked


def test_a_teacher_of_its_own_is_noted_and_data_from_before_there_was_one_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    fake_write(monkeypatch)
    collect(Collection("tcp", routes=2, room_s=1.0, halt_s=0.5), tmp_path / "calm", progress=False)
    assert {name: draws_of(tmp_path / "calm")[name] for name in ("room_s", "halt_s")} == {"room_s": 1.0, "halt_s": 0.5}
    with pytest.raises(UsageError, match=r"room_s: 1.0 there, 0.0 now"):
        collect(Collection("tcp", routes=2, halt_s=0.5), tmp_path / "calm", progress=False)
    collect(Collection("tcp", routes=2), tmp_path / "old", progress=False)
    asked = json.loads((tmp_path / "old" / "collect.json").read_text())
    del asked["room_s"], asked["halt_s"]
    (tmp_path / "old" / "collect.json").write_text(json.dumps(asked))
    assert collect(Collection("tcp", routes=2), tmp_path / "old", progress=False).rows == 1


@pytest.mark.parametrize("option", ["--room", "--halt"])
def test_a_teacher_that_waits_for_ever_is_refused(option: str, tmp_path: Path, capsys) -> None:
    with pytest.raises(SystemExit) as caught:
        main(["collect", "--agent", "tcp", "--out", str(tmp_path / "frames"), option, "-1"])
    assert caught.value.code == 4
    assert f"{option} is -1.0, expected 0 to 5 seconds." in capsys.readouterr().err
    assert not (tmp_path / "frames").exists()


def test_the_teacher_drives_and_labels_with_its_room_and_halt(tmp_path: Path) -> None:
    made = []
    for teacher in (Teacher(), Teacher(room_s=1.0, halt_s=1.0)):
        key = key_of("VanillaNonSignalizedTurnEncounterStopsign")
        shard = Shard(tmp_path / str(teacher.halt_s), 0, (key,), 0, "tcp", 1, 0, teacher=teacher)
        assert list(written([shard], 1))
        made.append(np.load(shard.folder / "shard-00000" / "future.npy"))
    stands = [int((np.hypot(future[:, 3, 0], future[:, 3, 1]) < 0.1).sum()) for future in made]
    assert stands[0] < stands[1]


def test_shards_that_are_complete_are_not_driven_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    asked = fake_write(monkeypatch)
    collection = Collection("tcp", routes=6, shard_routes=2)
    assert collect(collection, tmp_path, progress=False).rows == 3
    (tmp_path / "shard-00001" / "done.json").unlink()
    asked.clear()
    assert collect(collection, tmp_path, progress=False).rows == 3
    assert asked == [("1-301", "1-401")]


def test_more_routes_are_added_to_those_that_are_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    asked = fake_write(monkeypatch)
    collect(Collection("tcp", routes=3, shard_routes=2), tmp_path, progress=False)
    asked.clear()
    assert collect(Collection("tcp", routes=6, shard_routes=2), tmp_path, progress=False).shards == 3
    assert asked == [("1-301", "1-401"), ("1-501", "1-601")]  # the shard of one route was not whole


def test_fewer_shards_than_the_folder_holds_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    fake_write(monkeypatch)
    collect(Collection("tcp", routes=6, shard_routes=2), tmp_path, progress=False)
    with pytest.raises(UsageError, match=r"holds shard-00002, and the routes asked for end with shard-00001"):
        collect(Collection("tcp", routes=4, shard_routes=2), tmp_path, progress=False)
    assert draws_of(tmp_path)["routes"] == 6
    assert collect(Collection("tcp", routes=5, shard_routes=2), tmp_path, progress=False).shards == 3
    assert len(Frames(tmp_path)) == 3


def test_a_folder_with_other_data_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    fake_write(monkeypatch)
    collect(Collection("tcp", routes=1), tmp_path, progress=False)
    with pytest.raises(UsageError, match=r"holds other data \(data_seed: 0 there, 5 now\)"):
        collect(Collection("tcp", routes=1, data_seed=5), tmp_path, progress=False)
    other = tmp_path / "other"
    other.mkdir()
    (other / "letter.txt").write_text("mine")
    with pytest.raises(UsageError, match=r"is not empty and holds no collect\.json"):
        collect(Collection("tcp", routes=1), other, progress=False)


def test_other_weights_under_the_same_path_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    fake_write(monkeypatch)
    monkeypatch.setattr(collection_module, "agent_of", lambda _: None)  # what these weights hold is no network
    file, out = tmp_path / "weights" / "tcp.safetensors", tmp_path / "frames"
    file.parent.mkdir()

    def put(sha256: str, version: str) -> None:
        write_entry(file.parent, WeightsEntry("tcp", version, file.name, sha256, 0, "TcpNet", {}, 0))

    def collected() -> int:
        return collect(Collection("tcp", routes=1, dagger=f"{file}+tuning=ours"), out, progress=False).rows

    put("ab", "0.0")
    collected()
    put("ab", "1.0")  # published meanwhile
    assert collected() == 1
    put("cd", "1.0")
    with pytest.raises(UsageError, match=r"holds other data \(dagger_weights: 'ab' there, 'cd' now\)"):
        collected()
    asked = json.loads((out / "collect.json").read_text())
    del asked["dagger_weights"]  # a folder from before this was noted
    (out / "collect.json").write_text(json.dumps(asked))
    assert collected() == 1


def test_data_of_another_world_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    fake_write(monkeypatch)
    collection, old, new = Collection("tcp", routes=1), tmp_path / "old", tmp_path / "new"
    for folder in (old, new):
        collect(collection, folder, progress=False)
    told = json.loads((old / "collect.json").read_text())
    (old / "collect.json").write_text(json.dumps(told | {"simulator": "2"}))
    now = EmbeddedSimulator.version
    with pytest.raises(UsageError, match=rf"holds other data \(simulator: '2' there, '{now}' now\)"):
        collect(collection, old, progress=False)
    with pytest.raises(UsageError, match=rf"old was collected in embedded 2, and the world is embedded {now} now"):
        check_frames([new, old], "tcp")
    check_frames([new, tmp_path], "tcp")  # frames of no collection are somebody's own


DAMAGED = [
    (b'{"agent": "tcp", "beta', "it is not valid JSON: "),
    (b"\xff\xfe", "it is not valid JSON: 'utf-8' codec can't decode"),
    (b"[" * 100_000, "it is not valid JSON: "),
    (b"[1, 2]", "the document must be object, not [1, 2]"),
    (b"{}", "the document lacks 'agent'"),
    (b'{"agent": "tcp", "beta": 0.5, "dagger": null, "per_type": "many"}', 'per_type must be integer, not "many"'),
    (b'{"agent": "tcp", "beta": 0.5, "dagger": null, "episodes": 2.0}', "episodes must be integer, not 2.0"),
    (b'{"agent": "tcp", "beta": 0.5, "dagger": null, "shard_routes": 0}', "shard_routes must be bigger than or equal"),
    (b'{"agent": "tcp", "beta": 0.5, "dagger": null, "settings": [5]}', "settings[0] must be string, not 5"),
    (b'{"agent": "tcp", "beta": 0.5, "dagger": null, "cameras": [3]}', "cameras[0] must be object, not 3"),
]


def test_every_field_of_a_collection_is_looked_at_where_its_file_is_read() -> None:
    assert {field.name for field in fields(Collection)} <= collection_file._SHAPE["properties"].keys()


@pytest.mark.parametrize(("content", "wrong"), DAMAGED, ids=[wrong for _, wrong in DAMAGED])
def test_a_damaged_definition_of_the_data_is_named_with_what_to_do(
    content: bytes, wrong: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "collect.json").write_bytes(content)
    with pytest.raises(SystemExit) as ended:
        main(["collect", "--agent", "tcp", "--out", str(tmp_path)])
    assert ended.value.code == 4
    said = capsys.readouterr().err
    assert said.startswith(f"{tmp_path / 'collect.json'} is damaged: {wrong}")
    assert said.endswith("put back a copy of it, or collect into a new folder.\n")
    for check in (draws_of, lambda folder: check_frames([folder], "tcp")):
        with pytest.raises(UsageError, match="is damaged"):
            check(tmp_path)


def test_pictures_of_other_cameras_are_not_trained_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    fake_write(monkeypatch)
    folder = tmp_path / "bev"
    collect(Collection("vad", routes=1), folder, progress=False)
    for agent in ("vad", "uniad", "tcp"):  # the three front cameras of `vad` are those of `tcp`
        check_frames([folder], agent)
    check_frames([tmp_path], "simlingo")  # frames of no collection are somebody's own
    said = r"bev was collected for 'vad', whose cameras are not those of 'simlingo': front\. Collect for"
    with pytest.raises(UsageError, match=said):
        check_frames([tmp_path, folder], "simlingo")


def test_data_that_was_broken_off_is_not_trained_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    fake_write(monkeypatch)
    collect(Collection("tcp", routes=6, shard_routes=2, types=("Accident",)), tmp_path, progress=False)
    check_frames([tmp_path], "tcp")
    (tmp_path / "shard-00002" / "done.json").unlink()
    with pytest.raises(UsageError, match=r"holds 2 of the 3 shards that were asked for\. The same `collect`"):
        check_frames([tmp_path], "tcp")
    collect(Collection("tcp", routes=4, shard_routes=2, types=("Accident",)), tmp_path, progress=False)
    check_frames([tmp_path, tmp_path / "frames of no collection"], "tcp")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--agent", "tpc"], "Did you mean 'tcp'"),
        (["--agent", "tcp", "--route-seed", "0"], "route seed 0 draws no training routes"),
        (["--agent", "tcp", "--per-type", "0"], "expected 1 to 99"),
        (["--agent", "tcp", "--routes", "0"], "--routes is 0, expected at least 1"),
        (["--agent", "tcp", "--episodes", "0"], "--episodes is 0, expected at least 1"),
        (["--agent", "tcp", "--shard-routes", "0"], "--shard-routes is 0, expected at least 1"),
        (["--agent", "tcp", "--workers", "0"], "--workers is 0, expected at least 1"),
        (["--agent", "tcp", "--beta", "1.5"], "--beta is 1.5, expected the expert's share"),
        (["--agent", "tcp", "--dagger", "reactiv"], "Did you mean 'reactive'"),
        (["--agent", "tcp", "--dagger", "reactive", "--settings", "GPS nois 15 m"], "GPS noise"),
        (["--agent", "tcp", "--settings", "clean"], "--settings are for the agent of --dagger, which is lacking"),
    ],
)
def test_what_cannot_be_collected_is_said_before_anything_is_written(
    arguments: list[str], message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["collect", *arguments, "--out", str(tmp_path / "frames")])
    assert ended.value.code == 4
    assert message in capsys.readouterr().err
    assert not (tmp_path / "frames").exists()


def test_an_interrupted_run_says_how_to_go_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def interrupted(left: list[Shard], workers: int):
        yield from ()
        raise KeyboardInterrupt

    monkeypatch.setattr(collect_module, "written", interrupted)
    assert main(["collect", "--agent", "tcp", "--out", str(tmp_path / "frames")]) == 130
    assert "the same command goes on" in capsys.readouterr().out
