"""The causal transformer of `simlingo`: who sees whom, its cache, and rows that do not know of each other."""

from __future__ import annotations

import pytest

torch = pytest.importorskip("torch")

from simlingo_samples import SMALL  # noqa: E402
from torch import Tensor  # noqa: E402

from drive_robust_agents._nets import prompts  # noqa: E402
from drive_robust_agents._nets.answer import answer_and_drive  # noqa: E402
from drive_robust_agents._nets.causal import Decoder, select  # noqa: E402
from drive_robust_agents._nets.prompts import Instruction, Kind  # noqa: E402
from drive_robust_agents._nets.simlingo import SimLingoNet, SimLingoSpec  # noqa: E402
from drive_robust_agents._nets.torch_engine import TorchEngine  # noqa: E402
from drive_robust_agents._nets.words import CLOSING, PAD  # noqa: E402
from pytest_drive_robust.errors import UsageError  # noqa: E402

Inputs = dict[str, Tensor]
WAY = prompts.by_targets(7.4)
TEXTS = [
    prompts.driving(WAY),
    prompts.comment(WAY),
    prompts.instructed(WAY, Instruction(Kind.FASTER), safety=False),
    prompts.instructed(WAY, Instruction(Kind.SPEED, mps=12.5, phrase=1), safety=True),
]


@pytest.fixture(scope="module")
def net() -> SimLingoNet:
    torch.manual_seed(3)
    made = SimLingoNet(SimLingoSpec()).eval()
    return made.requires_grad_(False)


def inputs(rows: int, *, seed: int = 0, spec: SimLingoSpec | None = None) -> Inputs:
    spec = spec or SimLingoSpec()
    generator = torch.Generator().manual_seed(seed)
    return {
        "image": torch.randint(0, 256, (rows, spec.height_px, spec.width_px, 3), generator=generator).to(torch.uint8),
        "speed": 12.0 * torch.rand(rows, generator=generator),
        "target": 20.0 * torch.randn(rows, 2, 2, generator=generator),
        "prompt": torch.tensor([prompts.prompt_row(TEXTS[k % len(TEXTS)]) for k in range(rows)]),
    }


def generate(net: SimLingoNet, given: Inputs) -> Inputs:
    found = answer_and_drive(TorchEngine(net), {name: value.numpy() for name, value in given.items()})
    return {name: torch.from_numpy(value) for name, value in found.items()}


def without_image(given: Inputs) -> list[Tensor]:
    return [given[name] for name in ("speed", "target", "prompt")]


def test_the_plan_has_the_published_shape_and_the_network_its_size(net: SimLingoNet) -> None:
    plan = net(**inputs(2))
    assert {name: tuple(values.shape) for name, values in plan.items()} == {
        "path": (2, 20, 2),
        "waypoints": (2, 10, 2),
    }
    assert sum(parameter.numel() for parameter in net.parameters()) == 1_348_548
    assert net.image_places == 32


def test_a_specification_of_something_else_is_refused() -> None:
    with pytest.raises(TypeError):
        SimLingoNet.build({"layer": 3})
    assert SimLingoNet.build({"layers": 1, "widths": [16, 32]}).spec == SimLingoSpec(layers=1, widths=(16, 32))


def test_only_the_kept_rows_of_the_image_are_looked_at(net: SimLingoNet) -> None:
    given = inputs(2)
    other = dict(given, image=given["image"].clone())
    other["image"][:, 96:] = 0
    assert torch.equal(net(**given)["path"], net(**other)["path"])
    other["image"][:, 94] = 0
    assert not torch.equal(net(**given)["path"], net(**other)["path"])


@pytest.mark.parametrize("name", ["image", "speed", "target"])
def test_every_input_reaches_the_plan(net: SimLingoNet, name: str) -> None:
    given = inputs(4)
    changed = dict(given, **{name: given[name].flip(0)})
    assert (net(**given)["waypoints"] - net(**changed)["waypoints"]).abs().amax(dim=(1, 2)).min() > 1e-5


def test_a_later_word_never_changes_what_was_read_before_it() -> None:
    torch.manual_seed(0)
    decoder = Decoder(3, 32, 4, 64).eval()
    x = torch.randn(2, 12, 32)
    before = decoder(x, None, None)[0]
    x[:, 7] *= -1.0
    after = decoder(x, None, None)[0]
    assert torch.equal(before[:, :7], after[:, :7])
    assert ((before[:, 7:] - after[:, 7:]).abs().amax(dim=-1) > 1e-4).all()


def test_a_later_word_of_the_answer_never_changes_the_scores_of_an_earlier_one(net: SimLingoNet) -> None:
    given = inputs(1)
    seen = net.see(given["image"])
    one, other = (
        torch.tensor([prompts.answer_row(text)])
        for text in ("stop because of the red light", "stop because of the stop sign")
    )
    (_, first), (_, second) = (net.teach(seen, *without_image(given), answer) for answer in (one, other))
    assert torch.equal(first[:, :5], second[:, :5])
    assert not torch.equal(first[:, 5], second[:, 5])


def test_the_answer_and_the_prompt_change_the_plan_and_filler_does_not(net: SimLingoNet) -> None:
    given = inputs(1)
    seen = net.see(given["image"])
    silent, said, refused = (
        net.teach(seen, *without_image(given), torch.tensor([row]))[0]
        for row in ((PAD,) * 16, prompts.answer_row("stop"), prompts.answer_row("accelerate"))
    )
    assert (silent.path - said.path).abs().max() > 1e-5
    assert (refused.waypoints - said.waypoints).abs().max() > 1e-5
    torch.testing.assert_close(silent.path, net(**given)["path"], atol=1e-5, rtol=0.0)


@pytest.mark.parametrize("cut", [1, 5, 11])
def test_reading_in_parts_with_a_cache_is_reading_at_once(cut: int) -> None:
    torch.manual_seed(1)
    decoder = Decoder(3, 32, 4, 64).eval()
    x = torch.randn(2, 12, 32)
    whole, _ = decoder(x, None, None)
    head, cache = decoder(x[:, :cut], None, None)
    mask = torch.ones(12, 12, dtype=torch.bool).tril()[None, None, cut:]
    rest, _ = decoder(x[:, cut:], cache, mask)
    torch.testing.assert_close(torch.cat((head, rest), dim=1), whole, atol=1e-5, rtol=0.0)
    tail, _ = decoder(x[:, cut:], cache, mask, tail=1)
    torch.testing.assert_close(tail, whole[:, -1:], atol=1e-5, rtol=0.0)


def test_the_generated_answer_is_the_likeliest_word_by_word_and_drives_like_a_given_one(net: SimLingoNet) -> None:
    given = inputs(4)
    said = generate(net, given)
    driven, scores = net.teach(net.see(given["image"]), *without_image(given), said["answer"])
    spoken = said["answer"] != PAD
    assert torch.equal(scores.argmax(dim=-1)[spoken], said["answer"][spoken])
    torch.testing.assert_close(driven.path, said["path"], atol=1e-5, rtol=0.0)
    torch.testing.assert_close(driven.waypoints, said["waypoints"], atol=1e-5, rtol=0.0)


def test_nothing_is_said_after_the_closing_word() -> None:
    torch.manual_seed(0)
    net = SimLingoNet(SMALL).eval()
    with torch.inference_mode():
        net.words.weight[CLOSING] = 0.0
        first = generate(net, inputs(1, spec=SMALL))["answer"][0, 0]
        net.words.weight[CLOSING] = 3.0 * net.words.weight[first]  # likelier than the likeliest word
        answer = generate(net, inputs(1, spec=SMALL))["answer"][0]
    assert answer.tolist() == [CLOSING] + [PAD] * 15


@pytest.mark.parametrize("way", ["forward", "generate"])
def test_a_row_has_the_same_bits_in_any_company(net: SimLingoNet, way: str) -> None:
    given = inputs(8)
    run = generate if way == "generate" else lambda net, given: net(**given)
    with torch.inference_mode():
        first = run(net, {name: values[:4] for name, values in given.items()})
        for rows in ([3, 2, 1, 0], [0, 5, 6, 7], [4, 0, 0, 1], [7, 6, 5, 0]):
            again = run(net, {name: values[rows] for name, values in given.items()})
            for place, row in enumerate(rows):
                if row < 4:
                    assert all(torch.equal(again[name][place], first[name][row]) for name in first)


def test_one_image_serves_several_prompts(net: SimLingoNet) -> None:
    given = inputs(2)
    of = torch.tensor([0, 1, 1])
    three = {name: values[of] for name, values in given.items()}
    shared = net.drive(select(net.see(given["image"]), of), *without_image(three))
    torch.testing.assert_close(shared.path, net(**three)["path"], atol=1e-5, rtol=0.0)


def test_the_example_is_what_the_network_takes(net: SimLingoNet) -> None:
    given = inputs(3)
    example = net.example(3)
    assert {name: (values.shape, values.dtype) for name, values in example.items()} == {
        name: (values.shape, values.dtype) for name, values in given.items()
    }


def test_words_outside_the_vocabulary_never_reach_the_network() -> None:
    with pytest.raises(UsageError, match="cannot read"):
        prompts.prompt_row(f"{WAY} fly")
