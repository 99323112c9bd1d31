"""The marker `drive_robust(agent=, routes=, seeds=, ...)`: run options that differ for some tests."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields, replace
from typing import Any, Protocol

from pytest_drive_robust.domain.verdict_rule import VerdictRule
from pytest_drive_robust.errors import UsageError, did_you_mean
from pytest_drive_robust.options.parsers import check_seeds
from pytest_drive_robust.perturbations.readings import DriveReading


class _Mark(Protocol):
    """The part of `pytest.Mark` that is read here."""

    @property
    def args(self) -> tuple[Any, ...]: ...

    @property
    def kwargs(self) -> Mapping[str, Any]: ...


@dataclass(frozen=True, slots=True)
class MarkerOptions:
    """The options that the markers of one test give; None for each option that no marker gives."""

    agent: str | None = None
    routes: str | None = None
    seeds: tuple[int, ...] | None = None
    verdict: str | None = None
    margin: float | None = None
    reading: str | None = None

    def asked_reading(self, usual: DriveReading | None) -> DriveReading | None:
        """Return the reading of these marks, else `usual`, the run's. Raises `UsageError` for an unknown reading."""
        if self.reading is None:
            return usual
        return DriveReading(self.reading, f"the marker drive_robust(reading={self.reading!r})")

    def verdict_rule(self, usual: VerdictRule) -> VerdictRule:
        """Return `usual`, the run's verdict rule, with the kind and the margin of these marks. Raises `UsageError`."""
        kind = usual.kind if self.verdict is None else self.verdict
        try:
            return replace(usual, kind=kind, margin=usual.margin if self.margin is None else self.margin)
        except UsageError as error:  # its advice is the option, which cannot mend what wins over it
            raise UsageError(f"{error} Here the marker or drive.check sets it, which wins: mend it there.") from None

    @classmethod
    def from_marks(cls, marks: Iterable[_Mark]) -> MarkerOptions:
        """Merge the marks of a test, given closest first; for each option the closest mark that gives it wins.

        Raises `UsageError` for a mark that cannot be used.
        """
        merged = cls()
        for mark in marks:
            one = cls._from_mark(mark)
            unset = {item.name for item in fields(cls) if getattr(merged, item.name) is None}
            merged = replace(merged, **{name: getattr(one, name) for name in unset})
        return merged

    @classmethod
    def _from_mark(cls, mark: _Mark) -> MarkerOptions:
        names = [item.name for item in fields(cls)]
        if mark.args:
            raise UsageError(
                f"the marker drive_robust takes keywords only ({', '.join(names)}), not {mark.args[0]!r}. "
                f"Did you mean drive_robust(agent={mark.args[0]!r})?"
            )
        for name in mark.kwargs:
            if name not in names:
                hint = did_you_mean(name, names)
                raise UsageError(f"the marker drive_robust has no option {name!r}.{hint} Known: {', '.join(names)}.")
        texts = {name: _text(mark.kwargs.get(name), name) for name in ("agent", "routes", "verdict", "reading")}
        options = cls(**texts, seeds=_seeds(mark.kwargs.get("seeds")), margin=mark.kwargs.get("margin"))
        options.verdict_rule(VerdictRule())  # called for their checks
        options.asked_reading(None)
        return options


def _text(value: object, name: str) -> str | None:
    if value is None or (isinstance(value, str) and value):
        return value
    raise UsageError(f"the marker drive_robust has {name}={value!r}, expected text, as in {name}='...'.")


def _seeds(value: object) -> tuple[int, ...] | None:
    if value is None:
        return None
    seeds = value if isinstance(value, (list, tuple, range)) else [value]
    return check_seeds(seeds, source=f"the marker drive_robust's seeds={value!r}")
