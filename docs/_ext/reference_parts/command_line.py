"""Options, ini keys, the marker, commands, programs and exit codes, as the code declares them."""

from __future__ import annotations

import argparse
import importlib
import io
import os
from collections.abc import Iterator
from contextlib import redirect_stdout, suppress
from dataclasses import fields
from unittest import mock

import pytest

from pytest_drive_robust.cli import main as cli
from pytest_drive_robust.options.execution import ExecutionOptions
from pytest_drive_robust.options.marker import MarkerOptions
from pytest_drive_robust.options.option import options_of
from pytest_drive_robust.options.run import RunOptions
from pytest_drive_robust.options.table import OPTIONS, Option
from pytest_drive_robust.regression.options import RegressionOptions
from reference_parts.rst import escaped, heading, list_table

_PROGRAMS = (
    ("pytest_drive_robust.simulators.embedded.generate",),
    ("pytest_drive_robust.bench2drive.evaluator.__main__", "run"),
    ("drive_robust_agents.training.__main__",),
)
"""Modules with a `main`, and the command of theirs that is shown."""
_EXIT_CODES = (
    (pytest.ExitCode.OK, "every requirement holds, or what is inconclusive only warns", "done; contract kept, no drop"),
    (
        pytest.ExitCode.TESTS_FAILED,
        "a requirement is broken, is an error, got worse than the run it is compared with, or nothing was driven",
        "a broken contract, a drop, a damaged record, an episode that is not what was stored, something missing that "
        "``doctor`` names",
    ),
    (pytest.ExitCode.INTERRUPTED, "interrupted; what was finished is kept", "a command line that does not parse"),
    (pytest.ExitCode.INTERNAL_ERROR, "a bug of ours", "none"),
    (pytest.ExitCode.USAGE_ERROR, "input that makes no sense; nothing was driven", "input that makes no sense"),
    (pytest.ExitCode.NO_TESTS_COLLECTED, "no test was collected", "none"),
    (130, "none", "interrupted"),
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
        lines += [*heading(title, "~"), ""]
        for option in group:
            lines += _option(option)
    return "\n".join(lines)


def ini_keys() -> str:
    """Return every ini key with its default."""
    rows = [(f"``{o.name}``", f"``{o.default}``" if o.default else "none", f"``{o.flag}``") for o in _keyed()]
    return list_table(("ini key", "default", "the option of the same meaning"), rows)


def marker() -> str:
    """Return what the marker takes."""
    rows = [
        (f"``{item.name}``", f"``{OPTIONS[flag].flag}``", escaped(OPTIONS[flag].help))
        for item in fields(MarkerOptions)
        if (flag := f"--drive-{item.name}") in OPTIONS
    ]
    assert len(rows) == len(fields(MarkerOptions))
    return list_table(("keyword", "option of the run", "meaning"), rows)


def commands() -> str:
    """Return every command of `drive-robust` with its arguments."""
    lines: list[str] = []
    for name, what in cli.COMMANDS.items():
        parser = argparse.ArgumentParser(f"drive-robust {name}")
        importlib.import_module(f"pytest_drive_robust.cli.{name.replace('-', '_')}").add_arguments(parser)
        lines += [*heading(f"drive-robust {name}", "-"), "", _sentence(f"{what[0].upper()}{what[1:]}"), ""]
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
        lines += [*heading(f"python -m {' '.join((module.removesuffix('.__main__'), *command))}", "~"), ""]
        lines += [".. code-block:: text", "", *told, ""]
    return "\n".join(lines)


def exit_codes() -> str:
    """Return what each exit code means."""
    rows = [(str(int(code)), suite, command) for code, suite, command in _EXIT_CODES]
    return list_table(("code", "``pytest --drive-robust``", "``drive-robust``"), rows)


def _of(cls: type) -> list[Option]:
    return list(options_of(cls))


def _keyed() -> list[Option]:
    return [option for option in OPTIONS.values() if not option.is_switch]


def _sentence(text: str) -> str:
    return escaped(text) + ("" if text.endswith("?") else ".")


def _option(option: Option) -> Iterator[str]:
    value = f"[={option.metavar}]" if option.bare else f" {option.metavar}".rstrip()
    yield from [f".. option:: {option.flag}{value}", ""]
    yield from [f"   {_sentence(option.help)}", ""]
    if not option.is_switch:
        default = f"Default: ``{option.default}``. " if option.default else ""
        yield from [f"   {default}Ini key: ``{option.name}``.", ""]


def _command(parser: argparse.ArgumentParser) -> Iterator[str]:
    formatter = argparse.HelpFormatter(parser.prog, width=110)
    formatter.add_usage(parser.usage, parser._actions, parser._mutually_exclusive_groups, prefix="")
    yield from [".. code-block:: text", "", *(f"   {line}" for line in formatter.format_help().splitlines()), ""]
    if parser.description:
        yield from [escaped(" ".join(parser.description.split())), ""]
    yield from [f".. program:: {parser.prog}", ""]
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            helps = {choice.dest: choice.help or "" for choice in action._choices_actions}
            for name, child in action.choices.items():
                yield from [*heading(child.prog, "~"), "", _sentence(helps.get(name, "")), "", *_command(child)]
        elif action.help != argparse.SUPPRESS and not isinstance(action, argparse._HelpAction):
            value = action.metavar or ("{" + ",".join(action.choices) + "}" if action.choices else "")
            flags = [f"{flag} {value}".strip() for flag in action.option_strings]
            described = (action.help or "") % {"default": action.default, "prog": parser.prog}
            yield from [
                f".. option:: {', '.join(flags) or action.metavar or action.dest}",
                "",
                f"   {escaped(described)}",
                "",
            ]
