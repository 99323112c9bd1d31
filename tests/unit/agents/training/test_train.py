"""`python -m drive_robust_agents.training`: from frames to candidates, to a choice in closed loop, to what ships."""

# ruff: noqa: E402 - without torch, which is an extra, these tests are skipped before the imports that need it

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest

torch = pytest.importorskip("torch")
from frames_on_disk import write_frames
from result_factory import make_result

import drive_robust_agents.tcp
from drive_robust_agents._nets.manifest import read_manifest
from drive_robust_agents._nets.tcp import TcpNet
from drive_robust_agents._nets.torch_weights import load
from drive_robust_agents.training import evaluate as evaluating
from drive_robust_agents.training.__main__ import main
from drive_robust_agents.training.candidates import candidate, candidate_name
from drive_robust_agents.training.data.rigs import TRAINING_RIGS
from drive_robust_agents.training.recipes.tcp import TcpRecipe
from pytest_drive_robust.domain.route import Route
from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.simulators.embedded.route_xml import save_routes
from pytest_drive_robust.testing import fake_route

RIG = ["front_left", "front", "front_right"]
FAKE = "pytest_drive_robust.testing:FakeSimulator"


@pytest.fixture(scope="module")
def frames(tmp_path_factory: pytest.TempPathFactory) -> Path:
    cameras = dict.fromkeys(RIG, (96, 160))
    return write_frames(tmp_path_factory.mktemp("frames"), rows=48, cameras=cameras, episodes=6)


@pytest.fixture(scope="module")
def run(frames: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A finished training of the network that ships, five steps long."""
    folder = tmp_path_factory.mktemp("run")
    arguments = ["--frames", str(frames), "--run", str(folder), "--batch", "8", "--visits", "40"]
    assert main(["train", "--agent", "tcp", *arguments]) == 0
    return folder


def refused(capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    with pytest.raises(SystemExit) as left:
        main(list(arguments))
    assert left.value.code == 4
    return " ".join(capsys.readouterr().err.split())


def evaluation(run: Path, best: int) -> dict[str, Any]:
    files = sorted(path.relative_to(run) for path in run.glob("weights/*/tcp.safetensors"))
    scored = [{"file": str(file), "driving_score": 10.0 * k, "episodes": 1} for k, file in enumerate(files)]
    return {"agent": "tcp", "routes": "held-out", "best": best, "candidates": scored}


def test_training_leaves_candidates_that_load_and_a_log(run: Path) -> None:
    steps = [int(path.parent.name) for path in sorted(run.glob("weights/*/tcp.safetensors"))]
    assert steps == [3, 4, 5]
    _, entry = load("tcp", TcpNet.build, weights=run / "weights" / "000000005" / "tcp.safetensors")
    assert entry.parameters == 1_288_209
    assert entry.size_bytes < 6_000_000
    assert entry.provenance["trainer"]["batch"] == 8
    assert [json.loads(line)["step"] for line in (run / "log.jsonl").read_text().splitlines()][-1] == 5


def test_the_same_command_has_nothing_left_to_do(run: Path, frames: Path) -> None:
    before = {path: path.read_bytes() for path in run.glob("weights/*/*")}
    arguments = ["--frames", str(frames), "--run", str(run), "--batch", "8", "--visits", "40"]
    assert main(["train", "--agent", "tcp", *arguments]) == 0
    assert {path: path.read_bytes() for path in run.glob("weights/*/*")} == before


def test_a_training_goes_on_with_the_frames_that_it_began_with(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    cameras = dict.fromkeys(RIG, (96, 160))
    frames = write_frames(tmp_path / "frames", rows=16, cameras=cameras, episodes=4)
    begin = ["train", "--agent", "tcp", "--frames", str(frames), "--run", str(tmp_path / "run"), "--batch", "4"]
    assert main([*begin, "--visits", "4"]) == 0
    write_frames(tmp_path / "more", rows=4, cameras=cameras, episodes=1, shards=1)
    (tmp_path / "more" / "shard-00000").rename(frames / "shard-00002")
    assert "holds another training (rows: 16 there, 20 now)" in refused(capsys, *begin, "--visits", "4")
    settings = tmp_path / "run" / "settings.json"
    noted = json.loads(settings.read_text())
    del noted["rows"]  # of a run from before they were noted
    settings.write_text(json.dumps(noted))
    assert main([*begin, "--visits", "4"]) == 0


def test_a_time_to_train_becomes_a_number_of_steps_that_stays(frames: Path, tmp_path: Path) -> None:
    arguments = ["--frames", str(frames), "--run", str(tmp_path), "--batch", "8", "--minutes", "0.0001"]
    for _ in range(2):
        assert main(["train", "--agent", "tcp", *arguments]) == 0
    assert json.loads((tmp_path / "settings.json").read_text())["steps"] == 6


def test_a_time_to_train_is_reckoned_in_the_precision_of_the_training(
    frames: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    mixed, loss = [], TcpRecipe.loss

    def noted(*given: Any) -> Any:
        if torch.is_grad_enabled():
            mixed.append(torch.is_autocast_enabled("cpu"))
        return loss(*given)

    monkeypatch.setattr(TcpRecipe, "loss", noted)
    arguments = ["--frames", str(frames), "--run", str(tmp_path), "--batch", "8", "--minutes", "0.0001"]
    assert main(["train", "--agent", "tcp", *arguments, "--dtype", "bfloat16"]) == 0
    assert len(mixed) == 8 + 6  # timed, then trained
    assert all(mixed)


def test_training_may_begin_with_published_weights(run: Path, frames: Path, tmp_path: Path) -> None:
    start = run / "weights" / "000000005" / "tcp.safetensors"
    arguments = ["--frames", str(frames), "--run", str(tmp_path), "--batch", "8", "--visits", "8", "--lr", "1e-9"]
    assert main(["train", "--agent", "tcp", "--start", str(start), "--robust", *arguments]) == 0
    old, _ = load("tcp", TcpNet.build, weights=start)
    new, entry = load("tcp", TcpNet.build, weights=tmp_path / "weights" / "000000001" / "tcp.safetensors")
    assert (old.pooled.weight - new.pooled.weight).abs().max() < 1e-3
    assert entry.provenance["trainer"]["start"].startswith("tcp@0.0:")
    assert entry.provenance["trainer"]["robust"] is True


def test_the_best_of_the_evaluated_candidates_is_published_with_its_score(run: Path, tmp_path: Path) -> None:
    (run / "evaluation.json").write_text(json.dumps(evaluation(run, best=1)))
    arguments = ["--run", str(run), "--version", "1.0", "--to", str(tmp_path), "--note", "one core"]
    assert main(["publish", "--agent", "tcp", *arguments]) == 0
    entry = read_manifest(tmp_path, "tcp")
    chosen = read_manifest(run / "weights" / "000000004", "tcp")
    assert (entry.version, entry.sha256) == ("1.0", chosen.sha256)
    assert entry.provenance["score"] == {"driving_score": 10.0, "episodes": 1, "routes": "held-out"}
    assert entry.provenance["note"] == "one core"
    assert [camera["name"] for camera in entry.provenance["rig"]] == RIG
    assert (tmp_path / "tcp.safetensors").read_bytes() == (
        run / "weights" / "000000004" / "tcp.safetensors"
    ).read_bytes()


def test_changed_candidates_are_not_published(run: Path, tmp_path: Path) -> None:
    copied = tmp_path / "run" / "weights" / "000000005"
    copied.mkdir(parents=True)
    for file in (run / "weights" / "000000005").iterdir():
        (copied / file.name).write_bytes(file.read_bytes())
    content = bytearray((copied / "tcp.safetensors").read_bytes())
    content[-1] ^= 1
    (copied / "tcp.safetensors").write_bytes(content)
    scored = {**evaluation(run, best=0), "candidates": [{"file": "weights/000000005/tcp.safetensors"}]}
    (tmp_path / "run" / "evaluation.json").write_text(json.dumps(scored))
    with pytest.raises(SystemExit):
        main(["publish", "--agent", "tcp", "--run", str(tmp_path / "run"), "--version", "1.0", "--to", str(tmp_path)])
    assert not (tmp_path / "manifest.json").exists()


def test_what_cannot_be_used_is_said_with_exit_code_four(
    tmp_path: Path, frames: Path, run: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    train = ["train", "--agent", "tcp", "--run", str(tmp_path)]
    assert "no complete shards" in refused(capsys, *train, "--frames", str(tmp_path))
    assert "do not fill a batch of 4096" in refused(capsys, *train, "--frames", str(frames), "--batch", "4096")
    for option in ("--visits", "--epochs", "--minutes", "--batch", "--lr", "--threads", "--readers"):
        zero = refused(capsys, *train, "--frames", str(frames), option, "0")
        assert zero.startswith(f"{option} is 0")
        assert "expected a number above 0" in zero
    assert "--epochs is inf" in refused(capsys, *train, "--frames", str(frames), "--epochs", "inf")
    assert "--workers is 0" in refused(capsys, "evaluate", "--agent", "tcp", "--run", str(run), "--workers", "0")
    assert "evaluate the run first" in refused(
        capsys, "publish", "--agent", "tcp", "--run", str(tmp_path), "--version", "1.0"
    )
    assert "holds no weights of 'tcp'" in refused(capsys, "evaluate", "--agent", "tcp", "--run", str(tmp_path))
    if not torch.cuda.is_available():
        assert "sees no CUDA device" in refused(capsys, *train, "--frames", str(frames), "--device", "cuda")


def test_a_place_that_nobody_can_write_to_is_named_before_anything_is_driven(
    run: Path, frames: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "file"
    file.touch()
    monkeypatch.setattr(evaluating, "evaluate", lambda *_, **__: pytest.fail("it drove"))
    written = ["--run", str(run), "--json", str(file / "found.json")]
    assert refused(capsys, "evaluate", "--agent", "tcp", *written).startswith(f"{file}: ")
    collected = ["--routes", "1", "--per-type", "1", "--out", str(file)]
    assert refused(capsys, "collect", "--agent", "tcp", *collected).startswith(f"{file}: ")
    trained = ["--frames", str(frames), "--run", str(file), "--batch", "8", "--visits", "8"]
    assert refused(capsys, "train", "--agent", "tcp", *trained).startswith(f"{file}")


def test_a_candidate_is_the_agent_with_other_weights(run: Path, tmp_path: Path) -> None:
    file = run / "weights" / "000000005" / "tcp.safetensors"
    factory = candidate(candidate_name("tcp", file).partition(":")[2])
    factory.check()
    assert factory.weights == (file, file.with_suffix(".onnx"))
    assert type(factory()) is drive_robust_agents.tcp.TCP
    assert factory().sensors() == TRAINING_RIGS["tcp"].cameras
    with pytest.raises(UsageError, match="expected candidate:AGENT=FILE"):
        candidate(f"tcp={tmp_path / 'nothing.safetensors'}")
    with pytest.raises(UsageError, match="Did you mean 'tcp'"):
        candidate(f"tpc={file}")


def test_a_candidate_takes_the_options_of_its_agent_behind_the_file(run: Path) -> None:
    file = run / "weights" / "000000005" / "tcp.safetensors"
    factory = candidate(f"tcp={file}+tuning=published")
    made = factory()
    assert isinstance(made, drive_robust_agents.tcp.TCP)
    assert (made.tuning, factory.weights[0]) == ("published", file)
    with pytest.raises(UsageError, match=r"no option of the agent 'tcp' named 'tunin'. Did you mean 'tuning'"):
        candidate(f"tcp={file}+tunin=published")
    with pytest.raises(UsageError, match="names two files of weights"):
        candidate(f"tcp={file}+tuning=ours+weights=other.safetensors")


def test_training_refuses_frames_of_another_world(
    frames: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    other = tmp_path / "other"
    other.mkdir()
    (other / "collect.json").write_text(json.dumps({"simulator": "2", "agent": "tcp", "beta": 0.5, "dagger": None}))
    train = ["train", "--agent", "tcp", "--run", str(tmp_path / "run"), "--frames", str(frames), str(other)]
    assert "was collected in embedded 2, and the world is" in refused(capsys, *train)


def test_an_interrupted_evaluation_says_how_to_go_on(
    run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def interrupted(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(evaluating, "drive", interrupted)
    save_routes([fake_route("7", length_m=20.0)], tmp_path / "fake.xml")
    routes = ["--routes", str(tmp_path / "fake.xml"), "--store", str(tmp_path / "store")]
    assert main(["evaluate", "--agent", "tcp", "--run", str(run), *routes]) == 130
    assert "stopped; the same command goes on" in capsys.readouterr().out


def test_latency_with_a_warm_up_is_compared_with_a_clean_drive_that_has_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    scores = {"clean": 100.0, "0 ms latency (reading=released)": 80.0, "200 ms latency (reading=released)": 40.0}

    def driven(agents: Sequence[str], settings: Sequence[str], routes: Sequence[Route], **_: object) -> object:
        ended = {name: [make_result(one.id, completion_pct=scores[name]) for one in routes] for name in settings}
        return {(agent, name): results for agent in agents for name, results in ended.items()}

    monkeypatch.setattr(evaluating, "drive", driven)
    save_routes([fake_route("7", length_m=20.0), fake_route("8", length_m=20.0)], tmp_path / "fake.xml")
    late = "200 ms latency (reading=released)"
    found = evaluating.evaluate(
        "tcp", [tmp_path / "tcp.safetensors"], routes_spec=str(tmp_path / "fake.xml"), settings=[late], workers=1,
        store=tmp_path,
    )  # fmt: skip
    (one,) = found["candidates"]
    assert one["driving_score"] == 100.0
    assert list(one["settings"]) == [late]
    assert one["settings"][late]["rd"] == pytest.approx(0.5)


@pytest.mark.slow
def test_candidates_are_driven_and_the_best_is_named(run: Path, tmp_path: Path) -> None:
    save_routes([fake_route("7", length_m=20.0)], tmp_path / "fake.xml")
    files = [run / "weights" / f"{step:09d}" / "tcp.safetensors" for step in (3, 5)]
    driving = {"routes_spec": str(tmp_path / "fake.xml"), "workers": 1, "store": tmp_path / "store", "simulator": FAKE}
    found = evaluating.evaluate("tcp", files, settings=[], **driving)
    scores = [one["driving_score"] for one in found["candidates"]]
    assert found["best"] == scores.index(max(scores))
    assert [(one["episodes"], one["by_type"]["Straight"]["episodes"]) for one in found["candidates"]] == [
        (1, 1),
        (1, 1),
    ]
    assert [Path(one["file"]) for one in found["candidates"]] == files
    assert evaluating.evaluate("tcp", files, settings=["clean"], **driving) == found  # out of the store
    json.dumps(found, allow_nan=False)
