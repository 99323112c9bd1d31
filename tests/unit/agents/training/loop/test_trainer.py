"""The training loop: it learns, it goes on where it was cut off with the same bits, it refuses what does not fit."""

# ruff: noqa: E402 - without torch, which is an extra, these tests are skipped before the imports that need it

from __future__ import annotations

import json
import os
import signal
from pathlib import Path
from typing import Any

import pytest

torch = pytest.importorskip("torch")
from frames_on_disk import write_frames
from rich.console import Console
from tiny_tcp import CAMERAS, published, tiny_options

from drive_robust_agents._nets.torch_weights import load
from drive_robust_agents.training.data.frames import Frames
from drive_robust_agents.training.loop.feed import Feed
from drive_robust_agents.training.loop.progress import Display
from drive_robust_agents.training.loop.trainer import Trainer
from drive_robust_agents.training.recipes.recipe import TrainingStage
from drive_robust_agents.training.recipes.tcp import TcpRecipe
from pytest_drive_robust.errors import UsageError


@pytest.fixture(scope="module")
def frames(tmp_path_factory: pytest.TempPathFactory) -> Frames:
    return Frames(write_frames(tmp_path_factory.mktemp("frames"), rows=96, cameras=CAMERAS, episodes=8))


@pytest.fixture
def display() -> Display:
    return Display(total=12, done=0, batch=8, console=Console(quiet=True))


def trainer(frames: Frames, run: Path, *, recipe: TcpRecipe | None = None, **changes: Any) -> Trainer:
    recipe, start, options = recipe or TcpRecipe(), changes.pop("start", None), tiny_options(**changes)
    feed = Feed(frames, recipe, batch=options.batch, seed=options.seed)
    return Trainer(recipe, feed, options, run, start=start)


def bits(net: torch.nn.Module) -> dict[str, bytes]:
    return {name: value.numpy().tobytes() for name, value in net.state_dict().items()}


def test_it_learns(frames: Frames, tmp_path: Path, display: Display) -> None:
    made = trainer(frames, tmp_path, steps=60)
    before = made.validate()
    made.train(display, candidates={})
    after = made.validate()
    assert after["waypoints"] < 0.5 * before["waypoints"]
    logged = [json.loads(line) for line in (tmp_path / "log.jsonl").read_text().splitlines()]
    assert [line["step"] for line in logged] == list(range(6, 61, 6))
    assert logged[-1]["loss"] == pytest.approx(after["loss"])


def test_mixed_precision_learns_the_same_in_other_bits(frames: Frames, tmp_path: Path, display: Display) -> None:
    exact, mixed = trainer(frames, tmp_path / "exact"), trainer(frames, tmp_path / "mixed", dtype="bfloat16")
    for made in (exact, mixed):
        made.train(display, candidates={})
    assert bits(exact.average.net) != bits(mixed.average.net)
    assert {value.dtype for value in mixed.net.state_dict().values()} <= {torch.float32, torch.int64}
    assert mixed.validate()["loss"] == pytest.approx(exact.validate()["loss"], rel=0.05)
    with pytest.raises(UsageError, match="dtype: 'bfloat16' there, 'float32' now"):
        trainer(frames, tmp_path / "mixed")


def test_a_run_that_was_cut_off_ends_with_the_same_weights_bit_for_bit(
    frames: Frames, tmp_path: Path, display: Display
) -> None:
    whole = trainer(frames, tmp_path / "whole")
    whole.train(display, candidates={})
    for _ in range(4):
        part = trainer(frames, tmp_path / "parts")
        part.train(display, candidates={}, stop_after=3)
    again = trainer(frames, tmp_path / "parts")
    assert again.step == 12
    assert bits(again.net) == bits(whole.net)
    assert bits(again.average.net) == bits(whole.average.net)
    assert bits(again.net) != bits(trainer(frames, tmp_path / "new").net)


def test_an_interrupt_is_saved_and_goes_through(frames: Frames, tmp_path: Path) -> None:
    class Impatient(Display):
        def step(self, done: int, *_: object) -> None:
            if done == 5:
                raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        trainer(frames, tmp_path).train(
            Impatient(total=12, done=0, batch=8, console=Console(quiet=True)), candidates={}
        )
    assert trainer(frames, tmp_path).step == 5


class Struck(TcpRecipe):
    """Signals in the middle of the sixth step."""

    def __init__(self, *signals: int) -> None:
        super().__init__()
        self._signals, self._steps = signals, 0

    def loss(self, net: Any, batch: Any) -> Any:
        found = super().loss(net, batch)
        self._steps += net.training
        if self._steps == 6 and net.training:
            for number in self._signals:
                os.kill(os.getpid(), number)
        return found


@pytest.mark.parametrize(
    ("signals", "kept"), [((signal.SIGINT,), 6), ((signal.SIGTERM,), 6), ((signal.SIGINT, signal.SIGINT), 0)]
)
def test_a_run_that_was_struck_within_a_step_ends_with_the_same_weights_bit_for_bit(
    signals: tuple[int, ...], kept: int, frames: Frames, tmp_path: Path, display: Display
) -> None:
    whole = trainer(frames, tmp_path / "whole")
    whole.train(display, candidates={})
    before = [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)]
    with pytest.raises(KeyboardInterrupt):
        trainer(frames, tmp_path / "struck", recipe=Struck(*signals)).train(display, candidates={})
    assert [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)] == before
    again = trainer(frames, tmp_path / "struck")
    assert again.step == kept  # a second signal breaks the step off: it goes on from the state before, here none
    again.train(display, candidates={})
    assert bits(again.net) == bits(whole.net)
    assert bits(again.average.net) == bits(whole.average.net)


def test_another_seed_gives_other_weights_and_the_same_seed_the_same(
    frames: Frames, tmp_path: Path, display: Display
) -> None:
    made = [trainer(frames, tmp_path / str(k), steps=3, seed=seed) for k, seed in enumerate((0, 0, 1))]
    for one in made:
        one.train(display, candidates={})
    assert bits(made[0].net) == bits(made[1].net)
    assert bits(made[0].net) != bits(made[2].net)


def test_a_folder_with_another_training_is_refused(frames: Frames, tmp_path: Path) -> None:
    trainer(frames, tmp_path)
    with pytest.raises(UsageError, match=r"holds another training \(lr: 0.003 there, 0.1 now\)"):
        Trainer(
            TcpRecipe(),
            Feed(frames, TcpRecipe(), batch=8, seed=0),
            type(tiny_options())(**{**_fields(tiny_options()), "lr": 0.1}),
            tmp_path,
        )


def test_weights_that_it_cannot_begin_with_leave_the_folder_to_another_training(frames: Frames, tmp_path: Path) -> None:
    start = published(tmp_path / "published")
    with pytest.raises(UsageError, match="does not hold the tensors"):
        Trainer(
            TcpRecipe(),
            Feed(frames, TcpRecipe(), batch=8, seed=0),
            type(tiny_options())(**{**_fields(tiny_options()), "spec": None}),
            tmp_path / "run",
            start=start,
        )
    trainer(frames, tmp_path / "run", start=start)


def test_a_damaged_state_is_refused_with_what_to_do(frames: Frames, tmp_path: Path, display: Display) -> None:
    trainer(frames, tmp_path).train(display, candidates={}, stop_after=2)
    (state,) = (tmp_path / "state").iterdir()
    state.write_bytes(state.read_bytes()[:-50])
    with pytest.raises(UsageError, match=r"cannot be read: .* Remove it to go on"):
        trainer(frames, tmp_path)


def test_only_the_last_two_states_stay(frames: Frames, tmp_path: Path, display: Display) -> None:
    for _ in range(4):
        trainer(frames, tmp_path).train(display, candidates={}, stop_after=2)
    assert sorted(path.name for path in (tmp_path / "state").iterdir()) == [
        "000000006.safetensors", "000000008.safetensors",
    ]  # fmt: skip


def test_candidates_are_the_mean_and_load_as_weights(frames: Frames, tmp_path: Path, display: Display) -> None:
    made = trainer(frames, tmp_path)
    made.train(display, candidates={6: tmp_path / "w6", 12: tmp_path / "w12"})
    net, entry = load("tcp", lambda spec: made.recipe.make(spec), weights=tmp_path / "w12" / "tcp.safetensors")
    example = made.average.net.example(2)
    with torch.inference_mode():
        assert (net(**example)["waypoints"] - made.average.net(**example)["waypoints"]).abs().max() < 0.02
    assert entry.provenance["trainer"]["step"] == 12
    assert (tmp_path / "w6" / "manifest.json").is_file()


class Staged(TcpRecipe):
    stages = (TrainingStage(0.5, ("encoder",)), TrainingStage(0.5))


def test_published_weights_go_on_with_the_last_stage(frames: Frames, tmp_path: Path, display: Display) -> None:
    start = published(tmp_path / "published")
    made = trainer(frames, tmp_path / "run", recipe=Staged(), start=start)
    begin = bits(made.net)
    made.train(display, candidates={}, stop_after=2)
    assert [name for name, value in bits(made.net).items() if value == begin[name]] == []


def test_what_rests_in_a_stage_does_not_move_and_moves_in_the_next(
    frames: Frames, tmp_path: Path, display: Display
) -> None:
    made = trainer(frames, tmp_path, recipe=Staged())
    begin = bits(made.net)
    made.train(display, candidates={}, stop_after=6)
    middle = bits(made.net)
    made.train(display, candidates={})
    end = bits(made.net)
    resting = [name for name in begin if name.startswith("encoder")]
    assert all(begin[name] == middle[name] for name in resting)
    assert all(begin[name] != middle[name] for name in begin if name.startswith("pooled"))
    assert [name for name in resting if middle[name] == end[name]] == []


def test_a_training_that_diverges_stops_with_advice(frames: Frames, tmp_path: Path, display: Display) -> None:
    class Broken(TcpRecipe):
        def loss(self, net: Any, batch: Any) -> Any:
            total, parts = super().loss(net, batch)
            return total * float("nan"), parts

    with pytest.raises(UsageError, match=r"has diverged\. Give a smaller --lr than 0\.003"):
        trainer(frames, tmp_path, recipe=Broken()).train(display, candidates={})


def _fields(options: Any) -> dict[str, Any]:
    return {name: getattr(options, name) for name in type(options).__dataclass_fields__}
