"""Parsers from the text of an option to its value. Every parser raises `UsageError`, which names the flag."""

from __future__ import annotations

import math
import os
import re
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TypeVar

from pytest_drive_robust.errors import UnknownNameError, UsageError, nearest
from pytest_drive_robust.options.option import GivenText, asked_for
from pytest_drive_robust.options.table import OPTIONS

Name = TypeVar("Name", bound=str)
_DURATION = r"(?i)(?P<number>[0-9]*\.?[0-9]+)\s*(?P<unit>ms|s|sec|m|min|h|d)?"
_SEEDS_END = 1 << 53
"""Seeds are below this number: JSON readers cannot tell larger whole numbers apart, so no record takes them."""
_SECONDS = {"ms": 1e-3, "s": 1.0, "sec": 1.0, "m": 60.0, "min": 60.0, "h": 3600.0, "d": 86_400.0}


def one_of(names: tuple[Name, ...], what: str) -> Callable[[GivenText], Name]:
    """Return a parser that accepts only `names`; `what` says in the error what a name means: `"metric mode"`."""

    def parse(given: GivenText) -> Name:
        for name in names:
            if name == given.text:
                return name
        raise UnknownNameError.of(what, given.text, names, hint=f"Set it with {given.flag}.")

    return parse


def seed_list(given: GivenText) -> tuple[int, ...]:
    """Return the seeds in a text such as `"0,1"`: distinct whole numbers >= 0 and below 2^53."""
    words = [word.strip() for word in given.text.split(",")]
    if not all(word.isdecimal() for word in words):
        raise UsageError(
            f"{given.flag} is {given.text!r}, expected whole numbers >= 0 with commas between them, as in 0,1."
        )
    return check_seeds((int(word) for word in words), source=given.flag)


def check_seeds(seeds: Iterable[object], *, source: str) -> tuple[int, ...]:
    """Return the seeds as a tuple.

    Raises `UsageError`, which names `source`, unless there is at least one seed and all seeds are distinct whole
    numbers >= 0 and below 2^53.
    """
    numbers: list[int] = []
    for seed in seeds:
        if not isinstance(seed, int) or isinstance(seed, bool) or seed < 0:
            raise UsageError(f"{source} holds {seed!r}, expected whole numbers >= 0.")
        if seed >= _SEEDS_END:
            raise UsageError(f"{source} holds {seed}, expected numbers below 2^53 = {_SEEDS_END}.")
        if seed in numbers:
            raise UsageError(f"{source} holds seed {seed} twice, expected each once: an episode would count double.")
        numbers.append(seed)
    if not numbers:
        raise UsageError(f"{source} is empty, expected at least one seed.")
    return tuple(numbers)


def share(given: GivenText) -> float:
    """Return a share as a number; the caller checks that the number lies between 0 and 1."""
    try:
        return float(given.text)
    except ValueError:
        raise UsageError(
            f"{given.flag} is {given.text!r}, expected a number, as in {given.flag} {OPTIONS[given.flag].default}."
        ) from None


def seconds(given: GivenText) -> float | None:
    """Return a number of seconds > 0; None for `""` and for `"none"`."""
    if given.text in ("", "none"):
        return None
    value = _number(given.text)
    if not (math.isfinite(value) and value > 0):
        raise UsageError(f"{given.flag} is {given.text!r}, expected seconds > 0 or none, as in {given.flag} 60.")
    return value


def time_limit_s(given: GivenText) -> float | None:
    """Return a time such as `"90"`, `"90s"`, `"20m"` or `"1.5h"` in seconds > 0; None for `""` and for `"none"`."""
    if given.text in ("", "none"):
        return None
    match = re.fullmatch(_DURATION, given.text)
    value = float(match["number"]) * _SECONDS[(match["unit"] or "s").lower()] if match else math.nan
    if not (math.isfinite(value) and value > 0):
        raise UsageError(f"{given.flag} is {given.text!r}, expected a time such as 90s, 20m or 1.5h.")
    return value


def gigabytes(given: GivenText) -> int | None:
    """Return a number of gigabytes, such as `"4"`, in bytes; None for `""`. The number is > 0 and below 1e9."""
    if not given.text:
        return None
    value_bytes = 1e9 * _number(given.text.lower().removesuffix("gb").removesuffix("g").strip())
    if not 1.0 <= value_bytes < 1e18:  # the system takes 63 bits
        raise UsageError(f"{given.flag} is {given.text!r}, expected gigabytes > 0 and below 1e9, as in {given.flag} 4.")
    return int(value_bytes)


def writable_file(given: GivenText) -> Path | None:
    """Return the absolute path of a file to write when the run ends; None for `""`.

    Raises `UsageError` now for a file that could not be written then.
    """
    if not given.text:
        return None
    path = start_folder(given) / given.text
    if path.is_dir():
        example = f"{given.text}/run.{given.flag.rpartition('-')[2]}"
        raise UsageError(f"{given.flag} is {given.text!r}, which is a folder; expected a file, as in {example}.")
    if path.exists() and not path.is_file():
        raise UsageError(f"{given.flag} is {given.text!r}, which is a pipe or a device; expected a file.")
    _require_place(given, Path(os.path.realpath(path)))  # check where a link leads, but keep the link
    return path.absolute()


def writable_folder(given: GivenText) -> Path | None:
    """Return the absolute path of a folder to write when the run ends; None for `""`.

    Raises `UsageError` now for a folder that could not be made then. The folder may exist: the code that writes the
    folder checks its content.
    """
    if not given.text:
        return None
    path = (start_folder(given) / given.text).absolute()
    _require_place(given, path)
    return path


def _require_place(given: GivenText, path: Path) -> None:
    """Raise `UsageError` where `path` could not be written or made."""
    if not path.parent.is_dir():
        missing, advice = str(path.parent), _similar(path.parent) or " Make it first."
        raise UsageError(f"{given.flag} is {given.text!r}, but there is no folder {missing!r}.{advice}")
    require_writable(given, path if path.is_dir() else path.parent)


def require_writable(given: GivenText, folder: Path) -> None:
    """Raise `UsageError` when no file could be written into `folder`, or a missing `folder` could not be made."""
    place = next(place for place in (folder, *folder.parents) if place.exists())
    if not (place.is_dir() and os.access(place, os.W_OK)):
        raise UsageError(f"{given.flag} is {given.text!r}, but {str(place)!r} cannot be written to.")


def start_folder(given: GivenText) -> Path:
    """Return the folder where a path of an option starts.

    A path of the command line starts in the folder where pytest was called, a path of the ini file in the root folder.
    """
    if given.source is None:
        return Path()
    folder: Path = given.source.invocation_params.dir if asked_for(given.flag, given.source) else given.source.rootpath
    return folder


def route_set(given: GivenText) -> str:
    """Return the given routes; a path in the ini file, relative to the root folder, becomes relative to this folder."""
    if given.source is None or asked_for(given.flag, given.source):
        return given.text
    return routes_from_root(given.text, given.source.rootpath, Path.cwd())


def routes_from_root(text: str, root: Path, here: Path) -> str:
    """Return the routes `text` of a file of the project; a path relative to `root` becomes relative to `here`."""
    found = re.fullmatch(r"(?P<file>.+\.xml)(?P<ids>:.*)?", text.strip())
    if found is None or Path(found["file"]).is_absolute():
        return text
    return os.path.relpath(root / found["file"], here) + (found["ids"] or "")


def folder_path(given: GivenText) -> str:
    """Return the given folder; a folder of the ini file becomes an absolute path. The caller checks its content."""
    if not given.text or given.source is None or asked_for(given.flag, given.source):
        return given.text
    return str(start_folder(given) / given.text)


def program(given: GivenText) -> str:
    """Return the path of a program as `folder_path` does; a bare name unchanged, for the system to look up."""
    return folder_path(given) if len(Path(given.text).parts) > 1 else given.text


def store_folder(given: GivenText) -> str:
    """Return the folder of the store, relative to the root folder, or `"off"`.

    A path of the command line starts in the folder where pytest was called and is returned as an absolute path. Once
    the store exists, pytest may take its folder for a folder of tests and choose another root folder. Raises
    `UsageError` when the path is a file.
    """
    if given.source is None or given.text == "off":
        return given.text
    asked = asked_for(given.flag, given.source)
    folder = start_folder(given) / given.text
    if folder.is_file():
        raise UsageError(f"{given.flag} is {given.text!r}, which is a file; expected a folder, or off.")
    return str(folder) if asked else given.text


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return math.nan


def _similar(folder: Path) -> str:
    """Return a sentence that suggests an existing folder with a similar name; `""` when there is none."""
    if not folder.parent.is_dir():
        return ""
    close = nearest(folder.name, [entry.name for entry in folder.parent.iterdir() if entry.is_dir()])
    return f" Did you mean {str(folder.parent / close)!r}?" if close else ""
