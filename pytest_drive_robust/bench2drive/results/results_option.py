"""The value of `--drive-results`: which results are those of which setting."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path

from pytest_drive_robust.errors import DriveRobustError, RequirementError, UsageError, nearest
from pytest_drive_robust.perturbations.base import Perturbation, Setting
from pytest_drive_robust.perturbations.readings import DriveReading
from pytest_drive_robust.perturbations.sentences import CLEAN

_OUTER_COMMA = re.compile(r",(?![^()]*\))")
_UP_TO_OUTER_EQUALS = re.compile(r"(?:\([^()]*\)|[^=(])*")


def parse_results(
    text: str, known: Mapping[str, type[Perturbation]] | None = None, reading: DriveReading | None = None
) -> dict[str, Path]:
    """Parse `"clean=DIR,latency 200 ms=DIR2"`; return each path by the sentence of its setting (`str(Setting)`).

    A part without `=` belongs to the path before it, so that paths may have commas. `known` are the perturbation
    classes (default: the built-in ones), `reading` is applied to the failures, if there is one. Raises `UsageError`,
    and `RequirementError` for a sentence that does not parse.
    """
    parts: list[str] = []
    for piece in _OUTER_COMMA.split(text):
        if "=" in piece or not parts:
            parts.append(piece)
        else:
            parts[-1] += f",{piece}"
    found: dict[str, Path] = {}
    for part in parts:
        sentence, equals, path = (word.strip() for word in _named(part))
        if not (sentence and equals and path):
            raise UsageError(
                f"--drive-results holds {part.strip()!r}, expected SETTING=FOLDER as in "
                '--drive-results "clean=results/clean,200 ms latency=results/latency".'
            )
        setting = str(_read_setting(sentence, known).read_as(reading))
        if setting in found:
            raise UsageError(f"--drive-results names {setting!r} twice: {str(found[setting])!r} and {path!r}.")
        found[setting] = Path(path)
    return found


def _named(part: str) -> tuple[str, str, str]:
    """Cut at the first `=` outside of brackets, as in `200 ms latency (reading=released)=DIR`."""
    found = _UP_TO_OUTER_EQUALS.match(part)
    end = 0 if found is None else found.end()
    return part[:end], part[end : end + 1], part[end + 1 :]


def _read_setting(sentence: str, known: Mapping[str, type[Perturbation]] | None) -> Setting:
    """Parse a setting as `Setting.parse` does; also accept `latency 200 ms` for `200 ms latency`."""
    try:
        return Setting.parse(sentence, known)
    except RequirementError as error:
        first, _, rest = sentence.partition(" ")
        try:
            return Setting.parse(f"{rest} {first}", known)
        except DriveRobustError:
            pass  # the first error names what was typed
        if nearest(sentence, [CLEAN]):
            raise RequirementError(f"there is no setting {sentence!r}. Did you mean {CLEAN!r}?") from error
        raise
