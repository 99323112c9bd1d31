"""Options of commands that mean the same as an option of pytest: `--sim` is `--drive-sim`."""

from __future__ import annotations

import argparse

from pytest_drive_robust.options.table import OPTIONS


def add_pytest_option(parser: argparse.ArgumentParser, flag: str, *, help: str = "") -> None:
    """Add the option `flag`, such as `--sim`, with metavar, default and help of the pytest option `--drive-sim`.

    `help` replaces the help of the pytest option.
    """
    option = OPTIONS[flag.replace("--", "--drive-", 1)]
    default = f" (default: {option.default})" if option.default else ""
    text = f"{help or option.help}{default}".replace("%", "%%")  # argparse formats it
    parser.add_argument(flag, default=option.default, metavar=option.metavar, help=text)
