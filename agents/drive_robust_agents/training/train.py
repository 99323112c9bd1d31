"""`train`: from a folder of frames to candidates for the weights of an agent."""

from __future__ import annotations

import argparse
import json
import signal
import time
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING

import torch

from drive_robust_agents._nets.blocks import channels_last
from drive_robust_agents._nets.weights import locate
from drive_robust_agents.training.data.collection_file import check_frames, draws_of
from drive_robust_agents.training.data.frames import Frames
from drive_robust_agents.training.loop.feed import Feed
from drive_robust_agents.training.loop.progress import Display
from drive_robust_agents.training.loop.trainer import Trainer, TrainingOptions, precision
from drive_robust_agents.training.prerequisites import require_device, require_positive
from drive_robust_agents.training.recipes.recipe import RECIPES, recipe_of

if TYPE_CHECKING:
    from drive_robust_agents.training.recipes.recipe import TrainingRecipe

__all__ = ["add_arguments", "candidate_steps", "run"]

_TIMED_STEPS = 6
_SHARES = (0.6, 0.8, 1.0)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `train`."""
    parser.add_argument("--agent", required=True, choices=sorted(RECIPES), help="whose network")
    parser.add_argument("--frames", type=Path, nargs="+", required=True, help="folders that `collect` wrote")
    parser.add_argument("--run", type=Path, required=True, help="folder of the training; goes on where it stopped")
    length = parser.add_mutually_exclusive_group()
    length.add_argument("--visits", type=int, help="frames to see in all (the recipe knows a good number)")
    length.add_argument("--epochs", type=float, help="passes over the frames")
    length.add_argument("--minutes", type=float, help="about so long: a few steps are timed first")
    parser.add_argument("--batch", type=int, help="frames in a step")
    parser.add_argument("--lr", type=float, help="largest learning rate")
    parser.add_argument("--seed", type=int, default=0, help="weights at the beginning, order and augmentation")
    parser.add_argument("--robust", action="store_true", help="train on the deployment failures, too")
    parser.add_argument(
        "--start", type=Path, help="begin with these weights (a published file), and with the last stage of the recipe"
    )
    parser.add_argument("--device", default="cpu", help="cpu, cuda or cuda:N")
    parser.add_argument(
        "--dtype",
        choices=("float32", "bfloat16"),
        help="of mixed precision (bfloat16 with CUDA, else float32; 1.5 times as fast on CPUs with AVX512-BF16)",
    )
    parser.add_argument(
        "--threads", type=int, default=1, help="of torch on the CPU; one gives the same bits everywhere"
    )
    parser.add_argument("--readers", type=int, help="threads that prepare batches (1 on a CPU, 8 for CUDA)")
    parser.add_argument("--save-every", type=float, default=5.0, help="minutes between states to go on from")


def run(given: argparse.Namespace) -> int:
    """Train as the options say; return the exit code, 130 when interrupted. Raises `UsageError`."""
    require_device(given.device)
    require_positive(given, "visits", "epochs", "minutes", "batch", "lr", "threads", "readers")
    check_frames(given.frames, given.agent)
    torch.set_num_threads(given.threads)
    recipe = recipe_of(given.agent, robust=given.robust)
    readers = given.readers or (8 if given.device.startswith("cuda") else 1)
    dtype = given.dtype or ("bfloat16" if given.device.startswith("cuda") else "float32")
    frames, batch = Frames(*given.frames), given.batch or recipe.defaults.batch
    feed = Feed(frames, recipe, batch=batch, seed=given.seed, threads=readers)
    options = _options(given, recipe, frames, feed, batch, dtype)
    trainer = Trainer(
        recipe, feed, options, given.run, device=given.device, save_every_s=60.0 * given.save_every, start=given.start
    )
    before = signal.signal(signal.SIGTERM, _interrupt)
    candidates = candidate_steps(options.steps, given.run)
    try:
        with Display(total=options.steps, done=trainer.step, batch=batch) as display:
            trainer.train(display, candidates=candidates)
    except KeyboardInterrupt:
        print(f"stopped after {trainer.step} of {options.steps} steps; the same command goes on")
        return 130
    finally:
        signal.signal(signal.SIGTERM, before)
    print(f"candidates: {', '.join(str(folder) for folder in candidates.values())}")
    print(f"next: python -m drive_robust_agents.training evaluate --agent {given.agent} --run {given.run}")
    return 0


def candidate_steps(steps: int, run: Path) -> dict[int, Path]:
    """Return the steps at which weights are written, and the folder of each."""
    return {step: run / "weights" / f"{step:09d}" for step in sorted({max(1, round(steps * s)) for s in _SHARES})}


def _options(
    given: argparse.Namespace, recipe: TrainingRecipe, frames: Frames, feed: Feed, batch: int, dtype: str
) -> TrainingOptions:
    defaults = recipe.defaults
    return TrainingOptions(
        agent=given.agent,
        steps=_steps(given, recipe, feed, batch, dtype),
        batch=batch,
        lr=given.lr or defaults.lr,
        weight_decay=defaults.weight_decay,
        clip=defaults.clip,
        seed=given.seed,
        robust=given.robust,
        dtype=dtype,
        frames=tuple(folder.name for folder in given.frames),
        drawn=tuple(draws_of(folder) for folder in given.frames),
        rows=len(frames),
        start="" if given.start is None else locate(given.agent, given.start)[1].label,
    )


def _steps(given: argparse.Namespace, recipe: TrainingRecipe, feed: Feed, batch: int, dtype: str) -> int:
    if given.minutes is None:
        epochs = given.epochs
        visits: float = (given.visits or recipe.defaults.visits) if epochs is None else epochs * len(feed.training)
        return max(1, round(visits / batch))
    known = given.run / "settings.json"
    if known.is_file():  # a continued run keeps the timing of its start
        steps: int = json.loads(known.read_text(encoding="utf-8"))["steps"]
        return steps
    minutes: float = given.minutes
    return max(_TIMED_STEPS, round(60.0 * minutes / _seconds_per_step(given, recipe, feed, dtype)))


def _seconds_per_step(given: argparse.Namespace, recipe: TrainingRecipe, feed: Feed, dtype: str) -> float:
    """Return the measured seconds per step, with a temporary network."""
    net = channels_last(recipe.make()).to(given.device).train()
    optimizer = torch.optim.AdamW(net.parameters(), lr=1e-5, fused=True)
    times = []
    for batch in feed.batches(0, _TIMED_STEPS + 2):
        begin = time.perf_counter()
        moved = {name: value.to(given.device) for name, value in batch.items()}
        with precision(torch.device(given.device), dtype):
            total, _ = recipe.loss(net, moved)
        total.backward()  # type: ignore[no-untyped-call,unused-ignore]
        optimizer.step()
        optimizer.zero_grad()
        float(total.detach())  # wait for the device
        times.append(time.perf_counter() - begin)
    return sorted(times[2:])[_TIMED_STEPS // 2]


def _interrupt(number: int, frame: FrameType | None) -> None:
    raise KeyboardInterrupt
