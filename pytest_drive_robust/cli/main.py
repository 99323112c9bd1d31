"""The entry point of `drive-robust`: the commands, their parser and the exit codes."""

from __future__ import annotations

import argparse
import importlib
import os
import re
import sys
from collections.abc import Sequence
from io import TextIOWrapper
from typing import Any, NoReturn

from pytest_drive_robust import __version__
from pytest_drive_robust.errors import DriveRobustError, UsageError, did_you_mean
from pytest_drive_robust.registry.exits import exits_raised
from pytest_drive_robust.registry.plugins import register_names_of
from pytest_drive_robust.registry.registry import default_registry

COMMANDS = {
    "init": "write a starter suite, its limits and a workflow into your repository",
    "list": "list agents, perturbations, simulators, metrics and sets of routes, and where each comes from",
    "routes": "list routes, check that they can be driven, or draw them from above",
    "runs": "list the runs that --drive-save stored",
    "compare": "tell whether run B is worse than run A; exit code 1 when it is",
    "report": "write a run as a folder of pages: verdicts, what went wrong, replays",
    "limits": "propose limits for an agent from a run that drove it, to be reviewed",
    "bless": "accept a run as the baseline that later runs are compared with",
    "score": "compute the totals of official Bench2Drive results",
    "export": "write a run for other tools: parquet, csv, mcap, rrd, bench2drive",
    "comment": "put the summary of a run on the pull request, one comment that is updated in place",
    "doctor": "tell what is missing for --drive-sim bench2drive",
    "check-agent": "check whether an agent keeps the contract",
    "replay": "drive one route again and film it",
    "warm": "compile everything now, for container images and CI caches",
    "store": "count, verify or remove the finished episodes that runs keep for later ones",
}
"""Every command with its help. The module of a command, `cli.check_agent` for `check-agent`, has
`add_arguments(parser)`. This function sets the default `command`, a function of the parsed arguments that returns the
exit code, and `parser.description` if the command needs more help than one line."""

_NO_CHOICE = re.compile(r"invalid choice: '(?P<given>.*?)' \(choose from (?P<known>.*)\)")
_USAGE_ERROR = 4  # pytest's exit code for the same mistake
_CUT_OFF = 1  # rich, which prints the tables, exits with the same code
_INTERRUPTED = 130  # as in a shell; argparse takes 2 for a command line that does not parse


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command.

    Returns the exit code: 0; 1 when what was checked does not hold (a contract, a comparison, a stored record, a
    replay, the doctor's list); 4 for input that cannot be used; 130 after Ctrl-C.
    """
    if isinstance(sys.stdout, TextIOWrapper):  # names may hold characters that the terminal cannot print
        sys.stdout.reconfigure(errors="backslashreplace")
    try:
        options = _parser().parse_args(arguments)
        for word in options.plugins:  # as pytest does it for `-p` and for a `conftest.py`
            register_names_of(word, default_registry())
        with exits_raised():
            code: int = options.command(options)
        sys.stdout.flush()
    except DriveRobustError as error:
        print(f"drive-robust: {error}", file=sys.stderr)
        return _USAGE_ERROR
    except KeyboardInterrupt:
        print("drive-robust: interrupted", file=sys.stderr)
        return _INTERRUPTED
    except BrokenPipeError:  # the reader, such as `| head`, has stopped; the rest goes to the null device
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return _CUT_OFF
    except OSError as error:  # about a file that the user named; not 1, which is a verdict of `compare`
        print(f"drive-robust: {error.filename or 'a file'}: {error.strerror or error}.", file=sys.stderr)
        return _USAGE_ERROR
    return code


def _parser() -> argparse.ArgumentParser:
    parser = _Parser("drive-robust", description="Closed-loop robustness of driving policies.")
    parser.add_argument(
        "-p",
        dest="plugins",
        action="append",
        default=[],
        metavar="PLUGIN",
        help="read the names that this module or conftest.py registers, such as agents of your own; repeatable",
    )
    parser.add_argument("--version", action="version", version=f"drive-robust {__version__}")
    commands = parser.add_subparsers(required=True, metavar="COMMAND", parser_class=_CommandParser)
    for name, text in COMMANDS.items():
        about = f"{text[0].upper()}{text[1:]}."
        command = commands.add_parser(name, help=text, description=about)
        command.module = f"pytest_drive_robust.cli.{name.replace('-', '_')}"
    return parser


class _Parser(argparse.ArgumentParser):
    """Suggests the nearest choice for a word that is none of the choices."""

    def error(self, message: str) -> NoReturn:
        """End the program with exit code 2, after the usage and the message."""
        chosen = _NO_CHOICE.search(message)
        super().error(
            message + (did_you_mean(chosen["given"], re.findall(r"[\w-]+", chosen["known"])) if chosen else "")
        )


class _CommandParser(_Parser):
    """The parser of one command, which imports the command's module only when the command is given."""

    module = ""
    _intermixed = False

    def parse_known_args(self, *arguments: Any, **options: Any) -> Any:
        """Let the command's module add its arguments, then parse.

        Options may stand between positional arguments. Without that, Python before 3.12 does not find an optional
        positional argument (DIR of `export`) behind an option. A leading `~` in the value of an option is the home
        folder: shells leave it in `--out=~/pages`. Raises `UsageError` for an option with a blank value.
        """
        module, self.module = self.module, ""
        if module:
            importlib.import_module(module).add_arguments(self)
        if self._intermixed:
            return super().parse_known_args(*arguments, **options)
        words, *others = arguments
        self._refuse_blank(words)
        arguments = ([_from_home(word) for word in words], *others)
        if self.get_default("command") is None:  # it has commands of its own
            parsed, unknown = super().parse_known_args(*arguments, **options)
        else:
            self._intermixed = True
            try:
                parsed, unknown = self.parse_known_intermixed_args(*arguments, **options)
            finally:
                self._intermixed = False
        if unknown:
            meant = did_you_mean(unknown[0].partition("=")[0], self._option_string_actions)
            self.error(f"unrecognized arguments: {' '.join(unknown)}.{meant}")
        return parsed, unknown

    def _refuse_blank(self, words: Sequence[str]) -> None:
        """Raise `UsageError` for an option with a blank value, for example from an unset variable of CI.

        Such a value would mean the default: another store would be emptied, or no file be written.
        """
        for word, next_word in zip(words, (*words[1:], "the end"), strict=False):
            flag, equals, text = word.partition("=")
            given, option = text if equals else next_word, self._option_string_actions.get(flag)
            if option is not None and option.nargs != 0 and not given.strip():
                told = f"{flag} is empty, expected {option.metavar or 'a value'}"
                help_text = (option.help or "").replace("%%", "%")
                raise UsageError(f"{told}: {help_text}." if help_text else f"{told}.")


def _from_home(word: str) -> str:
    """Return a word of the command line; `--out=~/pages` with the home folder in place of `~`."""
    flag, equals, text = word.partition("=")
    return flag + equals + os.path.expanduser(text) if flag.startswith("-") else word
