"""A stack of perturbations: what an episode is driven under."""

from __future__ import annotations

import copy
import os
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

from pytest_drive_robust.domain.observation import CameraSpec
from pytest_drive_robust.errors import PerturbationError, RequirementError
from pytest_drive_robust.perturbations.base import EpisodeContext, Perturbation
from pytest_drive_robust.perturbations.phrase import matches, parse
from pytest_drive_robust.perturbations.running import RunningStack
from pytest_drive_robust.perturbations.template import kebab_name
from pytest_drive_robust.perturbations.values import split_outside_quotes

__all__ = ["Setting"]

_CLEAN = "clean"


@dataclass(frozen=True, eq=False)
class Setting:
    """The perturbations of an episode, in the order in which they are applied; the empty stack is `clean`.

    On the observation seam the first one changes the observation first, on the control seam the first one changes the
    control first. The sentence (`str()`) is the key of the setting wherever episodes are stored. RunOptions are equal
    when their perturbations are of the same classes with the same parameters in the same order.

    >>> from pytest_drive_robust.perturbations import InferenceLatency, PartialObservation
    >>> setting = PartialObservation(ratio=0.5) + InferenceLatency(ms=100)
    >>> str(setting)
    'occlusion 0.5 and 100 ms latency'
    >>> Setting.parse("occlusion 0.5 and 100ms latency") == setting
    True
    """

    perturbations: tuple[Perturbation, ...] = ()

    CLEAN: ClassVar[Setting]

    @classmethod
    def of(cls, *perturbations: Perturbation) -> Setting:
        """A stack of these. Raises `PerturbationError` for anything that is no `Perturbation` object."""
        for given in perturbations:
            if not isinstance(given, Perturbation):
                what = f"the class {given.__name__}" if isinstance(given, type) else repr(given)
                raise PerturbationError(f"a setting is made of Perturbation objects, but {what} was given")
        return cls(tuple(perturbations))

    @classmethod
    def parse(cls, text: str, known: Mapping[str, type[Perturbation]] | None = None) -> Setting:
        """The inverse of `str()`, over the perturbation classes `known` (default: the built-in ones).

        Raises `RequirementError` with the nearest valid sentence, `PerturbationError` for an impossible severity.
        """
        from pytest_drive_robust.perturbations import BUILTIN

        if text.strip().lower() == _CLEAN:
            return cls.CLEAN
        classes = list((BUILTIN if known is None else known).values())
        return cls(tuple(parse(sentence, classes) for sentence in _sentences(text, classes)))

    @classmethod
    def from_env(cls, environ: Mapping[str, str] = os.environ) -> Setting:
        """The stack that the released code's environment variables ask for: see `environment.setting_from`."""
        from pytest_drive_robust.perturbations.environment import setting_from

        return setting_from(environ)

    @property
    def is_clean(self) -> bool:
        """True for the empty stack."""
        return not self.perturbations

    @property
    def warmup_ticks(self) -> int:
        """For so many ticks the vehicle gets neutral commands: the longest `warmup_ticks` of the stack, 0 if none."""
        return max((int(getattr(item, "warmup_ticks", 0)) for item in self.perturbations), default=0)

    @property
    def baseline(self) -> Setting:
        """What this setting is compared with: `clean`, or a clean drive with the same warm-up."""
        from pytest_drive_robust.perturbations.compute import InferenceLatency

        ticks = self.warmup_ticks
        return Setting.of(InferenceLatency(ms=0.0, warmup_ticks=ticks)) if ticks else Setting.CLEAN

    def start(self, *, route_id: str, seed: int, dt_s: float, cameras: Sequence[CameraSpec]) -> RunningStack:
        """Fresh copies of the perturbations, reset for one episode. Raises `PerturbationError` from their `reset`."""
        counts: Counter[str] = Counter()
        running = []
        for perturbation in self.perturbations:
            name = kebab_name(type(perturbation))
            counts[name] += 1
            stream = name if counts[name] == 1 else f"{name}#{counts[name]}"
            own = copy.deepcopy(perturbation)
            own.reset(EpisodeContext(route_id, seed, dt_s, tuple(cameras), stream))
            running.append(own)
        return RunningStack(tuple(running))

    def __add__(self, other: Setting | Perturbation) -> Setting:
        if isinstance(other, Perturbation):
            other = Setting.of(other)
        if not isinstance(other, Setting):
            return NotImplemented
        return Setting(self.perturbations + other.perturbations)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Setting):
            return NotImplemented
        return self._key() == other._key()

    def __hash__(self) -> int:
        return hash(str(self))

    def __str__(self) -> str:
        return " and ".join(map(str, self.perturbations)) or _CLEAN

    def _key(self) -> tuple[tuple[type, tuple[tuple[str, object], ...]], ...]:
        return tuple((type(item), tuple(item.parameters().items())) for item in self.perturbations)


Setting.CLEAN = Setting()


def _sentences(text: str, classes: Sequence[type[Perturbation]]) -> list[str]:
    """Cut at "and". A sentence of a user's class may hold an "and" itself, so the longest that matches is taken."""
    words = split_outside_quotes(text, r"\s+and\s+")
    sentences: list[str] = []
    start = 0
    while start < len(words):
        for end in range(len(words), start, -1):
            sentence = " and ".join(words[start:end])
            if end == start + 1 or matches(sentence, classes):
                break
        if len(words) > 1 and sentence.strip().lower() == _CLEAN:
            raise RequirementError(f"{text.strip()!r} does not parse: 'clean' means no perturbation and stands alone.")
        sentences.append(sentence)
        start = end
    return sentences
