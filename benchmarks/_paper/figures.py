"""Draw the paper's figures from driven episodes in both readings, beside the paper's numbers, as texts of SVGs.

Figures have a white card, so that light and dark pages look alike. Colours are those of Okabe and Ito, and the colour
map's lightness falls with RD, so that no information depends on hue alone. Equal results give equal bytes.
"""

from __future__ import annotations

import io
import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from _paper.estimates import IntervalEstimate, degradation, driving_score
from _paper.published import AGENTS, CLEAN, FAMILIES, PUBLISHED, SETTINGS, SHORT, published_average
from _paper.readings import NO_LATENCY, READINGS, Drives
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
_PAPER = "the paper\n(CARLA, original networks)"
_PAPER_COLOUR = "#444444"
_RADAR_MARKERS = dict(zip(READINGS, ("o", "s"), strict=True))
_RADAR_LINES = dict(zip(READINGS, ("-", ":"), strict=True))
_LATENCY_MS = {row: int(row.split()[0]) for row in (NO_LATENCY, *FAMILIES["latency"])}
_MOST_KEPT = 1.25
"""End of the radar's axes, unless an agent keeps an even larger share."""

_LOWEST_RD = -1.0
"""Drawn end of intervals without a lower end."""

_Cell = IntervalEstimate | float | None


def heat_map(results: Results) -> str:
    """Draw RD of every agent and setting, ours in both readings with intervals, then the paper's; return an SVG."""
    with mpl.rc_context(_STYLE):
        figure = Figure(figsize=(13.0, 5.8), layout="constrained")
        panels = figure.subplots(1, 1 + len(READINGS), sharey=True)
        names = _narrow(results)
        for axes, reading in zip(panels, READINGS, strict=False):
            _heat_panel(axes, _here(results, reading), names, partial(_row_degradation, Drives(results, reading)))
        image = _heat_panel(panels[-1], _PAPER, AGENTS, lambda agent, setting: PUBLISHED[agent][setting].rd)
        figure.colorbar(image, ax=list(panels), label="RD = 1 - DS / DS clean", shrink=0.7)
        return _svg(figure)


def _row_degradation(drives: Drives, agent: str, row: str) -> IntervalEstimate | None:
    return degradation(drives, agent, (row,))


def _called(results: Results, agent: str) -> str:
    """Return the agent's name with its options, as it is called."""
    driven = results.agents.get(agent)
    return agent if driven is None else driven.called


def _narrow(results: Results) -> list[str]:
    """Return the agents' names with their options, in lines that fit under a column."""
    called = [_called(results, agent) for agent in AGENTS]
    return [name.replace(":", "\n").replace(",", "\n").replace("=", "=\n") for name in called]


def _heat_panel(axes: Axes, title: str, names: Sequence[str], cell_of: Callable[[str, str], _Cell]) -> AxesImage:
    cells = [[cell_of(agent, setting) for agent in AGENTS] for setting in SETTINGS]
    values = [[math.nan if cell is None else _value(cell) for cell in row] for row in cells]
    image = axes.imshow(values, cmap="YlOrBr", vmin=0.0, vmax=1.0, aspect="auto")
    for y, row in enumerate(cells):
        for x, cell in enumerate(row):
            _heat_text(axes, x, y, cell)
    for end in _family_ends():
        axes.axhline(end - 0.5, color="white", linewidth=5)
    axes.set_title(title)
    axes.set_xticks(range(len(AGENTS)), names)
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
        interval = f"{cell.low:.2f} to {cell.high:.2f}"  # the sign of -0.00 shows that the interval holds 0
        axes.text(x, y + 0.24, interval, ha="center", va="center", color=colour, fontsize=7.5)


def retention_radar(results: Results) -> str:
    """Draw the share of clean DS that each agent keeps under every setting, both readings, the paper's dashed."""
    with mpl.rc_context(_STYLE):
        figure = Figure(figsize=(9.6, 10.4), layout="constrained")
        panels = figure.subplots(2, 2, subplot_kw={"projection": "polar"})
        for axes, agent in zip(panels.flat, AGENTS, strict=True):
            _radar_panel(axes, agent, results)
        handles = [
            Line2D([], [], color=_PAPER_COLOUR, linewidth=2, marker=_RADAR_MARKERS[reading], markerfacecolor=face,
                   linestyle=_RADAR_LINES[reading], label=_here(results, reading).replace("\n", " "))
            for reading, face in zip(READINGS, (_PAPER_COLOUR, "white"), strict=True)
        ]  # fmt: skip
        handles.append(
            Line2D([], [], color=_PAPER_COLOUR, linewidth=1.4, linestyle="--", label=_PAPER.replace("\n", " "))
        )
        figure.suptitle("Share of the clean DS that is kept")
        figure.legend(handles=handles, loc="outside lower center", ncols=2, frameon=False)
        return _svg(figure)


def _radar_panel(axes: Axes, agent: str, results: Results) -> None:
    axes.set(theta_offset=math.pi / 2.0, theta_direction=-1)
    angles = [2.0 * math.pi * place / len(SETTINGS) for place in range(len(SETTINGS))]
    farthest = [
        _radar_line(axes, agent, angles, Drives(results, reading))
        for reading in reversed(READINGS)  # draws the first reading on top
    ]
    paper = [1.0 - PUBLISHED[agent][setting].rd for setting in SETTINGS]
    axes.plot(_closed(angles), _closed(paper), color=_PAPER_COLOUR, linestyle="--", linewidth=1.4)
    axes.set_xticks(angles, [SHORT[setting].replace(" ", "\n", 1) for setting in SETTINGS])
    axes.tick_params(axis="x", pad=13)
    axes.set_yticks((0.25, 0.5, 0.75, 1.0), ("", "0.5", "", "1"))
    axes.set_ylim(0.0, max(_MOST_KEPT, *farthest))
    axes.set_title(_called(results, agent) if any(farthest) else f"{agent} (not driven)",
                   pad=16, fontweight="bold")  # fmt: skip
    axes.grid(color="#cccccc", linewidth=0.7)


def _radar_line(axes: Axes, agent: str, angles: Sequence[float], drives: Drives) -> float:
    """Draw one reading, with a line only if all settings were driven; return its largest value, 0 without a point."""
    driven = [degradation(drives, agent, (row,)) for row in SETTINGS]
    known = [(angle, rd) for angle, rd in zip(angles, driven, strict=True) if rd is not None]
    if not known:
        return 0.0
    colour = _COLOURS[agent]
    around, kept = [angle for angle, _ in known], [1.0 - rd.value for _, rd in known]
    lows, highs = [1.0 - rd.high for _, rd in known], [1.0 - max(rd.low, _LOWEST_RD) for _, rd in known]
    face, size = (colour, 4.0) if drives.reading == READINGS[0] else ("white", 7.0)
    axes.vlines(around, lows, highs, color=colour, linewidth=1.4)
    axes.plot(around, kept, linestyle="", marker=_RADAR_MARKERS[drives.reading], markersize=size, color=colour,
              markerfacecolor=face)  # fmt: skip
    if len(known) == len(driven):
        if drives.reading == READINGS[0]:
            axes.fill(around, kept, color=colour, alpha=0.16, linewidth=0)
        axes.plot(
            _closed(around),
            _closed(kept),
            color=colour,
            linewidth=2.0,
            linestyle=_RADAR_LINES[drives.reading],
            zorder=1.9,
        )
    return max(0.05 + share for share in kept)


def latency_curves(results: Results) -> str:
    """Draw DS and RD by latency, and DS clean beside its mean over latency: ours in both readings, then the paper's."""
    with mpl.rc_context(_STYLE):
        figure = Figure(figsize=(13.0, 10.2), layout="constrained")
        panels = figure.subplots(3, 1 + len(READINGS), sharey="row")
        for (score, lost, bars), reading in zip(panels.T, READINGS, strict=False):
            _latency_column(score, lost, bars, Drives(results, reading))
            score.set_title(_here(results, reading))
        _published_column(*panels[:, -1])
        panels[0, -1].set_title(_PAPER)
        panels[0, 0].set(ylabel="driving score", ylim=(0.0, 100.0))
        panels[1, 0].set_ylabel("RD")
        panels[2, 0].set(ylabel="driving score", ylim=(0.0, 110.0), yticks=range(0, 101, 20))
        for axes in panels[:2].flat:
            axes.set(xlabel="latency [ms]", xticks=list(_LATENCY_MS.values()))
        for axes in panels.flat:
            axes.set_axisbelow(True)
            axes.grid(color="#dddddd", linewidth=0.7, axis="y" if axes in panels[2] else "both")
            axes.spines[["top", "right"]].set_visible(False)
        lines = panels[0, -1].get_lines()
        figure.legend(handles=[*lines, *_bar_key()], loc="outside lower center", ncols=len(lines) + 2, frameon=False)
        return _svg(figure)


def _latency_column(score: Axes, lost: Axes, bars: Axes, drives: Drives) -> None:
    for agent in AGENTS:
        _curve(score, agent, [driving_score(drives, agent, (row,)) for row in _LATENCY_MS])
        _curve(lost, agent, [_lost(drives, agent, row) for row in _LATENCY_MS])
    _bars(
        bars,
        _narrow(drives.results),
        [driving_score(drives, agent, (NO_LATENCY,)) for agent in AGENTS],
        [driving_score(drives, agent, FAMILIES["latency"]) for agent in AGENTS],
        [degradation(drives, agent, FAMILIES["latency"]) for agent in AGENTS],
    )
    missing = [agent for agent in AGENTS if drives.scores(agent, NO_LATENCY) is None]
    if missing:
        score.text(250.0, 5.0, f"not driven: {', '.join(missing)}", ha="center", color="#666666")


def _published_column(score: Axes, lost: Axes, bars: Axes) -> None:
    for agent in AGENTS:
        rows = [PUBLISHED[agent][CLEAN], *(PUBLISHED[agent][setting] for setting in FAMILIES["latency"])]
        _curve(score, agent, [_exact(row.ds) for row in rows])
        _curve(lost, agent, [_exact(row.rd) for row in rows])
    averages = [published_average(agent, FAMILIES["latency"]) for agent in AGENTS]
    clean = [_exact(PUBLISHED[agent][CLEAN].ds) for agent in AGENTS]
    _bars(bars, AGENTS, clean, [_exact(row.ds) for row in averages], [_exact(row.rd) for row in averages])


def _bars(
    axes: Axes,
    names: Sequence[str],
    clean: Sequence[IntervalEstimate | None],
    delayed: Sequence[IntervalEstimate | None],
    lost: Sequence[IntervalEstimate | None],
) -> None:
    """Draw two bars for each agent, DS clean and its mean over latency, and write the mean RD above them."""
    for beside, alpha, cells in ((-0.2, 0.35, clean), (0.2, 1.0, delayed)):
        for place, (agent, cell) in enumerate(zip(AGENTS, cells, strict=True)):
            if cell is not None:
                axes.bar(place + beside, cell.value, width=0.36, color=_COLOURS[agent], alpha=alpha)
                axes.vlines(place + beside, cell.low, cell.high, color="#222222", linewidth=1.4)
    for place, (rd, *cells) in enumerate(zip(lost, clean, delayed, strict=True)):
        if rd is None:
            axes.text(place, 4.0, "not driven", ha="center", color="#666666", fontsize=8)
        else:
            top = max(cell.high for cell in cells if cell is not None)
            axes.text(place, top + 2.0, f"RD {_two_digits(rd.value)}", ha="center", fontsize=9)
    axes.set_xticks(range(len(AGENTS)), names)
    axes.set_xlim(-0.5, len(AGENTS) - 0.5)


def _bar_key() -> list[Patch]:
    return [
        Patch(color=_PAPER_COLOUR, alpha=alpha, label=label)
        for alpha, label in ((0.35, "clean"), (1.0, "avg. latency"))
    ]


def _curve(axes: Axes, agent: str, cells: Sequence[IntervalEstimate | None]) -> None:
    """Draw one agent's line, broken at missing drives; shifted a little, so that intervals do not overlap."""
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


def _lost(drives: Drives, agent: str, row: str) -> IntervalEstimate | None:
    """Return RD, which is 0 without latency by definition."""
    if row == NO_LATENCY:
        return None if drives.scores(agent, row) is None else _exact(0.0)
    return degradation(drives, agent, (row,))


def _here(results: Results, reading: str) -> str:
    return f"here, reading {reading}\n({len(results.routes)} routes, 95 % intervals)"


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
