"""A disk in memory that forgets what nobody synced: every state in which a power cut may leave a folder."""

from __future__ import annotations

import itertools
import os
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

Operation = tuple[Any, ...]
Tree = dict[Path, bytes | None]
"""What is on the disk: the bytes of a file, None for a folder."""


class Recorder:
    """`os` that does everything and notes what changes the disk below `root`, in its order."""

    def __init__(self, root: Path) -> None:
        self.operations: list[Operation] = []
        self._root = root
        self._open: dict[int, Operation] = {}
        self._files = itertools.count(1)

    def __getattr__(self, name: str) -> Any:
        return getattr(os, name)

    def note(self, *operation: Any) -> None:
        """Add something that happened, such as a call that returned."""
        self.operations.append(operation)

    def mkdir(self, path: Path, *, exist_ok: bool = False, real: Callable[..., None] = Path.mkdir) -> None:
        """Do as `Path.mkdir`, of one folder at a time."""
        new = not path.exists()
        real(path, exist_ok=exist_ok)
        if new and self._root in path.parents:
            self.note("name", path, None)

    def open(self, path: Any, flags: int, *rest: Any) -> int:
        descriptor = os.open(path, flags, *rest)
        if flags & os.O_CREAT:
            number = next(self._files)
            self.note("name", Path(path), number)
            self._open[descriptor] = ("keep file", number)
        else:
            self._open[descriptor] = ("keep names", Path(path))
        return descriptor

    def write(self, descriptor: int, data: Any) -> int:
        count = os.write(descriptor, data)
        self.note("bytes", self._open[descriptor][1], bytes(data[:count]))
        return count

    def fsync(self, descriptor: int) -> None:
        os.fsync(descriptor)
        self.note(*self._open[descriptor])

    def replace(self, source: Any, target: Any) -> None:
        os.replace(source, target)
        self.note("rename", Path(source), Path(target))


def after_a_cut(operations: Sequence[Operation], start: Tree) -> Iterator[Tree]:
    """Yield every tree that may be there when the power went after these operations.

    Names that were made in a folder since it was synced last are there or not, each for itself. Bytes that were written
    to a file since it was synced last are there, or half of them, or zeros in their place, or none.
    """
    lasting: dict[Path, int | None] = {path: None for path in start if start[path] is None}
    now: dict[Path, int | None] = {}
    pending: list[tuple[Path, int | None, Path | None]] = []
    written: dict[int, bytes] = {}
    synced: dict[int, bytes] = {}
    for kind, what, *more in operations:
        if kind == "name":
            now[what] = more[0]
            pending.append((what, more[0], None))
        elif kind == "rename":
            now[more[0]] = now.pop(what)
            pending.append((more[0], now[more[0]], what))
        elif kind == "bytes":
            written[what] = written.get(what, b"") + more[0]
        elif kind == "keep file":
            synced[what] = written[what]
        elif kind == "keep names":
            _apply(lasting, [change for change in pending if change[0].parent == what])
            pending = [change for change in pending if change[0].parent != what]
    for chosen in itertools.product((False, True), repeat=len(pending)):
        names = dict(lasting)
        _apply(names, list(itertools.compress(pending, chosen)))
        for damage in (_whole, _half, _zeros, _nothing):
            tree = dict(start)
            for path, number in names.items():
                tree[path] = None if number is None else _content(written.get(number, b""), synced.get(number), damage)
            yield tree


def lay_out(tree: Tree, root: Path) -> None:
    """Write a tree below `root`; what lies in a folder that is not there is lost."""
    for path in sorted(tree):
        content = tree[path]
        if not (root / path).parent.is_dir():
            continue
        if content is None:
            (root / path).mkdir(exist_ok=True)
        else:
            (root / path).write_bytes(content)


def _apply(names: dict[Path, int | None], changes: list[tuple[Path, int | None, Path | None]]) -> None:
    for path, number, former in changes:
        names[path] = number
        if former is not None:
            names.pop(former, None)


def _content(written: bytes, synced: bytes | None, damage: Callable[[bytes], bytes]) -> bytes:
    return written if written == synced else (synced or b"") + damage(written[len(synced or b"") :])


def _whole(rest: bytes) -> bytes:
    return rest


def _half(rest: bytes) -> bytes:
    return rest[: len(rest) // 2]


def _zeros(rest: bytes) -> bytes:
    return bytes(len(rest))


def _nothing(rest: bytes) -> bytes:
    return b""
