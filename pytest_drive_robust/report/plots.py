"""Small plots as SVG, for reports that show pictures beside a failed test."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape

from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.metrics.episodes import route_and_seed
from pytest_drive_robust.metrics.score import driving_score
from pytest_drive_robust.report.numbers import legible
from pytest_drive_robust.verdict.explain import infraction_s
from pytest_drive_robust.verdict.infraction_words import infraction_words

_WIDTH, _HEIGHT, _LEFT, _TOP = 560, 300, 46, 30
_CLEAN, _PERTURBED = "#1f77c4", "#dd6b10"
_KEPT, _LOST = "#59626d", "#7d1a5e"
"""Whether a route kept its score: other colours than the two of clean and perturbed."""
_STYLE = "font:12px sans-serif;fill:#444;background:#fff"

Points = Sequence[tuple[float, float]]


def scores_svg(clean: Sequence[EpisodeResult], perturbed: Sequence[EpisodeResult]) -> str:
    """Return an SVG plot of each episode's driving score under a failure over the score of its clean twin."""
    twins = {route_and_seed(result): driving_score(result) for result in clean}
    pairs = [
        (twins[route_and_seed(result)], driving_score(result), result.episode.route_id)
        for result in perturbed
        if route_and_seed(result) in twins
    ]
    marks = [_path([(0.0, 0.0), (100.0, 100.0)], (100.0, 100.0), "#bbb")]
    for x, y, route_id in pairs:
        across, down = _place((x, y), (100.0, 100.0))
        title = f"<title>{_text(route_id)}: {x:.1f} clean, {y:.1f}</title>"
        colour = _LOST if y < x else _KEPT
        marks.append(f'<circle cx="{across}" cy="{down}" r="4" fill="{colour}" fill-opacity="0.6">{title}</circle>')
    return _chart("driving score by route: clean across, perturbed up", marks, (100.0, 100.0))


def speeds_svg(clean: EpisodeResult, perturbed: EpisodeResult) -> str:
    """Return an SVG plot of the speed of both egos over time, with a line at each infraction of the perturbed ego."""
    curves = []
    for result in (clean, perturbed):
        speeds = (3.6 * result.trace.column("speed_mps")).tolist()
        curves.append([((tick + 1) * result.dt_s, speed) for tick, speed in enumerate(speeds)])
    most = (max(clean.game_s, perturbed.game_s, 1.0), max(3.6, *(speed for curve in curves for _, speed in curve)))
    marks = [_path(curve, most, colour) for curve, colour in zip(curves, (_CLEAN, _PERTURBED), strict=True)]
    marks += [
        _path([(second, 0.0), (second, most[1])], most, "#c2255c", _text(infraction_words(item.detail)))
        for item in perturbed.infractions
        if (second := infraction_s(item, perturbed.dt_s)) is not None
    ]
    name = f"{perturbed.episode.route_id}: km/h over seconds, clean blue, perturbed orange"
    return _chart(name, marks, most)


def _chart(title: str, marks: Iterable[str], most: tuple[float, float]) -> str:
    frame = f'<rect x="{_LEFT}" y="{_TOP}" width="{_WIDTH}" height="{_HEIGHT}" fill="none" stroke="#999"/>'
    bottom = _TOP + _HEIGHT
    words = [
        (_LEFT, 18, "start", _text(title)),
        (_LEFT - 6, bottom, "end", "0"),
        (_LEFT - 6, _TOP + 10, "end", f"{most[1]:.4g}"),
        (_LEFT + _WIDTH, bottom + 16, "end", f"{most[0]:.4g}"),
    ]
    texts = "".join(f'<text x="{x}" y="{y}" text-anchor="{anchor}">{word}</text>' for x, y, anchor, word in words)
    size = f'viewBox="0 0 {_LEFT + _WIDTH + 14} {bottom + 24}"'
    return f'<svg xmlns="http://www.w3.org/2000/svg" {size} style="{_STYLE}">{frame}{texts}{"".join(marks)}</svg>\n'


def _text(words: str) -> str:
    """Return text for SVG: escaped, with lone surrogates and control characters spelled out."""
    return escape(legible(words))


def _path(points: Points, most: tuple[float, float], colour: str, title: str = "") -> str:
    places = " ".join(f"{across},{down}" for across, down in (_place(point, most) for point in points))
    return f'<polyline points="{places}" fill="none" stroke="{colour}"><title>{title}</title></polyline>'


def _place(point: tuple[float, float], most: tuple[float, float]) -> tuple[float, float]:
    across, up = (value / whole for value, whole in zip(point, most, strict=True))
    return round(_LEFT + across * _WIDTH, 1), round(_TOP + (1.0 - up) * _HEIGHT, 1)
