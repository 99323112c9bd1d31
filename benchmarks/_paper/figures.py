"""The paper's figures from driven episodes, beside the same from the paper's own numbers, each as the text of an SVG.

A white card, so that they read the same on a light and on a dark page; colours of Okabe and Ito, and a map whose
lightness falls with RD, so that nothing hangs on hue alone. The same results give the same bytes.
"""

from __future__ import annotations

import io
import math
from collections.abc import Callable, Sequence
from typing import Any

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from matplotlib.lines import Line2D

from _paper.estimates import IntervalEstimate, degradation, driving_score
from _paper.published import AGENTS, CLEAN, FAMILIES, PUBLISHED, SETTINGS, SHORT
from _paper.results import Results

__all__ = ["heat_map", "latency_curves", "retention_radar"]

_STYLE: dict[Any, Any] = {
    "font.size": 11,
    "axes.titlesize": 12,
    "axes.edgecolor": "#666666",
    "axes.linewidth": 0.8,
    "text.color": "#222222",
    "axes.labelcolor": "#222222",
    "xtick.color": "#222222",
    "ytick.color": "#222222",
    "figure.constrained_layout.h_pad": 0.12,
    "figure.constrained_layout.w_pad": 0.12,
    "svg.hashsalt": "drive-robust",
}
_COLOURS = {"tcp": "#0072B2", "uniad": "#D55E00", "vad": "#009E73", "simlingo": "#CC79A7"}
_MARKERS = {"tcp": "o", "uniad": "s", "vad": "^", "simlingo": "D"}
_PAPER = "paper (CARLA, original networks)"
_PAPER_COLOUR = "#444444"
_LATENCY_MS = {CLEAN: 0, **{setting: int(setting.split()[0]) for setting in FAMILIES["latency"]}}
_MOST_KEPT = 1.25
"""Where the radar ends, unless an agent drives even better under a failure than that."""

_LOWEST_RD = -1.0
"""Where intervals end that have no lower end."""

_Cell = IntervalEstimate | float | None


def heat_map(results: Results) -> str:
    """Draw RD of every agent and setting, ours with intervals left, the paper's right."""
    with mpl.rc_context(_STYLE):
        figure = Figure(figsize=(9.6, 5.8), layout="constrained")
        left, right = figure.subplots(1, 2, sharey=True)
        _heat_panel(left, _here(results), lambda agent, setting: degradation(results, agent, setting))
        image = _heat_panel(right, _PAPER, lambda agent, setting: PUBLISHED[agent][setting].rd)
        figure.colorbar(image, ax=[left, right], label="RD = 1 - DS / DS clean", shrink=0.7)
        return _svg(figure)


def _heat_panel(axes: Axes, title: str, cell_of: Callable[[str, str], _Cell]) -> AxesImage:
    cells = [[cell_of(agent, setting) for agent in AGENTS] for setting in SETTINGS]
    values = [[math.nan if cell is None else _value(cell) for cell in row] for row in cells]
    image = axes.imshow(values, cmap="YlOrBr", vmin=0.0, vmax=1.0, aspect="auto")
    for y, row in enumerate(cells):
        for x, cell in enumerate(row):
            _heat_text(axes, x, y, cell)
    for end in _family_ends():
        axes.axhline(end - 0.5, color="white", linewidth=5)
    axes.set_title(title)
    axes.set_xticks(range(len(AGENTS)), AGENTS)
    axes.set_yticks(range(len(SETTINGS)), [SHORT[setting] for setting in SETTINGS])
    axes.tick_params(length=0)
    axes.spines[:].set_visible(False)
    return image


def _heat_text(axes: Axes, x: int, y: int, cell: _Cell) -> None:
    if cell is None:
        axes.text(x, y, "not driven", ha="center", va="center", color="#767676", fontsize=8)
        return
    colour = "white" if _value(cell) > 0.70 else "#222222"
    lift = 0.15 if isinstance(cell, IntervalEstimate) else 0.0
    axes.text(x, y - lift, _two_digits(_value(cell)), ha="center", va="center", color=colour)
    if isinstance(cell, IntervalEstimate):
        interval = f"{_two_digits(cell.low)} to {_two_digits(cell.high)}"
        axes.text(x, y + 0.24, interval, ha="center", va="center", color=colour, fontsize=7.5)


def retention_radar(results: Results) -> str:
    """Draw what each agent keeps of its clean DS under every setting: ours filled, the paper's dashed."""
    with mpl.rc_context(_STYLE):
        figure = Figure(figsize=(9.6, 10.0), layout="constrained")
        panels = figure.subplots(2, 2, subplot_kw={"projection": "polar"})
        for axes, agent in zip(panels.flat, AGENTS, strict=True):
            _radar_panel(axes, agent, [degradation(results, agent, setting) for setting in SETTINGS])
        ours = Line2D([], [], color=_PAPER_COLOUR, linewidth=2, marker="o", label=_here(results))
        paper = Line2D([], [], color=_PAPER_COLOUR, linewidth=1.4, linestyle="--", label=_PAPER)
        figure.suptitle("Share of the clean DS that is kept")
        figure.legend(handles=[ours, paper], loc="outside lower center", ncols=2, frameon=False)
        return _svg(figure)


def _radar_panel(axes: Axes, agent: str, driven: Sequence[IntervalEstimate | None]) -> None:
    """Draw the line of an agent only when it drove under all settings."""
    angles = [2.0 * math.pi * place / len(driven) for place in range(len(driven))]
    known = [(angle, rd) for angle, rd in zip(angles, driven, strict=True) if rd is not None]
    axes.set(theta_offset=math.pi / 2.0, theta_direction=-1)
    if known:
        kept = [1.0 - rd.value for _, rd in known]
        around = [angle for angle, _ in known]
        look: dict[str, Any] = {"color": _COLOURS[agent], "linewidth": 2.0}
        lows, highs = [1.0 - rd.high for _, rd in known], [1.0 - max(rd.low, _LOWEST_RD) for _, rd in known]
        axes.vlines(around, lows, highs, color=_COLOURS[agent], linewidth=1.4)
        axes.plot(around, kept, marker="o", markersize=4.5, linestyle="", **look)
        if len(known) == len(driven):
            axes.fill(around, kept, color=_COLOURS[agent], alpha=0.16, linewidth=0)
            axes.plot(_closed(around), _closed(kept), **look)
    paper = [1.0 - PUBLISHED[agent][setting].rd for setting in SETTINGS]
    axes.plot(_closed(angles), _closed(paper), color=_PAPER_COLOUR, linestyle="--", linewidth=1.4)
    axes.set_xticks(angles, [SHORT[setting].replace(" ", "\n", 1) for setting in SETTINGS])
    axes.tick_params(axis="x", pad=13)
    axes.set_yticks((0.25, 0.5, 0.75, 1.0), ("", "0.5", "", "1"))
    axes.set_ylim(0.0, max([_MOST_KEPT, *(1.05 - rd.value for _, rd in known)]))
    axes.set_title(agent if known else f"{agent} (not driven)", pad=16, fontweight="bold")
    axes.grid(color="#cccccc", linewidth=0.7)


def latency_curves(results: Results) -> str:
    """Draw DS and RD by latency, ours with 95 % intervals in the left column, the paper's in the right one."""
    with mpl.rc_context(_STYLE):
        figure = Figure(figsize=(9.6, 7.2), layout="constrained")
        (score, paper_score), (lost, paper_lost) = figure.subplots(2, 2, sharex=True, sharey="row")
        for agent in AGENTS:
            rows = [PUBLISHED[agent][setting] for setting in _LATENCY_MS]
            _curve(paper_score, agent, [_exact(row.ds) for row in rows])
            _curve(paper_lost, agent, [_exact(row.rd) for row in rows])
            _curve(score, agent, [driving_score(results, agent, setting) for setting in _LATENCY_MS])
            _curve(lost, agent, [_lost(results, agent, setting) for setting in _LATENCY_MS])
        score.set(title=_here(results), ylabel="driving score", ylim=(0.0, 100.0))
        paper_score.set(title=_PAPER)
        missing = [agent for agent in AGENTS if agent not in results.agents]
        if missing:
            score.text(250.0, 5.0, f"not driven: {', '.join(missing)}", ha="center", color="#666666")
        lost.set(ylabel="RD", xlabel="latency [ms]", xticks=list(_LATENCY_MS.values()))
        paper_lost.set(xlabel="latency [ms]")
        for axes in (score, paper_score, lost, paper_lost):
            axes.grid(color="#dddddd", linewidth=0.7)
            axes.spines[["top", "right"]].set_visible(False)
        figure.legend(handles=paper_score.get_lines(), loc="outside lower center", ncols=len(AGENTS), frameon=False)
        return _svg(figure)


def _curve(axes: Axes, agent: str, cells: Sequence[IntervalEstimate | None]) -> None:
    """Draw one agent's line, broken where it was not driven. Lines are set apart a little, or intervals overlap."""
    beside = 4.0 * (AGENTS.index(agent) - 1.5)
    places = [ms + beside for ms in _LATENCY_MS.values()]
    known = [(place, cell) for place, cell in zip(places, cells, strict=True) if cell is not None]
    lows = [max(cell.low, _LOWEST_RD) for _, cell in known]
    axes.vlines(
        [place for place, _ in known], lows, [cell.high for _, cell in known], color=_COLOURS[agent], linewidth=1.4
    )
    look: dict[str, Any] = {"color": _COLOURS[agent], "marker": _MARKERS[agent], "markersize": 5, "label": agent}
    axes.plot(places, [math.nan if cell is None else cell.value for cell in cells], **look)


def _exact(value: float) -> IntervalEstimate:
    return IntervalEstimate(value, value, value)


def _lost(results: Results, agent: str, setting: str) -> IntervalEstimate | None:
    """Return RD, which is 0 without latency by definition."""
    if setting == CLEAN:
        return _exact(0.0) if agent in results.agents else None
    return degradation(results, agent, setting)


def _here(results: Results) -> str:
    return f"here ({len(results.routes)} routes, 95 % intervals)"


def _family_ends() -> list[int]:
    ends = [0]
    for family in FAMILIES.values():
        ends.append(ends[-1] + len(family))
    return ends[1:-1]


def _value(cell: IntervalEstimate | float) -> float:
    return cell.value if isinstance(cell, IntervalEstimate) else cell


def _two_digits(value: float) -> str:
    return "0.00" if f"{value:.2f}" == "-0.00" else f"{value:.2f}"


def _closed(values: Sequence[float]) -> list[float]:
    return [*values, values[0]]


def _svg(figure: Figure) -> str:
    file = io.StringIO()
    figure.savefig(file, format="svg", facecolor="white", metadata={"Date": None})
    return file.getvalue()
