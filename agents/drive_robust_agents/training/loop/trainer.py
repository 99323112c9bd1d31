"""The training loop: AdamW with one cycle of the learning rate, mean of the weights, validation, states, candidates.

An interrupted run continues from its last state. On one thread of a CPU its final weights equal those of an
uninterrupted run, bit for bit.
"""

from __future__ import annotations

import json
import math
import time
from collections.abc import Iterator, Mapping
from contextlib import AbstractContextManager, nullcontext
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import torch
from torch import Tensor, nn

from drive_robust_agents._nets.blocks import channels_last
from drive_robust_agents._nets.torch_engine import TYPES
from drive_robust_agents._nets.torch_weights import begin_with
from drive_robust_agents.training.data.draws import draws
from drive_robust_agents.training.loop.average import Average
from drive_robust_agents.training.loop.interrupts import Interrupts
from drive_robust_agents.training.loop.schedule import learning_rate, stage_at
from drive_robust_agents.training.loop.state import States
from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.store.whole_file import write_whole

if TYPE_CHECKING:
    from drive_robust_agents.training.loop.feed import Feed
    from drive_robust_agents.training.loop.progress import Display
    from drive_robust_agents.training.recipes.recipe import TrainingRecipe

__all__ = ["Trainer", "TrainingOptions", "precision"]

_OPTIONS_FILE = "settings.json"
_VALIDATED_FRAMES = 2048


@dataclass(frozen=True, slots=True)
class TrainingOptions:
    """The options that decide the weights: `steps` batches of `batch` frames, all random draws by `seed`.

    `dtype` is the type of mixed precision (float32: none). `spec` changes the network from the shipped one. The others
    are provenance for the manifest: `frames` the names of the data folders, `drawn` the seeds of each folder, `rows`
    the number of frames, `start` the initial weights.
    """

    agent: str
    steps: int
    batch: int
    lr: float
    weight_decay: float
    clip: float
    seed: int = 0
    robust: bool = False
    dtype: str = "float32"
    spec: Mapping[str, Any] | None = None
    frames: tuple[str, ...] = ()
    drawn: tuple[Mapping[str, Any], ...] = ()
    rows: int = 0
    start: str = ""


class Trainer:
    """One training in the folder `run`.

    `net` is the network under training, `average` its mean, `step` the number of finished steps. `start` are initial
    weights; with these only the last stage of the recipe is trained, because the earlier stages are learnt already.
    Raises `UsageError` when the folder holds a run with other options.
    """

    def __init__(
        self,
        recipe: TrainingRecipe,
        feed: Feed,
        options: TrainingOptions,
        run: Path,
        *,
        device: str = "cpu",
        save_every_s: float = 300.0,
        start: Path | None = None,
    ) -> None:
        self.recipe, self.feed, self.options, self.run = recipe, feed, options, run
        self.device = torch.device(device)
        torch.manual_seed(options.seed)
        self.net = channels_last(recipe.make(options.spec)).to(self.device).train()
        if start is not None:
            begin_with(self.net, options.agent, start)
        self._claim()  # after loading the weights: a training that cannot begin leaves the folder unclaimed
        self.average = Average(self.net)
        self._optimizer = _optimizer(self.net, options)
        self._states, self._save_every_s = States(run), save_every_s
        self._stages = recipe.stages if start is None else recipe.stages[-1:]
        self._stage = -1
        self._in_step = False
        self.step = 0
        known = self._states.latest()
        if known is not None:
            self._states.restore(self.net, self.average.net, self._optimizer)
            self.step = int(known["step"])

    def train(self, display: Display, *, candidates: Mapping[int, Path], stop_after: int | None = None) -> None:
        """Train to the end (or for `stop_after` steps), and save states on the way.

        Ctrl-C and SIGTERM let the step finish, save the state, and then raise KeyboardInterrupt. A second signal aborts
        the step; a half step is never saved, so the last state stays.

        `candidates` maps steps to the folders where the mean is written as weights. Raises `UsageError` when the loss
        becomes NaN or infinite; the last state is older than that.
        """
        from drive_robust_agents.training.loop.export import write_weights

        end = self.options.steps if stop_after is None else min(self.options.steps, self.step + stop_after)
        saved = time.monotonic()
        marks = {round(self.options.steps * share / 10) for share in range(1, 11)}
        try:
            with Interrupts() as interrupts:
                for batch in self.feed.batches(self.step, end):
                    parts = self._advance(batch)
                    display.step(self.step, parts, self._rate())
                    if self.step in marks:
                        self._note(display)
                    if self.step in candidates:
                        write_weights(self.average.net, candidates[self.step], options=self.options, step=self.step)
                    interrupts.heed()
                    if time.monotonic() - saved > self._save_every_s:
                        self.save()
                        saved = time.monotonic()
        except KeyboardInterrupt:
            if not self._in_step:
                self.save()
            raise
        self.save()

    def save(self) -> None:
        """Write the state of this step."""
        self._states.save(self.step, self.net, self.average.net, self._optimizer, {"settings": asdict(self.options)})

    def validate(self) -> dict[str, float]:
        """Return the parts of the mean network's loss on frames of validation episodes."""
        sums: dict[str, float] = {}
        rows = 0
        for batch in self.feed.validating(_VALIDATED_FRAMES):
            moved = self._moved(batch)
            count = len(next(iter(moved.values())))
            with torch.no_grad(), self._precision():
                total, parts = self.recipe.loss(self.average.net, moved)
            rows += count
            for name, value in {"loss": total, **parts}.items():
                sums[name] = sums.get(name, 0.0) + float(value) * count
        return {name: value / rows for name, value in sums.items()}

    def _advance(self, batch: Mapping[str, Tensor]) -> Mapping[str, Tensor | float]:
        """Make one step; return the parts of its loss."""
        options = self.options
        self._in_step = True
        self._enter_stage()
        torch.manual_seed(int(draws("torch", options.seed, self.step).integers(1 << 62)))
        for group in self._optimizer.param_groups:
            group["lr"] = self._rate()
        moved = self._moved(batch)
        with self._precision():
            total, parts = self.recipe.loss(self.net, moved)
        self._optimizer.zero_grad(set_to_none=True)
        total.backward()  # type: ignore[no-untyped-call,unused-ignore]
        nn.utils.clip_grad_norm_(self.net.parameters(), options.clip, foreach=True)
        self._optimizer.step()
        self.average.follow(self.step)
        self.step += 1
        self._in_step = False
        return {"loss": total.detach(), **parts}

    def _rate(self) -> float:
        return learning_rate(self._stages, min(self.step, self.options.steps - 1), self.options.steps, self.options.lr)

    def _enter_stage(self) -> None:
        """Freeze the parameters, with their statistics, that rest in the stage of this step."""
        number, _ = stage_at(self._stages, self.step, self.options.steps)
        if number == self._stage:
            return
        self._stage = number
        resting = self._stages[number].frozen
        for name, parameter in self.net.named_parameters():
            parameter.requires_grad_(not name.startswith(resting) if resting else True)
        for name, module in self.net.named_modules():
            if isinstance(module, nn.modules.batchnorm._BatchNorm):
                module.train(not (resting and name.startswith(resting)))

    def _moved(self, batch: Mapping[str, Tensor]) -> dict[str, Tensor]:
        if self.device.type == "cpu":
            return dict(batch)
        return {name: value.pin_memory().to(self.device, non_blocking=True) for name, value in batch.items()}

    def _precision(self) -> AbstractContextManager[Any]:
        return precision(self.device, self.options.dtype)

    def _note(self, display: Display) -> None:
        """Validate, show the losses and append them to the log."""
        found = self.validate()
        if not math.isfinite(found["loss"]):
            raise UsageError(
                f"the validation loss of {self.run} is {found['loss']} at step {self.step}: the training has diverged. "
                f"Give a smaller --lr than {self.options.lr:g} and a new --run."
            )
        display.validated(self.step, found)
        line = {"step": self.step, "visits": self.step * self.options.batch, **found}
        with (self.run / "log.jsonl").open("a", encoding="utf-8") as log:
            log.write(json.dumps(line) + "\n")

    def _claim(self) -> None:
        """Write the options to the folder, or check that the folder holds equal options."""
        asked = json.loads(json.dumps(asdict(self.options)))
        file = self.run / _OPTIONS_FILE
        if file.is_file():
            there = {"rows": asked["rows"], **json.loads(file.read_text(encoding="utf-8"))}  # older folders lack rows
            other = sorted(name for name in asked if there.get(name) != asked[name])
            if other:
                said = "; ".join(f"{name}: {there.get(name)!r} there, {asked[name]!r} now" for name in other[:3])
                raise UsageError(
                    f"{self.run} holds another training ({said}). Give another --run, or the same options to go on."
                )
            return
        self.run.mkdir(parents=True, exist_ok=True)
        write_whole(file, json.dumps(asked, indent=1, sort_keys=True) + "\n")


def precision(device: torch.device, dtype: str) -> AbstractContextManager[Any]:
    """Return the context in which a loss is computed in a `dtype` of the options."""
    kind = TYPES[dtype]
    return nullcontext() if kind is None else torch.autocast(device.type, kind)


def _optimizer(net: nn.Module, options: TrainingOptions) -> torch.optim.AdamW:
    """Return AdamW with a fused kernel; biases, scales and embeddings of one row do not decay."""
    groups = list(_groups(net, options.weight_decay))
    return torch.optim.AdamW(groups, lr=options.lr, fused=True)


def _groups(net: nn.Module, decay: float) -> Iterator[dict[str, Any]]:
    parameters = list(net.parameters())
    yield {"params": [parameter for parameter in parameters if parameter.ndim > 1], "weight_decay": decay}
    yield {"params": [parameter for parameter in parameters if parameter.ndim <= 1], "weight_decay": 0.0}
