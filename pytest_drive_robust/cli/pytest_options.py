"""Arguments of commands that mean what an option of pytest means: `--sim` is `--drive-sim`."""

from __future__ import annotations

import argparse

from pytest_drive_robust.options.table import OPTIONS


def add_pytest_option(parser: argparse.ArgumentParser, flag: str, *, help: str = "") -> None:
    """Add `--sim` with metavar, default and help of `--drive-sim`."""
    option = OPTIONS[flag.replace("--", "--drive-", 1)]
    default = f" (default: {option.default})" if option.default else ""
    text = f"{help or option.help}{default}".replace("%", "%%")  # argparse formats it
    parser.add_argument(flag, default=option.default, metavar=option.metavar, help=text)
