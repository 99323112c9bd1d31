"""The base class of perturbations, and stacks of perturbations (`Setting`).

A perturbation is a dataclass of its severities that touches one of the two seams. Write your own in ten lines: inherit
from `Perturbation`, give it a `phrase`, override what you touch::

    @dataclass
    class Dimmed(Perturbation):
        \"\"\"An ageing image sensor: every pixel at `gain` (0..1) of its brightness.\"\"\"

        gain: float = 0.5
        phrase = "dimmed camera {gain}"
        ladder = ("gain", (0.9, 0.7, 0.5, 0.3, 0.1))

        def observe(self, observation):
            return observation.map_images(
                lambda name, image: Image((image.pixels * self.gain).astype("uint8"), image.tick)
            )

Both classes stand in one module because each refers to the other: the sum of two perturbations is a setting.
"""

from __future__ import annotations

import dataclasses
import inspect
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Literal

from pytest_drive_robust.domain.control import Control
from pytest_drive_robust.domain.observation import Observation
from pytest_drive_robust.domain.result import Injection
from pytest_drive_robust.errors import PerturbationError
from pytest_drive_robust.perturbations.context import EpisodeContext, Spans
from pytest_drive_robust.perturbations.paper_variables import perturbations_from
from pytest_drive_robust.perturbations.readings import DriveReading
from pytest_drive_robust.perturbations.sentences import CLEAN, parse_stack, preset, render
from pytest_drive_robust.perturbations.severity_text import render_value
from pytest_drive_robust.perturbations.severity_types import retyped

if TYPE_CHECKING:
    from typing_extensions import Self


@dataclass
class Perturbation:
    """Base of all perturbations: the identity on both seams, `+` to stack, and a sentence for people.

    The dataclass fields are the severities, with their unit in the name. The runner copies the object for every
    episode, so `reset` may keep state in ordinary attributes. Other attributes describe the class. Write them without
    an annotation or as `ClassVar`, so that they are no severities:

    * `phrase` is the sentence form with the fields that it shows: `"{ms} ms latency"`. It is used in both directions:
      for `str()` and by the requirement parser. Fields that the phrase does not show follow in brackets when they
      differ from their defaults: `"200 ms latency (mode=hold)"`. A phrase is not inherited: a class without a phrase
      is called by its own name in words.
    * `variants` are special sentences with the fields that they imply:
      `{"measured latency": {"mode": "measured"}}`. They are not inherited either.
    * `example` has usual values of the fields without default, for the sentences that messages propose.
    * `ladder` names the severity that searches and strategies step through, and its values from mild to severe:
      `("gain", (0.9, 0.5, 0.1))`. `("ms", "ticks")` steps by whole ticks in milliseconds, up to a second.
    * `readings` are the switches that a reading sets, where the readings differ:
      `{"released": {"length": "uniform"}}` (see `perturbations.readings`).
    * `files` names the files that the perturbation reads: when their content changes, its episodes are driven anew.
    * `idle_reason` says why the perturbation may have changed nothing.
    """

    phrase: ClassVar[str] = ""
    variants: ClassVar[Mapping[str, Mapping[str, object]]] = {}
    example: ClassVar[Mapping[str, object]] = {}
    ladder: ClassVar[tuple[str, tuple[float, ...] | Literal["ticks"]] | None] = None
    readings: ClassVar[Mapping[str, Mapping[str, object]]] = {}
    files: ClassVar[Sequence[str | os.PathLike[str]]] = ()

    def __init_subclass__(cls, **options: object) -> None:
        """Drop inherited sentences: two failures with the same sentence would be driven and stored as one."""
        super().__init_subclass__(**options)
        cls.phrase = vars(cls).get("phrase", "")
        cls.variants = vars(cls).get("variants", {})

    def __new__(cls, *args: object, **severities: object) -> Self:
        """Note which severities the caller gives, so that a reading sets only the others."""
        made = super().__new__(cls)
        names = [field.name for field in dataclasses.fields(cls) if field.init] if args else []
        vars(made)["_said"] = frozenset(severities).union(names[: len(args)])
        return made

    def reset(self, context: EpisodeContext) -> None:
        """Begin an episode. Override to build the state that the other methods need."""

    def observe(self, observation: Observation) -> Observation:
        """Return the observation that the agent gets instead. The arrays of the argument are read-only."""
        return observation

    def wants_inference(self, tick: int) -> bool:
        """Return False while the agent's computer is busy: then `act` is not called in this tick."""
        return True

    def actuate(self, tick: int, control: Control | None, inference_s: float) -> Control | None:
        """Return the control that reaches the vehicle. `control` is None when the agent was not asked in this tick.

        `inference_s` is the wall time of `act` in seconds (0.0 when it was not called). Returning None holds the last
        control that reached the vehicle.
        """
        return control

    def schedule(self) -> tuple[Injection, ...]:
        """Return what was injected so far, for the record. Called once, at the end of the episode.

        The default returns the ticks that `self._spans` noted, if `reset` made one (see `context.Spans`).
        """
        spans: Spans | None = vars(self).get("_spans")
        return () if spans is None else spans.injections()

    def idle_reason(self, cameras: tuple[str, ...], dt_s: float) -> str:
        """Return in a clause why the perturbation changed nothing: `"latency 20 ms is 0 ticks at 20 Hz"`.

        Called only after whole episodes in which nothing changed. `cameras` are the names of the agent's cameras,
        `dt_s` is the length of a tick in seconds.
        """
        return "with these severities it leaves every signal and every command as it is"

    def parameters(self) -> dict[str, object]:
        """Return the severities by name, defaults included, in the order of their declaration."""
        return {field.name: getattr(self, field.name) for field in dataclasses.fields(self) if field.init}

    def read_as(self, reading: DriveReading) -> Self:
        """Return this failure with the switches of `reading`; itself when a reading was applied before.

        Raises `PerturbationError` for a switch that the caller gave with another value than the reading has.
        """
        if vars(self).get("_read", False):
            return self
        parameters = self.parameters()
        switches = preset(type(self), reading.name, parameters)
        for name in sorted(self._was_said() & switches.keys()):
            if parameters[name] != switches[name]:
                raise PerturbationError(
                    f"{type(self).__name__}: {name}={render_value(parameters[name])} contradicts the reading "
                    f"{reading.name!r}, which has {name}={render_value(switches[name])} ({reading.asked}). "
                    "Leave one of them out."
                )
        made = self.with_severities(**switches)
        vars(made)["_read"] = True
        return made

    def with_severities(self, **changed: Any) -> Self:
        """Return a copy with other severities, each number in the type of its default.

        A reading that was applied stays applied.
        """
        made = dataclasses.replace(self, **{**changed, **retyped(type(self), changed)})
        vars(made).update(_said=self._was_said().union(changed), _read=vars(self).get("_read", False))
        return made

    def _was_said(self) -> frozenset[str]:
        said: frozenset[str] = vars(self).get("_said", frozenset())
        return said

    def __add__(self, other: Perturbation | Setting) -> Setting:
        """Stack two failures: `BurstFrameDrop(length_s=3) + InferenceLatency(ms=200)`."""
        return Setting.of(self) + other

    def __str__(self) -> str:
        return render(self)


_OF_THE_CLASS = ("phrase", "variants", "example", "ladder", "readings", "files")
"""Attributes that describe a class and are no severities."""

BUILTIN: dict[str, type[Perturbation]] = {}
"""Every perturbation that comes with the package, by its name (`"gps-noise"`). `perturbations/__init__` fills it."""


@dataclass(frozen=True, eq=False)
class Setting:
    """The perturbations of an episode, in the order in which they are applied; the empty stack is `clean`.

    The first perturbation is applied first, to the observation and to the control alike. The sentence (`str()`) is the
    key of the setting wherever episodes are stored. Settings are equal when their perturbations are of the same classes
    with the same parameters in the same order.

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
        """Return the setting of these perturbations, each number in the type of its default (see `retyped`).

        Raises `PerturbationError` for anything but a `Perturbation` object, and for a perturbation whose severities are
        no dataclass fields.
        """
        for given in perturbations:
            if not isinstance(given, Perturbation):
                what = f"the class {given.__name__}" if isinstance(given, type) else repr(given)
                raise PerturbationError(f"a setting is made of Perturbation objects, but {what} was given")
            check_severities_are_fields(type(given))
        return cls(tuple(map(_of_its_types, perturbations)))

    @classmethod
    def parse(cls, text: str, known: Mapping[str, type[Perturbation]] | None = None) -> Setting:
        """Parse a sentence that `str()` writes; `known` are the perturbation classes (default: the built-in ones).

        Raises `RequirementError` with the nearest valid sentence, `PerturbationError` for an impossible severity.
        """
        perturbations = parse_stack(text, (BUILTIN if known is None else known).values())
        return cls(tuple(map(_of_its_types, perturbations)))

    @classmethod
    def from_env(cls, environ: Mapping[str, str] = os.environ) -> Setting:
        """Return the stack that the environment variables of the paper and its released code ask for.

        See `paper_variables.perturbations_from` for the variables. Raises `UsageError` with the variable and its value.
        """
        return cls.of(*perturbations_from(environ, BUILTIN))

    @property
    def is_clean(self) -> bool:
        """True for the empty stack."""
        return not self.perturbations

    @property
    def warmup_ticks(self) -> int:
        """Number of ticks at the start with neutral commands: the largest `warmup_ticks` of the stack, 0 if none."""
        return max((int(getattr(item, "warmup_ticks", 0)) for item in self.perturbations), default=0)

    @property
    def measures_inference(self) -> bool:
        """True when the wall time of inference decides what happens: only a replay repeats the episode."""
        return any(getattr(item, "measures_inference", False) for item in self.perturbations)

    @property
    def baseline(self) -> Setting:
        """The setting that this one is compared with: `clean`, or a clean drive with the same warm-up and latency mode.

        With 0 ms latency the modes drive the same; the mode makes the sentence of the baseline tell its reading.
        """
        ticks = self.warmup_ticks
        if not ticks:
            return Setting.CLEAN
        holds = any(getattr(item, "mode", "fifo") != "fifo" for item in self.perturbations)
        no_latency: dict[str, object] = {"ms": 0.0, "mode": "hold" if holds else "fifo", "warmup_ticks": ticks}
        return Setting.of(BUILTIN["inference-latency"](**no_latency))

    def read_as(self, reading: DriveReading | None) -> Setting:
        """Return the setting with `reading` applied to each failure; itself when `reading` is None.

        Raises `PerturbationError` for a switch that the caller gave with another value than the reading has.
        """
        return self if reading is None else Setting(tuple(item.read_as(reading) for item in self.perturbations))

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
        return " and ".join(map(str, self.perturbations)) or CLEAN

    def _key(self) -> tuple[tuple[type, tuple[tuple[str, object], ...]], ...]:
        return tuple((type(item), tuple(item.parameters().items())) for item in self.perturbations)


Setting.CLEAN = Setting()


def _of_its_types(perturbation: Perturbation) -> Perturbation:
    """Return the failure with each severity in the type of its default, itself where these are so."""
    changed = retyped(type(perturbation), perturbation.parameters())
    return perturbation.with_severities(**changed) if changed else perturbation


def check_severities_are_fields(cls: type[Perturbation]) -> None:
    """Raise `PerturbationError` for a class whose severities are no dataclass fields: no sentence would tell them.

    A parameter of the constructor alone, such as an `InitVar`, is no field. Raise `PerturbationError` also where an
    annotation makes a field of an attribute that describes the class: `phrase: str = "..."`.
    """
    for base in cls.__mro__:
        if base is not object and "__init__" in vars(base) and "__dataclass_params__" not in vars(base):
            raise PerturbationError(
                f"{base.__name__} has an __init__ of its own, so that its severities are no fields: write @dataclass "
                f"above the class, each severity as a field ('gain: float = 0.5'), and leave the __init__ out."
            )
    for field in dataclasses.fields(cls):
        if field.name in _OF_THE_CLASS:
            raise PerturbationError(
                f"{cls.__name__} has {field.name!r} as a severity, because it is annotated: write it without an "
                f"annotation ('{field.name} = ...'), or as ClassVar."
            )
    names = {field.name for field in dataclasses.fields(cls)}
    for parameter in list(inspect.signature(cls.__init__).parameters.values())[1:]:  # without `self`
        if parameter.name not in names and parameter.kind not in (parameter.VAR_POSITIONAL, parameter.VAR_KEYWORD):
            raise PerturbationError(
                f"{cls.__name__} is made with {parameter.name!r}, which is no field, so that two failures of one "
                f"sentence could differ by it: write it as a field ('{parameter.name}: float = ...')."
            )
