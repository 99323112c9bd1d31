"""The training of `simlingo`: drive as the expert, say the reason, and obey instructions in dreams."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.nn import functional

from drive_robust_agents._nets.causal import select
from drive_robust_agents._nets.prompts import (
    ANSWER_SLOTS,
    PROMPT_SLOTS,
    answer_row,
    by_command,
    by_targets,
    comment,
    driving,
    given,
    instructed,
    prompt_row,
)  # fmt: skip
from drive_robust_agents._nets.simlingo import Driving, SimLingoNet, SimLingoSpec
from drive_robust_agents._nets.words import PAD
from drive_robust_agents._vehicle.mkz import TICK_S
from drive_robust_agents.training.data.commentary import FOLLOWING, refusal
from drive_robust_agents.training.data.facts import FACTS
from drive_robust_agents.training.data.reasons import commentary
from drive_robust_agents.training.recipes.augment import occlude, simlingo_mild
from drive_robust_agents.training.recipes.dreaming import (
    PATH_POINTS,
    WAYPOINTS,
    Dream,
    DreamStart,
    draw_instruction,
    dream,
    is_safe,
)
from drive_robust_agents.training.recipes.failures import MOST_HIDDEN, gps_errors, misread
from drive_robust_agents.training.recipes.recipe import Defaults, TrainingStage
from pytest_drive_robust import RoadOption

if TYPE_CHECKING:
    from drive_robust_agents.training.recipes.recipe import Arrays

__all__ = ["SimLingoRecipe", "TalkPrompt", "talk"]

Floats32 = NDArray[np.float32]

MIX = {"comment": 0.24, "given": 0.06, "follow": 0.42, "safety": 0.2, "command": 0.08}
"""Shares of the kinds of second prompts. As published, 1/5 of the commentary is given in the prompt, 4/5 to be said."""
_SILENT = 0.5
"""Share of possible answers that are left out, because the agent can also be told to be silent."""
_BETA_M = 0.25
"""Error in metres below which the loss is quadratic, above it linear."""

_GAIN = 0.014
"""Gain of a GPS fix in the agent's position filter, once settled (`_wrappers.kalman`)."""
_NOISE_LEFT = (_GAIN / (2.0 - _GAIN)) ** 0.5
_LAG_S = TICK_S / _GAIN
"""Share of GPS noise after the filter, and the seconds of a speed error by which the filtered position lags."""

_prompt = lru_cache(maxsize=65536)(prompt_row)
_answer = lru_cache(maxsize=4096)(answer_row)


class TalkPrompt(NamedTuple):
    """One prompt for one sample with its targets: the words of the prompt and of the answer, and the drive.

    `answer` None: no answer; `driven` None: the expert's drive.
    """

    prompt: str
    answer: str | None
    driven: Dream | None = None


class SimLingoRecipe:
    """Smooth L1 of path and waypoints for the driving prompt and for a second, talking prompt; cross-entropy of words.

    Every image is driven once by its plain driving prompt. A share `talking` of the rows (above 1: several times) gets
    an additional prompt of another kind, for which the image is not encoded again: commentary to say or given, an
    instruction to follow (a dream) or to weigh, the way by command, with the shares in `mix`. `robust` adds deployment
    failures: a black rectangle in every second image, which SimLingo's own augmentation never has; for a third of the
    rows each, the rest of GPS noise of 0 to 15 m after the filter, and a speedometer that reads too low, in the speed,
    in the prompts, and in target points that lie farther ahead because the filter lags. The labels stay true.
    """

    name = "simlingo"
    needs = ("cam_front", "speed", "target", "command", "future", "future_ok", "path", "facts")
    history: tuple[str, ...] = ()
    stages = (TrainingStage(),)
    defaults = Defaults(batch=64, lr=1e-3, weight_decay=0.01, clip=1.0, visits=600_000)

    def __init__(self, *, robust: bool = False, talking: float = 0.5, mix: Mapping[str, float] = MIX) -> None:
        self.robust, self.talking, self.mix = robust, talking, mix

    def make(self, spec: Mapping[str, Any] | None = None) -> nn.Module:
        """Return a new network."""
        return SimLingoNet(SimLingoSpec()) if spec is None else SimLingoNet.build(spec)

    def batch(self, arrays: Arrays, generator: np.random.Generator, training: bool) -> dict[str, Tensor]:
        """Return inputs and `true_...` targets of the driving prompt; `talk_...` those of the second prompts.

        Row k of the second prompts belongs to image k modulo the number of images.
        """
        image, future = np.array(arrays["cam_front"]), arrays["future"].astype(np.float32)
        speed, target = arrays["speed"].astype(np.float32), arrays["target"][:, 1].astype(np.float32)
        rows = len(image)
        if training:
            simlingo_mild(image, generator)
            if self.robust:
                occlude(image, generator, chance=0.5, most=MOST_HIDDEN)
                speed, target = _sensed(speed, target, generator)
        numbers: dict[str, NDArray[Any]] = {
            "image": image,
            "speed": speed,
            "target": target,
            "prompt": np.array([_prompt(driving(by_targets(mps))) for mps in speed.tolist()]),
            "true_path": arrays["path"][:, :PATH_POINTS].astype(np.float32),
            "true_waypoints": future[:, :WAYPOINTS, :2],
            "true_ok": arrays["future_ok"][:, :WAYPOINTS].astype(np.float32),
        }
        told = [
            talk(arrays, k % rows, generator, quiet=training, mix=self.mix, reads_mps=float(speed[k % rows]))
            for k in range(round(self.talking * rows))
        ]
        numbers |= _talking(told, numbers)
        return {name: torch.from_numpy(np.ascontiguousarray(value)) for name, value in numbers.items()}

    def loss(self, net: nn.Module, batch: Mapping[str, Tensor]) -> tuple[Tensor, Mapping[str, Tensor | float]]:
        """Return the sum of all parts, and metres and nats to show."""
        assert isinstance(net, SimLingoNet)
        seen = net.see(batch["image"])
        speed, target = batch["speed"], batch["target"]
        path, waypoints = _off(net.drive(seen, speed, target, batch["prompt"]), batch, "true")
        parts = {"path": path, "waypoints": waypoints}
        count = len(batch["talk_prompt"])
        if count:
            of = torch.arange(count, device=speed.device) % len(speed)
            answer = batch["talk_answer"]
            driven, scores = net.teach(select(seen, of), speed[of], target[of], batch["talk_prompt"], answer)
            told_path, told_waypoints = _off(driven, batch, "talk")
            words = functional.cross_entropy(
                scores.float().flatten(0, 1), answer.flatten(), ignore_index=PAD, reduction="sum"
            )
            parts |= {"told path": told_path, "told waypoints": told_waypoints}
            parts["words"] = words / (answer != PAD).sum().clamp_min(1)
        total = torch.stack(list(parts.values())).sum()
        return total, {name: part.detach() for name, part in parts.items()}


def talk(
    arrays: Arrays,
    row: int,
    generator: np.random.Generator,
    *,
    quiet: bool,
    mix: Mapping[str, float] = MIX,
    reads_mps: float | None = None,
) -> TalkPrompt:
    """Return a second prompt for a sample, of a kind drawn by `mix`; `quiet`: possible answers are often left out.

    `reads_mps` is the measured speed (None: the true speed); prompts use the measured speed, answers and dreams the
    true speed.
    """
    speed_mps = float(arrays["speed"][row])
    reads_mps = speed_mps if reads_mps is None else reads_mps
    speeds = arrays["future"][row, :, 3].astype(np.float64)
    path = arrays["path"][row].astype(np.float64)
    facts = dict(zip(FACTS, arrays["facts"][row].tolist(), strict=True))
    said, way = commentary(facts, speed_mps, speeds, path), by_targets(reads_mps)
    kind = str(generator.choice(list(mix), p=list(mix.values())))
    silent = quiet and generator.random() < _SILENT
    if kind == "comment":
        return TalkPrompt(comment(way), said.text)
    if kind == "given":
        return TalkPrompt(given(way, said.text), None if silent else "")
    if kind == "command":
        x, y = arrays["target"][row, 1, 0].tolist()
        to = by_command(reads_mps, RoadOption(int(arrays["command"][row, 1])), float(np.hypot(x, y)))
        return TalkPrompt(driving(to), None if silent else "")
    moment, safety = DreamStart(path, speed_mps, speeds, facts), kind == "safety"
    told = draw_instruction(moment, generator, safety=safety)
    prompt = instructed(way, told, safety=safety)
    if safety and not is_safe(told, moment):
        return TalkPrompt(prompt, None if silent else refusal(said))
    return TalkPrompt(prompt, None if silent else FOLLOWING, dream(told, moment))


def _sensed(speed: Floats32, target: Floats32, generator: np.random.Generator) -> tuple[Floats32, Floats32]:
    """Return speeds (N,) and target points (N, 2, 2) as a failing speedometer and a filtered, failing GPS give them."""
    reads = misread(speed, generator)
    off = _NOISE_LEFT * gps_errors(len(speed), generator)
    off[:, 0] += _LAG_S * (speed - reads)
    return reads, (target + off[:, None]).astype(np.float32)


def _talking(told: list[TalkPrompt], own: Mapping[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
    """Return the arrays of the second prompts; empty without prompts."""
    rows = np.arange(len(told)) % max(len(own["speed"]), 1)
    path, waypoints, ok = (own[f"true_{name}"][rows].copy() for name in ("path", "waypoints", "ok"))
    silence = (PAD,) * ANSWER_SLOTS
    answers = [silence if one.answer is None else _answer(one.answer) for one in told]
    for k, one in enumerate(told):
        if one.driven is not None:
            path[k], waypoints[k] = one.driven
            ok[k] = 1.0
    return {
        "talk_prompt": np.array([_prompt(one.prompt) for one in told], dtype=np.int64).reshape(len(told), PROMPT_SLOTS),
        "talk_answer": np.array(answers, dtype=np.int64).reshape(len(told), ANSWER_SLOTS),
        "talk_path": path,
        "talk_waypoints": waypoints,
        "talk_ok": ok,
    }


def _off(driven: Driving, batch: Mapping[str, Tensor], which: str) -> tuple[Tensor, Tensor]:
    """Return the smooth L1 of the path and of the known waypoints, in metres, summed over x and y."""
    path, waypoints, ok = (batch[f"{which}_{name}"] for name in ("path", "waypoints", "ok"))
    off_path = functional.smooth_l1_loss(driven.path.float(), path, beta=_BETA_M, reduction="none").sum(2)
    off = functional.smooth_l1_loss(driven.waypoints.float(), waypoints, beta=_BETA_M, reduction="none").sum(2)
    return off_path.mean(), (off * ok).sum() / ok.sum().clamp_min(1.0)
