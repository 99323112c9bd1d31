"""The default simulator: our own 20 Hz world in arrays.

Modules: `towns` draws maps, `map` compiles maps and finds the ways through their junctions; `traced` builds roads
around routes of CARLA's towns; `dense_route` lays a route on its town (`matching` finds the lanes of the route);
`scenarios` puts `actors` on the `stage`, at `places` of the route; `state` names the arrays, `world` fills the arrays
of one episode, `kernels` advances the arrays by `light_programs` and rows of actors and judges each tick, `scoring`
reads what was judged; `sensors` and `camera` show the world to the agent, drawn by `drawing`; the runner drives
`simulator`, gymnasium drives `environment`.

`routes` names the sets of routes that ship, `route_xml` reads (each route by `route_element`) and writes route files,
`generate` draws new routes (`weave` adds lane changes), `route_scene` and `route_sheet` show a route as a picture.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pytest_drive_robust.simulators.embedded.simulator import EmbeddedSimulator

__all__ = ["EmbeddedSimulator"]


def __getattr__(name: str) -> object:
    # lazily: `routes` is read at collection, when nobody may import numba yet
    if name == "EmbeddedSimulator":
        from pytest_drive_robust.simulators.embedded.simulator import EmbeddedSimulator

        return EmbeddedSimulator
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
