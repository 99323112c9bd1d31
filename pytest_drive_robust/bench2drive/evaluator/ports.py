"""Which ports servers take: CARLA three in a row, its traffic manager one, a slot the first free ones of its own."""

from __future__ import annotations

import socket

from pytest_drive_robust.errors import UsageError

DEFAULT_PORT = 2000
TRAFFIC_OFFSET = 6000
"""How much higher the ports of traffic managers are."""
PORTS_PER_SLOT = 150
_LAST_PORT = 65535


def check_ports(port: int, *, slots: int = 1) -> None:
    """Raise `UsageError` where so many slots from `port` on need ports that there are not."""
    last = port + TRAFFIC_OFFSET + slots * PORTS_PER_SLOT - 1
    if port < 1 or last > _LAST_PORT:
        raise UsageError(
            f"the first port is {port}: with the traffic managers', ports up to {last} may be taken (slots: {slots}), "
            f"expected 1 to {_LAST_PORT}. Begin at another port, or drive fewer at a time."
        )


def free_ports(first: int) -> int:
    """Return the first of three free ports in a row, which CARLA takes; the evaluator itself looks at one."""
    for port in range(first, first + PORTS_PER_SLOT - 3, 3):
        with socket.socket() as one, socket.socket() as two, socket.socket() as three:
            try:
                for number, server in enumerate((one, two, three)):
                    server.bind(("localhost", port + number))
            except OSError:
                continue
            return port
    raise UsageError(f"no three free ports in a row from {first} on. `drive-robust doctor` says who holds them.")
