"""From the text of an option to its value. Every parser raises `UsageError`, which names the flag."""

from __future__ import annotations

import math
import os
import re
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TypeVar

from pytest_drive_robust.errors import UnknownNameError, UsageError, nearest
from pytest_drive_robust.options.option import GivenText, asked_for

Name = TypeVar("Name", bound=str)
_DURATION = r"(?i)(?P<number>[0-9]*\.?[0-9]+)\s*(?P<unit>ms|s|sec|m|min|h|d)?"
_SEEDS_END = 1 << 53
"""From here on a record takes no whole number: JSON readers tell them no more apart."""
_SECONDS = {"ms": 1e-3, "s": 1.0, "sec": 1.0, "m": 60.0, "min": 60.0, "h": 3600.0, "d": 86_400.0}


def one_of(names: tuple[Name, ...], what: str) -> Callable[[GivenText], Name]:
    """Return a parser of one of the names; `what` is what people call them: `"metric mode"`."""

    def parse(given: GivenText) -> Name:
        for name in names:
            if name == given.text:
                return name
        raise UnknownNameError.of(what, given.text, names, hint=f"Set it with {given.flag}.")

    return parse


def seed_list(given: GivenText) -> tuple[int, ...]:
    """Return `"0,1"` as distinct whole numbers >= 0."""
    words = [word.strip() for word in given.text.split(",")]
    if not all(word.isdecimal() for word in words):
        raise UsageError(
            f"{given.flag} is {given.text!r}, expected whole numbers >= 0 with commas between them, as in 0,1."
        )
    return check_seeds((int(word) for word in words), source=given.flag)


def check_seeds(seeds: Iterable[object], *, source: str) -> tuple[int, ...]:
    """Return the seeds when they are distinct whole numbers >= 0 and at least one; an error names `source`."""
    numbers: list[int] = []
    for seed in seeds:
        if not isinstance(seed, int) or isinstance(seed, bool) or seed < 0:
            raise UsageError(f"{source} holds {seed!r}, expected whole numbers >= 0.")
        if seed >= _SEEDS_END:
            raise UsageError(f"{source} holds {seed}, expected numbers below 2^53 = {_SEEDS_END}.")
        if seed in numbers:
            raise UsageError(f"{source} holds seed {seed} twice: the same episode would count double.")
        numbers.append(seed)
    if not numbers:
        raise UsageError(f"{source} is empty, expected at least one seed.")
    return tuple(numbers)


def share(given: GivenText) -> float:
    """Return a number that shall lie between 0 and 1; whoever uses it checks the bounds."""
    try:
        return float(given.text)
    except ValueError:
        raise UsageError(
            f"{given.flag} is {given.text!r}, expected a number between 0 and 1, as in {given.flag} 0.10."
        ) from None


def seconds(given: GivenText) -> float | None:
    """Return a number of seconds > 0, None for nothing and for `"none"`."""
    if given.text in ("", "none"):
        return None
    value = _number(given.text)
    if not (math.isfinite(value) and value > 0):
        raise UsageError(f"{given.flag} is {given.text!r}, expected seconds > 0 or none, as in {given.flag} 60.")
    return value


def time_limit_s(given: GivenText) -> float | None:
    """Return `"90"`, `"90s"`, `"20m"`, `"1.5h"` as seconds > 0, None for nothing and for `"none"`."""
    if given.text in ("", "none"):
        return None
    match = re.fullmatch(_DURATION, given.text)
    value = float(match["number"]) * _SECONDS[(match["unit"] or "s").lower()] if match else math.nan
    if not (math.isfinite(value) and value > 0):
        raise UsageError(f"{given.flag} is {given.text!r}, expected a time such as 90s, 20m or 1.5h.")
    return value


def gigabytes(given: GivenText) -> int | None:
    """Return gigabytes > 0 and below 1e9, as in `"4"`, in bytes, None for nothing."""
    if not given.text:
        return None
    value_bytes = 1e9 * _number(given.text.lower().removesuffix("gb").removesuffix("g").strip())
    if not 1.0 <= value_bytes < 1e18:  # the system takes 63 bits
        raise UsageError(f"{given.flag} is {given.text!r}, expected gigabytes > 0 and below 1e9, as in {given.flag} 4.")
    return int(value_bytes)


def writable_file(given: GivenText) -> Path | None:
    """Return the file to write at the end, None for nothing; refuse now what could not be written then."""
    if not given.text:
        return None
    path = start_folder(given) / given.text
    if path.is_dir():
        example = f"{given.text}/run.{given.flag.rpartition('-')[2]}"
        raise UsageError(f"{given.flag} is {given.text!r}, which is a folder; expected a file, as in {example}.")
    if path.exists() and not path.is_file():
        raise UsageError(f"{given.flag} is {given.text!r}, which is a pipe or a device; expected a file.")
    _require_place(given, Path(os.path.realpath(path)))  # a link stays
    return path.absolute()


def writable_folder(given: GivenText) -> Path | None:
    """Return the folder to write at the end, None for nothing; refuse now what could not be made then.

    It may be there: whoever writes it says what may be in it.
    """
    if not given.text:
        return None
    path = (start_folder(given) / given.text).absolute()
    _require_place(given, path)
    return path


def _require_place(given: GivenText, path: Path) -> None:
    """Raise `UsageError` where `path` could not be written or made."""
    if not path.parent.is_dir():
        missing, similar = str(path.parent), _similar(path.parent)
        raise UsageError(f"{given.flag} is {given.text!r}, but there is no folder {missing!r}.{similar}")
    require_writable(given, path if path.is_dir() else path.parent)


def require_writable(given: GivenText, folder: Path) -> None:
    """Raise `UsageError` where nothing could be put into a folder, nor the folder be made where it is not there."""
    place = next(place for place in (folder, *folder.parents) if place.exists())
    if not (place.is_dir() and os.access(place, os.W_OK)):
        raise UsageError(f"{given.flag} is {given.text!r}, but {str(place)!r} cannot be written to.")


def start_folder(given: GivenText) -> Path:
    """Return where a path of an option starts: on the command line where pytest was called, in a file the root."""
    if given.source is None:
        return Path()
    folder: Path = given.source.invocation_params.dir if asked_for(given.flag, given.source) else given.source.rootpath
    return folder


def route_set(given: GivenText) -> str:
    """Return the routes as they were said; a path in the ini file counts from the root folder: return it from here."""
    if given.source is None or asked_for(given.flag, given.source):
        return given.text
    return routes_from_root(given.text, given.source.rootpath, Path.cwd())


def routes_from_root(text: str, root: Path, here: Path) -> str:
    """Return routes that are said in a file of the project; a path from its root becomes one from the folder `here`."""
    found = re.fullmatch(r"(?P<file>.+\.xml)(?P<ids>:.*)?", text.strip())
    if found is None or Path(found["file"]).is_absolute():
        return text
    return os.path.relpath(root / found["file"], here) + (found["ids"] or "")


def folder_path(given: GivenText) -> str:
    """Return a folder as it was said, one that the ini file names by its whole path; whoever uses it looks into it."""
    if not given.text or given.source is None or asked_for(given.flag, given.source):
        return given.text
    return str(start_folder(given) / given.text)


def program(given: GivenText) -> str:
    """Return a program as `folder_path` does where it is named by a path; a bare name is looked up by the system."""
    return folder_path(given) if len(Path(given.text).parts) > 1 else given.text


def store_folder(given: GivenText) -> str:
    """Return the folder of the store, relative to the root folder, or `"off"`.

    What the command line says starts from the folder that pytest was called in, and is returned as an absolute path:
    the root folder may be another one as soon as the store is there, as pytest takes it for a folder of tests.
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
    """Return a nearby folder that does exist, as a sentence of its own."""
    if not folder.parent.is_dir():
        return ""
    close = nearest(folder.name, [entry.name for entry in folder.parent.iterdir() if entry.is_dir()])
    return f" Did you mean {str(folder.parent / close)!r}?" if close else ""
