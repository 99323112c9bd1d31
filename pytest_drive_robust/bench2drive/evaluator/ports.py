"""The ports of servers: CARLA takes three in a row, its traffic manager one; each slot has a range of its own."""

from __future__ import annotations

import socket
from collections.abc import Iterator
from contextlib import contextmanager

from pytest_drive_robust.errors import UsageError

DEFAULT_PORT = 2000
TRAFFIC_OFFSET = 6000
"""Added to the port of a server for the port of its traffic manager."""
PORTS_PER_SLOT = 150
_LAST_PORT = 65535
_HOST = "localhost"


def check_ports(port: int, *, slots: int = 1) -> None:
    """Raise `UsageError` if `slots` slots from `port` on need ports outside of 1..65535."""
    last = port + TRAFFIC_OFFSET + slots * PORTS_PER_SLOT - 1
    if port < 1 or last > _LAST_PORT:
        raise UsageError(
            f"the first port is {port}: with the traffic managers', ports up to {last} may be taken (slots: {slots}), "
            f"expected 1 to {_LAST_PORT}. Begin at another port, or drive fewer at a time."
        )


@contextmanager
def held_ports(first: int) -> Iterator[int]:
    """Give the first of three free ports in a row for CARLA; the evaluator itself checks only one port.

    A server listens only after many seconds. So we keep the fourth port bound within this context: other commands that
    look for ports with this function then see the three ports as taken. Raises `UsageError` if no ports are free.
    """
    for port in range(first, first + PORTS_PER_SLOT - 3, 4):
        with socket.socket() as held:
            try:
                held.bind((_HOST, port + 3))
                for number in range(port, port + 3):
                    with socket.socket() as server:
                        server.bind((_HOST, number))
            except OSError:
                continue
            yield port
            return
    raise UsageError(f"no four free ports in a row from {first} on. `drive-robust doctor` says who holds them.")
