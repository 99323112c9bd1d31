"""How `simlingo` is trained: its batches, its loss, a small network that learns to listen."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from numpy.typing import NDArray

torch = pytest.importorskip("torch")

from simlingo_samples import SMALL, samples  # noqa: E402

from drive_robust_agents._nets import prompts, words  # noqa: E402
from drive_robust_agents._nets.prompts import Instruction, Kind  # noqa: E402
from drive_robust_agents._nets.simlingo import SimLingoNet  # noqa: E402
from drive_robust_agents.training.data.frames import Frames, write_shard  # noqa: E402
from drive_robust_agents.training.instructions import ASKED, NEEDS, examine, scores, table  # noqa: E402
from drive_robust_agents.training.recipes.simlingo import MIX, SimLingoRecipe, talk  # noqa: E402


def generator(seed: int = 0) -> np.random.Generator:
    return np.random.Generator(np.random.Philox(seed))


def test_the_recipe_reads_what_it_says() -> None:
    recipe = SimLingoRecipe()
    given = samples(4)
    assert recipe.batch({name: given[name] for name in recipe.needs}, generator(), True)
    assert isinstance(recipe.make(), SimLingoNet)


def test_the_same_generator_gives_the_same_batch() -> None:
    recipe, given = SimLingoRecipe(talking=1.5), samples(6)
    one, two, other = (recipe.batch(given, generator(seed), True) for seed in (1, 1, 2))
    assert all(torch.equal(one[name], two[name]) for name in one)
    assert not torch.equal(one["talk_prompt"], other["talk_prompt"])
    assert not torch.equal(one["image"], other["image"])


def test_labels_of_the_driving_prompt_are_the_experts() -> None:
    given = samples(5)
    batch = SimLingoRecipe().batch(given, generator(), False)
    assert np.array_equal(batch["image"].numpy(), given["cam_front"])
    assert np.array_equal(batch["true_path"].numpy(), given["path"][:, :20])
    assert np.array_equal(batch["true_waypoints"].numpy(), given["future"][:, :10, :2])
    said = words.decode(batch["prompt"][0].tolist()[1:-1])
    assert said == prompts.driving(prompts.by_targets(float(given["speed"][0])))


def test_talking_rows_belong_to_the_images_in_turn() -> None:
    given = samples(4)
    batch = SimLingoRecipe(talking=2.0).batch(given, generator(), True)
    assert len(batch["talk_prompt"]) == 8
    for row, numbers in enumerate(batch["talk_prompt"].tolist()):
        speed = prompts.by_targets(float(given["speed"][row % 4])).split(" target")[0]
        assert words.decode(numbers[1:-1]).startswith(speed)
    assert all(len(value) == 0 for name, value in SimLingoRecipe(talking=0.0).batch(given, generator(), True).items()
               if name.startswith("talk"))  # fmt: skip


def test_every_kind_of_prompt_is_drawn_about_as_often_as_the_mix_says() -> None:
    given, drawn = samples(10), generator()
    talks = [talk(given, k % 10, drawn, quiet=True) for k in range(1000)]
    shares = {
        "comment": np.mean([prompts.QUESTION in one.prompt for one in talks]),
        "given": np.mean([" commentary " in one.prompt for one in talks]),
        "follow": np.mean(["<follow>" in one.prompt for one in talks]),
        "safety": np.mean(["<safety>" in one.prompt for one in talks]),
        "command": np.mean([" command " in one.prompt for one in talks]),
    }
    assert shares == pytest.approx(MIX, abs=0.05)


def test_an_unsafe_instruction_is_refused_with_safety_and_obeyed_without() -> None:
    given, drawn = samples(10), generator(3)
    talks = [talk(given, k % 10, drawn, quiet=False) for k in range(600)]
    crazy = [one for one in talks if "road" in one.prompt.split("<next>")[-1]]
    for one in crazy:
        if "<safety>" in one.prompt:
            assert one.driven is None
            assert one.answer is not None
            assert one.answer.startswith("ignore instruction and ")
        elif "<follow>" in one.prompt:
            assert one.driven is not None
            assert one.answer == "follow instruction"
    assert {"<safety>" in one.prompt for one in crazy} == {True, False}


def test_what_nobody_drove_is_not_learnt() -> None:
    recipe, given = SimLingoRecipe(talking=0.0), samples(3)
    net = SimLingoNet(SMALL)
    batch = recipe.batch(given, generator(), False)
    batch["true_waypoints"][:, 6:] += 100.0
    far = recipe.loss(net, batch)[1]["waypoints"]
    batch["true_ok"][:, 6:] = 0.0
    assert recipe.loss(net, batch)[1]["waypoints"] < far - 10.0


def test_robust_training_blanks_blocks_and_the_published_augmentation_does_not() -> None:
    given = samples(40)
    given["cam_front"][:] = 200
    black = [
        (SimLingoRecipe(robust=robust).batch(given, generator(), True)["image"] == 0).all(-1).float().mean((1, 2))
        for robust in (False, True)
    ]
    assert black[0].max() < 0.15
    assert black[1].max() > 0.3


class Trained(NamedTuple):
    net: SimLingoNet
    first: Mapping[str, float]
    last: Mapping[str, float]

    def plan(self, inputs: Mapping[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
        given = {name: torch.from_numpy(values) for name, values in inputs.items()}
        return {name: values.numpy() for name, values in self.net(**given).items()}


@pytest.fixture(scope="module")
def trained() -> Trained:
    """A small network after some seconds of training on eight pictures, most of it with instructions."""
    torch.manual_seed(0)
    recipe, given = SimLingoRecipe(talking=4.0, mix={"follow": 0.85, "comment": 0.15}), samples(8)
    net, steps, history = recipe.make(asdict(SMALL)), 140, []
    optimiser = torch.optim.AdamW(net.parameters(), lr=3e-3)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimiser, 3e-3, total_steps=steps, pct_start=0.2)
    for step in range(steps):
        total, parts = recipe.loss(net.train(), recipe.batch(given, generator(step), False))
        optimiser.zero_grad()
        total.backward()
        torch.nn.utils.clip_grad_norm_(net.parameters(), 1.0)
        optimiser.step()
        schedule.step()
        history.append({name: float(part) for name, part in parts.items()})
    return Trained(net.eval().requires_grad_(False), history[0], history[-1])


def test_the_losses_go_down(trained: Trained) -> None:
    assert trained.last["path"] < 0.05 * trained.first["path"]
    assert trained.last["waypoints"] < 0.05 * trained.first["waypoints"]
    assert trained.last["told waypoints"] < 0.2 * trained.first["told waypoints"]
    assert trained.last["words"] < 0.3 * trained.first["words"]


@pytest.mark.parametrize("kind", [Kind.FASTER, Kind.SLOWER, Kind.LEFT, Kind.RIGHT])
def test_instructions_move_the_plan_of_a_trained_network_and_of_no_other(trained: Trained, kind: Kind) -> None:
    given = samples(8)
    arrays = {name: given[name] for name in NEEDS}
    assert np.mean(examine(trained.plan, arrays, kind, safety=False)) >= 0.75
    torch.manual_seed(0)
    other = trained._replace(net=SimLingoNet(SMALL).eval().requires_grad_(False))
    assert np.mean(examine(other.plan, arrays, kind, safety=False)) <= 0.25


def test_stop_makes_a_trained_network_slow(trained: Trained) -> None:
    given = samples(8)
    ways = [prompts.by_targets(mps) for mps in given["speed"].tolist()]
    told = [prompts.instructed(way, Instruction(Kind.STOP), safety=False) for way in ways]
    ends = []
    for texts in ([prompts.driving(way) for way in ways], told):
        inputs = {"image": given["cam_front"], "speed": given["speed"], "target": given["target"][:, 1]}
        plan = trained.plan(inputs | {"prompt": np.array([prompts.prompt_row(text) for text in texts])})["waypoints"]
        ends.append(float(np.linalg.norm(plan[:, -1] - plan[:, -2], axis=1).mean()))
    assert ends[1] < 0.4 * ends[0]


def test_the_table_counts_held_out_scenes(trained: Trained, tmp_path: Path) -> None:
    given = samples(64)
    for shard, rows in enumerate((range(32), range(32, 64))):
        write_shard(
            tmp_path, shard, [{name: np.asarray(values[k]) for name, values in given.items()} for k in rows], {}
        )
    frames = Frames(tmp_path)
    held = frames.split()[1]
    assert 0 < len(held) < 64
    found = scores(trained.plan, frames, scenes=200)
    assert [score.asked for score in found] == list(dict.fromkeys(asked for asked, _, _ in ASKED))
    assert {score.asked: score.scenes for score in found}["faster"] == len(held)
    assert all(0.0 <= score.low <= score.share <= score.high <= 1.0 for score in found)
    lines = table(found).splitlines()
    assert len(lines) == 1 + len(found)
    assert lines[1].startswith("faster")
    everywhere = scores(trained.plan, frames, scenes=40, everything=True)
    assert {score.scenes for score in everywhere} == {40}
