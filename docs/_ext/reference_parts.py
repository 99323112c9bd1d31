"""The parts of the reference that the code writes, each as reStructuredText: `.. generated:: NAME` inserts one."""

from __future__ import annotations

import argparse
import importlib
import inspect
import io
import json
import os
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import redirect_stdout, suppress
from dataclasses import fields
from pathlib import Path
from typing import Any
from unittest import mock

import pytest

import pytest_drive_robust as package
from pytest_drive_robust import errors, testing
from pytest_drive_robust.cli import main as cli
from pytest_drive_robust.domain.outcome import InfractionKind
from pytest_drive_robust.metrics.ability import ABILITIES
from pytest_drive_robust.metrics.score import PENALTIES
from pytest_drive_robust.metrics.table import METRICS
from pytest_drive_robust.options.execution import ExecutionOptions
from pytest_drive_robust.options.marker import MarkerOptions
from pytest_drive_robust.options.option import options_of
from pytest_drive_robust.options.run import RunOptions
from pytest_drive_robust.options.table import OPTIONS, Option
from pytest_drive_robust.perturbations import BUILTIN
from pytest_drive_robust.perturbations.base import Perturbation
from pytest_drive_robust.perturbations.ladder import Ladder, ladder_of
from pytest_drive_robust.registry.registry import KINDS, default_registry
from pytest_drive_robust.regression.options import RegressionOptions
from pytest_drive_robust.simulators.embedded.scenarios import SCENARIOS
from pytest_drive_robust.simulators.routes import resolve_routes

__all__ = ["ENVIRONMENT", "PARTS", "schema_file"]

_TICK_S = 0.05
_PROGRAMS = (
    ("pytest_drive_robust.simulators.embedded.generate",),
    ("pytest_drive_robust.bench2drive.evaluator.__main__", "run"),
    ("drive_robust_agents.training.__main__",),
)
"""Modules with a `main`, and the command of theirs that is shown."""
ENVIRONMENT: Mapping[str, str] = {
    "NUMBA_CACHE_DIR": "the folder that compiled kernels are kept in; else the user's cache folder",
    "XDG_CACHE_HOME": "where the user's cache folder is, as everywhere on Linux",
    "GITHUB_STEP_SUMMARY": "the file that the table is appended to; GitHub sets it",
    "GITHUB_TOKEN": "what ``drive-robust comment`` may write the comment with; without one it writes none",
    "GITHUB_EVENT_PATH": "the pull request that it comments on; GitHub sets it",
    "GITHUB_REPOSITORY": "the repository of that pull request; GitHub sets it",
    "GITHUB_API_URL": "where GitHub's interface is, for a server of one's own; GitHub sets it",
    "CI": "where it is set, ``drive-robust bless`` is refused",
    "RAY_ADDRESS": "the cluster of ``--drive-executor ray`` where ``--drive-ray-address`` says nothing",
    "IS_BENCH2DRIVE": "Bench2Drive's switch: an official agent is then given a name to save under, as officially",
    "CARLA_ROOT": "the folder of CARLA, for the official evaluator",
    "CUDA_VISIBLE_DEVICES": "the devices that Ray gives an episode: a worker with others is not used for it",
}
"""What this package reads beside the variables of the paper."""
_PASS = "stands in the lane. Change to the lane on the left, which is in use."
_BORROW = "stands in the lane. Drive around it through a gap of the oncoming traffic."
_SHARED: Mapping[str, str] = {
    "Accident": f"A police car with two crashed cars behind it {_PASS}",
    "AccidentTwoWays": f"A police car with two crashed cars behind it {_BORROW}",
    "ConstructionObstacle": f"A building site with sign, cones and barrier {_PASS}",
    "ConstructionObstacleTwoWays": f"A building site with sign, cones and barrier {_BORROW}",
    "HighwayExit": "Leave a motorway through a flow in the exit lane that stays slower than the road.",
    "InterurbanActorFlow": "Turn left off a country road, across an oncoming flow.",
    "InterurbanAdvancedActorFlow": "Turn left onto a country road, across one flow and into another.",
    "MergerIntoSlowTraffic": "Merge from a ramp into traffic that crawls.",
    "MergerIntoSlowTrafficV2": "Merge into the slow traffic of a lane that is only for the exit.",
    "ParkedObstacle": f"A badly parked car, hazard lights on, {_PASS}",
    "ParkedObstacleTwoWays": f"A badly parked car, hazard lights on, {_BORROW}",
    "SignalizedJunctionLeftTurn": (
        "Turn left across an oncoming flow that has green; the ego's light is red for five seconds first."
    ),
    "SignalizedJunctionLeftTurnEnterFlow": (
        "Turn left and join the oncoming flow that turns right into the same exit; red for five seconds, then green."
    ),
    "SignalizedJunctionRightTurn": (
        "Turn right into a flow from the left, which keeps its green; the ego's light is red for five seconds first."
    ),
    "NonSignalizedJunctionLeftTurn": "Turn left across an oncoming flow; no light holds it back.",
    "NonSignalizedJunctionLeftTurnEnterFlow": (
        "Turn left and join the oncoming flow that turns right into the same exit."
    ),
    "NonSignalizedJunctionRightTurn": "Turn right into a flow that comes from the left; nobody stops for the ego.",
    "EnterActorFlow": "Turn into a fast flow from the left; where there are lights, both have green.",
}
"""What happens where several types share the function that builds them, so that its docstring tells of none."""
_EXIT_CODES = (
    (pytest.ExitCode.OK, "every requirement holds, or what is inconclusive only warns", "done; contract kept, no drop"),
    (
        pytest.ExitCode.TESTS_FAILED,
        "a requirement is broken, is an error, got worse than the run it is compared with, or nothing was driven",
        "a broken contract, a drop, a damaged record, an episode that is not what was stored",
    ),
    (pytest.ExitCode.INTERRUPTED, "interrupted; what was finished is kept", "a command line that does not parse"),
    (pytest.ExitCode.INTERNAL_ERROR, "a bug of ours", "none"),
    (pytest.ExitCode.USAGE_ERROR, "input that makes no sense; nothing was driven", "input that makes no sense"),
    (pytest.ExitCode.NO_TESTS_COLLECTED, "no test was collected", "none"),
)


def options() -> str:
    """Return every option of the command line, by what it is about."""
    groups = {
        "Switch on": [OPTIONS["--drive-robust"]],
        "What is driven and judged": _of(RunOptions),
        "How it is driven": _of(ExecutionOptions),
        "Against which run": _of(RegressionOptions),
    }
    listed = {option.flag for group in groups.values() for option in group}
    assert listed == set(OPTIONS), set(OPTIONS) ^ listed
    lines = [".. program:: pytest", ""]
    for title, group in groups.items():
        lines += [*_title(title, "~"), ""]
        for option in group:
            lines += _option(option)
    return "\n".join(lines)


def ini_keys() -> str:
    """Return every ini key with its default."""
    rows = [(f"``{o.name}``", f"``{o.default}``" if o.default else "none", f"``{o.flag}``") for o in _keyed()]
    return _table(("ini key", "default", "the option of the same meaning"), rows)


def marker() -> str:
    """Return what the marker takes."""
    rows = [
        (f"``{item.name}``", f"``{OPTIONS[flag].flag}``", _text(OPTIONS[flag].help))
        for item in fields(MarkerOptions)
        if (flag := f"--drive-{item.name}") in OPTIONS
    ]
    assert len(rows) == len(fields(MarkerOptions))
    return _table(("keyword", "option of the run", "meaning"), rows)


def commands() -> str:
    """Return every command of `drive-robust` with its arguments."""
    lines: list[str] = []
    for name, what in cli.COMMANDS.items():
        parser = argparse.ArgumentParser(f"drive-robust {name}")
        importlib.import_module(f"pytest_drive_robust.cli.{name.replace('-', '_')}").add_arguments(parser)
        lines += [*_title(f"drive-robust {name}", "-"), "", f"{_text(what)[0].upper()}{_text(what)[1:]}.", ""]
        lines += _command(parser)
    return "\n".join(lines)


def programs() -> str:
    """Return what the programs that are modules say about themselves."""
    lines: list[str] = []
    for module, *command in _PROGRAMS:
        said = io.StringIO()
        main = importlib.import_module(module).main
        with (
            suppress(SystemExit),
            redirect_stdout(said),
            mock.patch.dict(os.environ, {"COLUMNS": "100", "NO_COLOR": "1"}),
        ):
            main([*command, "--help"])
        told = (f"   {line}".rstrip() for line in said.getvalue().splitlines())
        lines += [*_title(f"python -m {' '.join((module.removesuffix('.__main__'), *command))}", "~"), ""]
        lines += [".. code-block:: text", "", *told, ""]
    return "\n".join(lines)


def metrics() -> str:
    """Return the table of the metrics."""
    rows = [
        (
            f"``{name}``",
            _range(metric.low, metric.high),
            _text(metric.meaning) + (f" [{metric.unit}]" if metric.unit else ""),
        )
        for name, metric in METRICS.items()
    ]
    return _table(("metric", "range", "meaning"), rows)


def penalties() -> str:
    """Return the factor of each infraction."""
    rows = [(f"``{kind.value}``", _factor(kind)) for kind in InfractionKind]
    return _table(("infraction", "factor"), rows)


def abilities() -> str:
    """Return the scenario types of each ability."""
    return _table(
        ("ability", "scenario types"), [(name, ", ".join(sorted(types))) for name, types in ABILITIES.items()]
    )


def failures() -> str:
    """Return the gallery's chapter of each failure: pictures, docstring, severities, readings."""
    return "\n".join(line for name, cls in BUILTIN.items() for line in _failure(name, cls))


def failure_table() -> str:
    """Return the built-in failures with their sentences."""
    rows = [
        (f":ref:`{_plain(cls)} <failure-{name}>`", f"``{cls.phrase}``", f"``{cls.__name__}``", _levels(cls))
        for name, cls in BUILTIN.items()
    ]
    return _table(("failure", "sentence", "class", "severity, mild to severe"), rows)


def scenarios() -> str:
    """Return a chapter for each scenario type: a picture, what happens, parameters, routes."""
    routes: dict[str, list[str]] = {}
    for route in resolve_routes("full"):
        routes.setdefault(route.scenario.type, []).append(route.id)
    lines: list[str] = []
    for name in sorted(SCENARIOS):
        kind = SCENARIOS[name]
        lines += [f".. _scenario-{name.lower()}:", "", *_title(name, "-"), ""]
        lines += [
            f".. image:: /pictures/scenarios/{name}.webp",
            f"   :alt: {name} from above, and by a front camera",
            "",
        ]
        lines += [_SHARED.get(name) or inspect.getdoc(kind.build) or "", ""]
        drawn = {**kind.parameters, **kind.intervals}
        told = ", ".join(f"``{key}`` {_between(low, high)}" for key, (low, high) in drawn.items())
        abilities = ", ".join(ability for ability, types in ABILITIES.items() if name in types) or "none"
        lines += [
            f":Routes: {', '.join(routes[name])}",
            f":Drawn parameters: {told or 'none'}",
            f":Abilities: {abilities}",
            "",
        ]
    return "\n".join(lines)


def schema() -> str:
    """Return every object of the JSON schema with its fields."""
    document = json.loads(schema_file().read_text(encoding="utf-8"))
    lines: list[str] = []
    for name, part in {"run": document, **document["$defs"]}.items():
        if "properties" not in part:
            continue
        lines += [f".. _schema-{name}:", "", *_title(name, "-"), "", _text(part.get("description", "")), ""]
        required = part.get("required", ())
        rows = [
            (
                f"``{key}``",
                _type(value),
                _text(value.get("description", "")),
                "" if key in required else "may be left out",
            )
            for key, value in part["properties"].items()
        ]
        lines += [_table(("field", "type", "meaning", ""), rows), ""]
    return "\n".join(lines)


def schema_file() -> Path:
    """Return the file of the schema that is published with the package."""
    return Path(package.__file__).parent / "report" / "schema" / "run.schema.json"


def environment() -> str:
    """Return the variables that are read, but those of the paper."""
    return _table(("variable", "meaning"), [(f"``{name}``", what) for name, what in ENVIRONMENT.items()])


def exit_codes() -> str:
    """Return what each exit code means."""
    rows = [(str(int(code)), suite, command) for code, suite, command in _EXIT_CODES]
    return _table(("code", "``pytest --drive-robust``", "``drive-robust``"), rows)


def names() -> str:
    """Return what is registered where this package and the reference agents are installed."""
    lines: list[str] = []
    for kind in KINDS:
        rows = [(f"``{name}``", _text(origin)) for name, origin in default_registry().names(kind)]
        lines += [*_title(kind.capitalize(), "~"), "", _table(("name", "origin"), rows), ""]
    return "\n".join(lines)


def public_names() -> str:
    """Return every name of `pytest_drive_robust`."""
    listed = [name for name in package.__all__ if not name.startswith("__")]
    return "\n".join(
        line for name in listed for line in _documented("pytest_drive_robust", name, getattr(package, name))
    )


def testing_names() -> str:
    """Return every name of `pytest_drive_robust.testing`."""
    return "\n".join(
        line
        for name in testing.__all__
        for line in _documented("pytest_drive_robust.testing", name, getattr(testing, name))
    )


def error_names() -> str:
    """Return every class of error."""
    found = [name for name in errors.__all__ if inspect.isclass(getattr(errors, name))]
    return "\n".join(f".. autoexception:: pytest_drive_robust.errors.{name}\n" for name in found)


def _documented(module: str, name: str, value: object) -> list[str]:
    if inspect.isclass(value):
        members = ["   :members:", "   :undoc-members:"] if not issubclass(value, Perturbation) else []
        return [f".. autoclass:: {module}.{name}", *members, ""]
    return [f".. autofunction:: {module}.{name}", ""]


def _failure(name: str, cls: type[Perturbation]) -> Iterator[str]:
    yield from [f".. _failure-{name}:", "", *_title(_plain(cls), "-"), ""]
    yield from [f".. image:: /pictures/failures/{name}.webp", f"   :alt: {_plain(cls)}: clean and perturbed", ""]
    yield from [f"Sentence: ``{cls.phrase}``. Ladder, mild to severe: {_levels(cls)}.", ""]
    readings = "; ".join(
        f"``{reading}``: {', '.join(f'``{key}={value}``' for key, value in switches.items())}"
        for reading, switches in cls.readings.items()
    )
    if readings:
        yield from [f"Readings: {readings}.", ""]
    yield from [f".. autoclass:: {cls.__module__}.{cls.__name__}", "   :no-index:", ""]


def _plain(cls: type[Perturbation]) -> str:
    words = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", cls.__name__)
    return words.capitalize().replace("Gps", "GPS")


def _levels(cls: type[Perturbation]) -> str:
    ladder: Ladder = ladder_of(cls, dt_s=_TICK_S)
    labels = [ladder.label(level) for level in ladder.levels]
    return f"{', '.join(labels)}" if len(labels) <= 12 else f"{labels[0]}, {labels[1]}, ... {labels[-1]}"


def _factor(kind: InfractionKind) -> str:
    if kind is InfractionKind.OUTSIDE_LANES:
        return "1 - the share of the way outside the lanes"
    return f"{PENALTIES[kind]:g}" if kind in PENALTIES else "none"


def _between(low: float, high: float) -> str:
    return f"{low:g}" if low == high else f"{low:g} to {high:g}"


def _range(low: float, high: float) -> str:
    return f"{low:g} to {high:g}".replace("inf", "∞")


def _of(cls: type) -> list[Option]:
    return list(options_of(cls))


def _keyed() -> list[Option]:
    return [option for option in OPTIONS.values() if not option.is_switch]


def _option(option: Option) -> Iterator[str]:
    value = f"[={option.metavar}]" if option.bare else f" {option.metavar}".rstrip()
    yield from [f".. option:: {option.flag}{value}", ""]
    told = _text(option.help)
    yield from [f"   {told}{'' if told.endswith('?') else '.'}", ""]
    if not option.is_switch:
        default = f"Default: ``{option.default}``. " if option.default else ""
        yield from [f"   {default}Ini key: ``{option.name}``.", ""]


def _command(parser: argparse.ArgumentParser) -> Iterator[str]:
    formatter = argparse.HelpFormatter(parser.prog, width=110)
    formatter.add_usage(parser.usage, parser._actions, parser._mutually_exclusive_groups, prefix="")
    yield from [".. code-block:: text", "", *(f"   {line}" for line in formatter.format_help().splitlines()), ""]
    if parser.description:
        yield from [_text(" ".join(parser.description.split())), ""]
    yield from [f".. program:: {parser.prog}", ""]
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            helps = {choice.dest: choice.help or "" for choice in action._choices_actions}
            for name, child in action.choices.items():
                yield from [*_title(child.prog, "~"), "", f"{_text(helps.get(name, ''))}.", "", *_command(child)]
        elif action.help != argparse.SUPPRESS and not isinstance(action, argparse._HelpAction):
            value = action.metavar or ("{" + ",".join(action.choices) + "}" if action.choices else "")
            flags = [f"{flag} {value}".strip() for flag in action.option_strings]
            described = (action.help or "") % {"default": action.default, "prog": parser.prog}
            yield from [
                f".. option:: {', '.join(flags) or action.metavar or action.dest}",
                "",
                f"   {_text(described)}",
                "",
            ]


def _type(part: Mapping[str, Any]) -> str:
    if "$ref" in part:
        name = part["$ref"].rpartition("/")[2]
        return f":ref:`{name} <schema-{name}>`" if name != "interval" else "interval: two numbers"
    if "const" in part:
        return f"``{json.dumps(part['const'])}``"
    if "enum" in part:
        return ", ".join(f"``{json.dumps(value)}``" for value in part["enum"])
    if "anyOf" in part or "oneOf" in part:
        return " or ".join(_type(choice) for choice in part.get("anyOf") or part["oneOf"])
    kinds = part.get("type", "any")
    text = " or ".join([kinds] if isinstance(kinds, str) else kinds)
    if "items" in part and isinstance(part["items"], dict):
        return f"{text} of {_type(part['items'])}"
    return text


def _title(text: str, mark: str) -> list[str]:
    return [text, mark * len(text)]


def _table(head: Iterable[str], rows: Iterable[Iterable[str]]) -> str:
    lines = [".. list-table::", "   :header-rows: 1", "   :widths: auto", ""]
    for row in (head, *rows):
        lines += [f"   {'*' if not number else ' '} - {cell}".rstrip() for number, cell in enumerate(row)]
    return "\n".join([*lines, ""])


def _text(words: str) -> str:
    """Return words of our own for reStructuredText: `code` is code by the default role, stars stay stars."""
    return re.sub(r"([*|\\])", r"\\\1", words)


PARTS: Mapping[str, Callable[[], str]] = {
    "options": options,
    "ini-keys": ini_keys,
    "marker": marker,
    "commands": commands,
    "programs": programs,
    "metrics": metrics,
    "penalties": penalties,
    "abilities": abilities,
    "failures": failures,
    "failure-table": failure_table,
    "scenarios": scenarios,
    "schema": schema,
    "environment": environment,
    "exit-codes": exit_codes,
    "names": names,
    "public-names": public_names,
    "testing-names": testing_names,
    "error-names": error_names,
}
"""Every part by its name."""
