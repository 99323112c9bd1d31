"""Draw every picture of the site and of the README: `python docs/pictures.py [NAME ...]`, all without names.

They are drawn from episodes of the embedded world, so they come out the same on any machine but for the compression;
`tests/docs/test_pictures.py` draws some of them again and looks whether they are still what the code shows.
"""

from __future__ import annotations

import argparse
import io
import math
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import cv2
import numpy as np
from PIL import Image

from pytest_drive_robust import CameraSpec, Setting
from pytest_drive_robust.metrics.score import is_success
from pytest_drive_robust.perturbations import BUILTIN
from pytest_drive_robust.registry.registry import default_registry
from pytest_drive_robust.report.film.canvas import BACKGROUND, CLEAN, Rectangle, fill, text
from pytest_drive_robust.report.film.film import Film
from pytest_drive_robust.runner.replay.recording import Tape, record_episode
from pytest_drive_robust.simulators.embedded.route_scene import telling_moment
from pytest_drive_robust.simulators.embedded.route_sheet import draw_tile
from pytest_drive_robust.simulators.embedded.simulator import EmbeddedSimulator
from pytest_drive_robust.simulators.routes import resolve_routes
from pytest_drive_robust.stats import gate

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Pixels = NDArray[np.uint8]


class Case(NamedTuple):
    """A film of one episode beside its clean twin, from `from_s` to `until_s` of the drive."""

    agent: str
    route: str
    setting: str
    from_s: float = 0.0
    until_s: float = math.inf


FOLDER = Path(__file__).parent / "pictures"
FAILURES = {
    "burst-frame-drop": "3 s burst frame drop",
    "partial-observation": "occlusion 0.5",
    "gps-noise": "GPS noise 5 m",
    "speed-noise": "speed noise 0.2",
    "inference-latency": "500 ms latency",
    "sensor-delay": "500 ms sensor delay",
    "frame-blend": "10 frame blend",
}
"""One sentence for each failure of the gallery, by the name of its class."""
FAILURE_ROUTE = "2701"
README_FILM = Case("classical", "2701", "3 s burst frame drop")
"""Agent, route and setting of the film on the first page."""
CASES = {
    "burst": Case("simlingo", "4001", "3 s burst frame drop", until_s=8.0),
    "occlusion": Case("simlingo", "2401", "occlusion 0.5"),
    "gps": Case("tcp", "4001", "GPS noise 15 m", from_s=3.0, until_s=20.0),
    "speed": Case("simlingo", "2701", "speed noise 0.5"),
    "latency": Case("simlingo", "2501", "500 ms latency (reading=released)", from_s=5.0),
}
"""The film of each case study of the gallery, by its failure."""
LEARNED_AGENTS = ("tcp", "simlingo", "uniad", "vad")
_AT_WORK_S = 4.0
_STUDIES = 400
_TRUE_RD = tuple(number / 40.0 for number in range(29))
"""0 to 0.7: what the agent would lose over all routes of the kind."""
_TILE_PX, _FILM_PX, _FILM_HZ = 300, 960, 5
_STILL_QUALITY, _FILM_QUALITY = 80, 50


def scenario(route_id: str) -> Pixels:
    """Draw the route of a scenario from above, at the moment its scenario is on, with what a camera sees."""
    (route,) = resolve_routes(route_id)
    return draw_tile(telling_moment(route), size_px=_TILE_PX, camera=CameraSpec("front"))


def tapes(agent: str, route_id: str, *settings: str) -> tuple[Tape, ...]:
    """Drive a route under each of the settings."""
    (route,) = resolve_routes(route_id)
    simulator = EmbeddedSimulator()
    return tuple(
        record_episode(
            simulator,
            default_registry().agent(agent),
            route=route,
            setting=Setting.parse(setting),
            seed=0,
            agent_name=agent,
        )
        for setting in settings
    )


def film(case: Case) -> Iterator[Pixels]:
    """Yield the pictures of the film of a case, a few in a second. Raises `ValueError` where nothing is to be seen."""
    clean, perturbed = tapes(case.agent, case.route, "clean", case.setting)
    if not is_success(clean.result) or is_success(perturbed.result):
        raise ValueError(f"{case}: the agent should succeed clean and not under the failure; choose another route")
    shown = Film(clean, perturbed)
    positions = [at for at in shown.positions if case.from_s <= at * shown.dt_s <= case.until_s]
    for position in positions[:: round(1.0 / _FILM_HZ / shown.dt_s)]:
        yield _scaled(shown.picture(position), _FILM_PX)


def _scaled(picture: Pixels, width: int) -> Pixels:
    height = round(picture.shape[0] * width / picture.shape[1])
    return np.asarray(cv2.resize(picture, (width, height), interpolation=cv2.INTER_AREA), np.uint8)


def _write_still(name: str, picture: Pixels) -> Path:
    path = FOLDER / f"{name}.webp"
    path.parent.mkdir(parents=True, exist_ok=True)
    Image.fromarray(picture).save(path, quality=_STILL_QUALITY, method=6)
    return path


def _write_film(name: str, pictures: Iterator[Pixels]) -> Path:
    path = FOLDER / f"{name}.webp"
    path.parent.mkdir(parents=True, exist_ok=True)
    first, *others = map(Image.fromarray, pictures)
    first.save(
        path, save_all=True, append_images=others, duration=1000 // _FILM_HZ, loop=0, quality=_FILM_QUALITY, method=6
    )
    return path


def failure(sentence: str) -> Pixels:
    """Draw the moment of a drive at which a failure is at work, beside the same moment of the clean drive."""
    clean, perturbed = tapes("classical", FAILURE_ROUTE, "clean", sentence)
    shown = Film(clean, perturbed)
    # in the last moment nothing is looked at any more
    at_work = range(round(_AT_WORK_S / shown.dt_s), min(len(clean.moments), len(perturbed.moments)) - 1)
    oldest = max(at_work, key=lambda at: (_age_ticks(perturbed, at), -at))
    position = oldest if _age_ticks(perturbed, oldest) > 1 else at_work[0]
    return _scaled(shown.picture(position), _FILM_PX)


def _age_ticks(tape: Tape, at: int) -> int:
    """Return how old the picture is that the agent is given."""
    images = tape.images(at)
    return tape.moments[at].state.tick - images[next(iter(images))][1] if images else 0


def agents() -> Pixels:
    """Draw the four learned agents at one moment of the same route, two in a row."""
    panes = []
    for name in LEARNED_AGENTS:
        (tape,) = tapes(name, FAILURE_ROUTE, "clean")
        picture = Film(tape).picture(round(_AT_WORK_S / tape.result.dt_s))
        fill(picture, Rectangle(320, 34, 300, 28), CLEAN)
        text(picture, name, (330, 55), size=0.7, bold=True, colour=BACKGROUND)
        panes.append(picture[34:463, 320:960])
    return _scaled(np.vstack([np.hstack(panes[:2]), np.hstack(panes[2:])]), _FILM_PX)


def verdicts() -> str:
    """Plot how often a verdict passes, fails or stays open, by what is true, as an SVG: the study of the tests."""
    import matplotlib as mpl
    from matplotlib.figure import Figure

    sys.path.insert(0, str(FOLDER.parents[1] / "tests" / "calibration"))
    from score_model import draw_pairs
    from study import judge_all

    with mpl.rc_context({"font.size": 11, "svg.hashsalt": "drive-robust"}):
        figure = Figure(figsize=(9, 3.6), layout="constrained")
        for axes, routes in zip(figure.subplots(1, 2, sharey=True), (44, 220), strict=True):
            found = [
                judge_all(gate, draw_pairs("mid", rd, studies=_STUDIES, routes=routes, seed=number), 0.30, 0.10)
                for number, rd in enumerate(_TRUE_RD)
            ]
            passes, fails = [item.passes for item in found], [item.fails for item in found]
            still_open = [1.0 - one - other for one, other in zip(passes, fails, strict=True)]
            axes.stackplot(
                _TRUE_RD,
                passes,
                still_open,
                fails,
                labels=("pass", "inconclusive", "fail"),
                colors=("#009E73", "#E8E4D8", "#D55E00"),
            )
            for place, words in ((0.30, "limit"), (0.40, "limit + margin")):
                axes.axvline(place, color="#222222", linewidth=1.0, linestyle=":")
                axes.annotate(words, (place, 0.03), rotation=90, xytext=(3, 0), textcoords="offset points", fontsize=9)
            axes.set(title=f"{routes} routes", xlabel="true RD", xlim=(_TRUE_RD[0], _TRUE_RD[-1]), ylim=(0.0, 1.0))
            if routes == 44:
                axes.set_ylabel("share of verdicts")
                axes.legend(loc="center left", fontsize=9, framealpha=1.0)
        file = io.StringIO()
        figure.savefig(file, format="svg", facecolor="white", metadata={"Date": None})
        return file.getvalue()


def draw_agents() -> Iterator[Path]:
    """Draw the learned agents of the gallery."""
    yield _write_still("agents", agents())


def draw_verdicts() -> Iterator[Path]:
    """Plot the calibration of the verdicts."""
    path = FOLDER / "verdicts.svg"
    path.write_text(verdicts(), encoding="utf-8")
    yield path


def draw_scenarios() -> Iterator[Path]:
    """Draw the first route of each scenario type."""
    for route in resolve_routes("one-per-scenario"):
        yield _write_still(f"scenarios/{route.scenario.type}", scenario(route.id))


def draw_failures() -> Iterator[Path]:
    """Draw every failure of the gallery."""
    assert set(FAILURES) == set(BUILTIN)
    for name, sentence in FAILURES.items():
        yield _write_still(f"failures/{name}", failure(sentence))


def draw_readme() -> Iterator[Path]:
    """Film what the README and the first page show."""
    yield _write_film("readme", film(README_FILM))


def draw_cases() -> Iterator[Path]:
    """Film the case studies: agents with networks, whose bits another processor may change."""
    for name, case in CASES.items():
        yield _write_film(f"case-{name}", film(case))


def draw_tutorial() -> Iterator[Path]:
    """Film what the tutorial shows, with its own agent."""
    with tempfile.TemporaryDirectory() as folder:
        page = (FOLDER.parent / "tutorial.md").read_text(encoding="utf-8")
        code = page.partition("<!-- file: my_agent.py -->\n```python\n")[2].partition("```")[0]
        (Path(folder) / "my_agent.py").write_text(code, encoding="utf-8")
        sys.path.insert(0, folder)
        yield _write_film("tutorial", film(Case("my_agent:MyAgent", "603", "GPS noise 5 m", until_s=9.0)))


DRAWN: dict[str, Callable[[], Iterator[Path]]] = {
    "readme": draw_readme,
    "tutorial": draw_tutorial,
    "agents": draw_agents,
    "verdicts": draw_verdicts,
    "failures": draw_failures,
    "cases": draw_cases,
    "scenarios": draw_scenarios,
}
"""What can be drawn, by name."""


def main() -> None:
    """Draw what was named."""
    parser = argparse.ArgumentParser(description="Draw the pictures of the site.")
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"{', '.join(DRAWN)}; default: all")
    names = parser.parse_args().names or [*DRAWN]
    for name in names:
        if name not in DRAWN:
            parser.error(f"there is no picture named {name!r}. Known: {', '.join(DRAWN)}")
    for name in names:
        for path in DRAWN[name]():
            print(f"{path.relative_to(FOLDER.parent)}: {path.stat().st_size / 1000:.0f} kB")


if __name__ == "__main__":
    main()
