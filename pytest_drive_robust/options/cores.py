"""How many cores this process may use: those that it may run on, but no more than its container is given time on."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path

_OWN_GROUP = Path("/proc/self/cgroup")
_GROUPS = Path("/sys/fs/cgroup")
_VERSION_1 = ("quota", "period")


def available_cores() -> int:
    """Return how many cores this process may use.

    A container with `--cpus 2`, or with a limit of Kubernetes, may run on all cores, but only for the time of two. As
    many processes as cores would be so slow that episodes reach their time limits, and would need the memory of all.
    """
    affinity: Callable[[int], set[int]] | None = getattr(os, "sched_getaffinity", None)
    cores = len(affinity(0)) if affinity is not None else os.cpu_count() or 1
    return min([cores, *(max(1, math.ceil(quota)) for quota in _quotas())])


def _quotas() -> Iterator[float]:
    """Yield the limit of each control group around this process, in cores; nothing for a group without a limit."""
    with suppress(OSError, ValueError):  # another system, or no control groups of version 2
        (own,) = (line[4:] for line in _OWN_GROUP.read_text().splitlines() if line.startswith("0::/"))
        for group in (_GROUPS / own, *(_GROUPS / own).parents):
            if group.is_relative_to(_GROUPS) and (group / "cpu.max").is_file():
                quota, period = (group / "cpu.max").read_text().split()
                if quota != "max":
                    yield int(quota) / int(period)
    with suppress(OSError, ValueError):  # version 1
        quota_us, period_us = (int((_GROUPS / "cpu" / f"cpu.cfs_{name}_us").read_text()) for name in _VERSION_1)
        if quota_us > 0:
            yield quota_us / period_us
