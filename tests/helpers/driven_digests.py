"""Drive episodes in this process and print what came of each, then what its libraries compute, as lines of JSON.

    python tests/helpers/driven_digests.py '{"agents": ["expert"], "routes": "dev10", "settings": ["clean"]}'

An order may have `ticks`, after which episodes end.

`same_bits` starts it once for each machine that it pretends to be, with another environment. It imports nothing but
the package, its agents and their libraries, so that it runs with the oldest versions of them. Beside registered agents
it knows two of its own: `watcher` drives by a script that no library decides and its digest is that of every picture it
was given; `network` steers by matrix products, as learned agents do, so that BLAS decides its bits.
"""

from __future__ import annotations

import base64
import hashlib
import json
import math
import sys
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

import cv2
import numba
import numpy as np

from pytest_drive_robust import CameraSpec, Control, GlobalPlan, Observation
from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.jit.kernels import uncached_entry
from pytest_drive_robust.metrics.comfort import comfort
from pytest_drive_robust.metrics.efficiency import efficiency
from pytest_drive_robust.metrics.score import driving_score
from pytest_drive_robust.perturbations import Setting
from pytest_drive_robust.registry.registry import default_registry
from pytest_drive_robust.runner.episode.loop import drive_episode
from pytest_drive_robust.runner.episode.stored_controls import StoredControls
from pytest_drive_robust.runner.replay.recording import difference
from pytest_drive_robust.simulators.base import SimulatorOptions
from pytest_drive_robust.simulators.embedded import EmbeddedSimulator
from pytest_drive_robust.simulators.routes import resolve_routes
from pytest_drive_robust.store.record import decode_episode, encode_episode

_CAMERAS = (
    CameraSpec("front", width_px=256, height_px=144),
    CameraSpec("back", yaw_deg=180.0, fov_deg=110.0, width_px=160, height_px=96),
)


class Watcher:
    """Drives by a script; `seen` becomes the digest of what it was given."""

    consumes = frozenset({"cameras", "gps", "compass", "speed"})

    def sensors(self) -> Sequence[CameraSpec]:
        return _CAMERAS

    def reset(self, route: GlobalPlan, seed: int) -> None:
        self.seen = hashlib.blake2b(repr(route).encode(), digest_size=16)

    def act(self, observation: Observation) -> Control:
        for image in observation.cameras.values():
            self.seen.update(np.ascontiguousarray(image.pixels).tobytes())
        told = (observation.gps.x_m, observation.gps.y_m, observation.compass.yaw_rad, observation.speed.mps)
        self.seen.update(np.array(told).tobytes())
        return Control(throttle=0.5, steer=((observation.tick % 60) - 30) / 300.0)


class Network:
    """A net with random weights: what it does depends on how BLAS adds up, as with any learned agent."""

    consumes = frozenset({"cameras", "speed"})

    def sensors(self) -> Sequence[CameraSpec]:
        return _CAMERAS[:1]

    def reset(self, route: GlobalPlan, seed: int) -> None:
        words = np.random.Philox(3).random_raw(72 * 16 * 16 + 16 * 2).astype(np.float64) / 2.0**63 - 1.0
        self.first, self.second = words[: 72 * 256].reshape(16, -1), words[72 * 256 :].reshape(16, 2)

    def act(self, observation: Observation) -> Control:
        shown = observation.cameras["front"].pixels[::4, ::8, 1].astype(np.float64).ravel() / 255.0
        throttle, steer = np.tanh((self.first @ shown / 10.0) @ self.second)
        return Control(throttle=0.3 + 0.3 * float(throttle), steer=0.3 * float(steer))


OWN = {"watcher": Watcher, "network": Network}
STORED = "stored controls of "
"""Before the label of an episode whose stored controls are driven again."""


def digest(pieces: Iterable[bytes]) -> str:
    found = hashlib.blake2b(digest_size=8)
    for piece in pieces:
        found.update(len(piece).to_bytes(8, "little") + piece)
    return found.hexdigest()


def facts_of(result: EpisodeResult) -> bytes:
    """Return every number of an episode but times on the clock, bit for bit."""
    told = (
        result.outcome.value, result.end.value, result.end_detail, result.route_completion_pct.hex(),
        result.route_length_m.hex(), result.infractions, [ratio.hex() for ratio in result.speed_ratios_pct],
        result.schedule, result.junction_passed, result.reception, driving_score(result).hex(),
        repr(efficiency(result)), repr(comfort(result)),
    )  # fmt: skip
    given = b"" if result.given is None else result.given.rows.tobytes()
    return repr(told).encode() + result.trace.rows.tobytes() + given


def libraries() -> dict[str, str]:
    """Return digests of what the libraries compute where they choose their code by the processor.

    A switch that changes none of these has no effect here.
    """
    line = np.arange(-3000, 3001) * 0.001 + 1e-5
    wave = np.array([((k * 7919) % 1000) / 1000.0 for k in range(90_000)]).reshape(300, 300)
    scalars = [(math.sin(x), math.exp(x), math.tan(x), math.atan(x), abs(x) ** 0.7) for x in line.tolist()]
    narrow = line.astype(np.float32)
    waves = [np.sin(line), np.exp(line), np.exp(narrow), np.sin(narrow), np.log(np.abs(narrow)), np.tanh(line)]
    picture = (wave * 255.0).astype(np.float32)
    warp = np.array([[1.01, 0.02, 0.3], [-0.013, 0.97, 0.6]])
    opencv = [cv2.GaussianBlur(picture, (7, 7), 1.3), cv2.warpAffine(picture, warp, (300, 300)), cv2.exp(picture / 99)]
    return {
        "libm": digest([np.array(scalars).tobytes()]),
        "numpy": digest(values.tobytes() for values in waves),
        "BLAS": digest([(wave[:37, :37] @ wave[:37, 37]).tobytes(), (wave @ wave.T).tobytes()]),
        "OpenCV": digest(values.tobytes() for values in opencv),
        "OpenCV code": cv2.getCPUFeaturesLine(),
        "numba": _compiled(),
        "threads": str((cv2.getNumThreads(), numba.get_num_threads())),
    }


def _compiled() -> str:
    """Return the widest registers of a compiled kernel, and whether numba may fuse products with sums."""

    @uncached_entry
    def scaled(values: Any) -> None:
        for k in range(len(values)):
            values[k] = values[k] * 1.5 + 0.5

    scaled(np.zeros(8))
    kernel: Any = scaled
    text = kernel.inspect_asm(kernel.signatures[0])
    registers = [name for name in ("xmm", "ymm", "zmm") if f"%{name}" in text]
    return f"{registers[-1]} {'fused' if 'fmadd' in text else 'not fused'}"


def drive(agent: Any, name: str, *, route: Any, setting: str, ticks: int | None) -> EpisodeResult:
    options = SimulatorOptions(tick_cap=4000 if ticks is None else ticks)
    return drive_episode(
        EmbeddedSimulator(options), agent, route=route, setting=Setting.parse(setting), seed=0, agent_name=name
    )


def labels_of(order: dict[str, Any]) -> list[str]:
    """Return `agent | route | setting` of every episode of an order, and of every stored one that is driven again."""
    routes = resolve_routes(order["routes"])[:: order.get("every", 1)]
    own = [
        f"{name} | {route.id} | {setting}"
        for name in order["agents"]
        for route in routes
        for setting in order["settings"]
    ]
    return own + [f"{STORED}{label}" for label in order.get("stored", {})]


def driven(order: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """Yield what came of each episode of the order (or of its `labels` alone), then what the libraries compute."""
    routes = {route.id: route for route in resolve_routes(order["routes"])}
    agents: dict[str, Any] = {}
    for label in order.get("labels", labels_of(order)):
        name, route_id, setting = label.removeprefix(STORED).split(" | ")
        if label.startswith(STORED):
            earlier = decode_episode(base64.b64decode(order["stored"][label.removeprefix(STORED)]))
            told = {"route": routes[route_id], "setting": "clean", "ticks": order.get("ticks")}
            again = drive(StoredControls.of(earlier), "stored", **told)
            yield {"label": label, "digest": difference(again, earlier) or "the same"}
            continue
        if name not in agents:
            agents[name] = OWN[name]() if name in OWN else default_registry().agent(name)
        yield _driven(agents[name], label, routes[route_id], setting, order)
    yield {"libraries": libraries()}


def _driven(agent: Any, label: str, route: Any, setting: str, order: dict[str, Any]) -> dict[str, Any]:
    name = label.split(" | ")[0]
    result = drive(agent, name, route=route, setting=setting, ticks=order.get("ticks"))
    if result.end.name == "SIMULATION_CRASHED":
        raise SystemExit(f"{label}: {result.end_detail}")
    seen = agent.seen.digest() if isinstance(agent, Watcher) else b""
    found = {"label": label, "digest": digest([facts_of(result), seen]), "score": driving_score(result)}
    if name in order.get("keep", ()):
        found["stored"] = base64.b64encode(encode_episode(result)).decode()
    return found


if __name__ == "__main__":
    text = Path(sys.argv[1][1:]).read_text() if sys.argv[1].startswith("@") else sys.argv[1]
    for line in driven(json.loads(text)):
        print(json.dumps(line), flush=True)
