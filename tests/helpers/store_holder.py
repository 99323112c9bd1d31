"""A process that uses a store: `python store_holder.py FOLDER what [arguments]`; it says on stdout how far it is."""

from __future__ import annotations

import os
import sys
import time
from pathlib import Path

import numpy as np

from pytest_drive_robust.domain.episode import Episode
from pytest_drive_robust.domain.outcome import End, Outcome
from pytest_drive_robust.domain.result import EpisodeResult, Trace
from pytest_drive_robust.store.folder import FolderStore


def episode(number: int) -> EpisodeResult:
    """Make a record of 60 kB: zlib finds nothing in noise."""
    rows = np.random.Generator(np.random.Philox(key=number)).random((700, len(Trace.COLUMNS)))
    return EpisodeResult(
        episode=Episode("driver", str(number), "clean", 0),
        scenario="ParkedObstacle",
        outcome=Outcome.COMPLETED,
        end=End.COMPLETED,
        end_detail="",
        route_completion_pct=100.0,
        route_length_m=100.0,
        infractions=(),
        speed_ratios_pct=(),
        ticks=700,
        dt_s=0.05,
        wall_s=1.0,
        trace=Trace(rows),
    )


def key_of(number: int) -> str:
    return f"{number % 256:02x}{number:014x}"


def hold(store: FolderStore, key: str) -> None:
    """Claim a key and keep it until killed."""
    print("held" if store.claim(key) is not None else "taken", flush=True)
    time.sleep(600)


def write(store: FolderStore, first: str) -> None:
    """Put one record after the other until killed, and say which are acknowledged."""
    number = int(first)
    while True:
        store.put(key_of(number), episode(number))
        print(number, flush=True)
        number += 1


def cramp(store: FolderStore, most_bytes: str) -> None:
    """Put a record where no file may grow beyond so many bytes: the system writes a part of it and refuses the rest."""
    import resource

    resource.setrlimit(resource.RLIMIT_FSIZE, (int(most_bytes), int(most_bytes)))
    store.put(key_of(1), episode(1))
    found = store.get(key_of(1))
    print(found is not None and found.episode == episode(1).episode)
    print(*store.problems())


def share(store: FolderStore, count: str, order: str, processes: str = "1") -> None:
    """Drive what nobody drives and nobody has driven, until all are there; say which were driven here.

    The first episode lasts until so many processes are at one.
    """
    begun = store.folder / "begun"
    begun.mkdir(parents=True, exist_ok=True)
    numbers = [int(word) for word in np.random.Generator(np.random.Philox(key=int(order))).permutation(int(count))]
    while any(store.get(key_of(number)) is None for number in numbers):
        for number in numbers:
            if store.get(key_of(number)) is not None or (claim := store.claim(key_of(number))) is None:
                continue
            with claim:
                if store.get(key_of(number)) is None:
                    (begun / str(os.getpid())).touch()
                    while len(list(begun.iterdir())) < int(processes):
                        time.sleep(0.005)
                    time.sleep(0.005)
                    store.put(key_of(number), episode(number))
                    print(number, flush=True)
        time.sleep(0.002)


if __name__ == "__main__":
    {"hold": hold, "write": write, "share": share, "cramp": cramp}[sys.argv[2]](
        FolderStore(Path(sys.argv[1]), run="r"), *sys.argv[3:]
    )
