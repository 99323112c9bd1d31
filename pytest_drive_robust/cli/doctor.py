"""`drive-robust doctor`: what is missing before suites can be driven in the official evaluator."""

from __future__ import annotations

import argparse
from pathlib import Path

from pytest_drive_robust.bench2drive.evaluator.doctor import examine
from pytest_drive_robust.bench2drive.evaluator.ports import DEFAULT_PORT


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `doctor`."""
    parser.add_argument("--root", default=".", metavar="BENCH2DRIVE", help="a checkout of Bench2Drive; default: here")
    parser.add_argument("--carla-root", metavar="FOLDER", help="the folder of CARLA; default: the variable CARLA_ROOT")
    parser.add_argument(
        "--python", default="", metavar="FILE", help="the Python of the agent's environment; default: this one"
    )
    parser.add_argument(
        "--port", type=int, default=DEFAULT_PORT, metavar="N", help="the first port of the servers; default: 2000"
    )
    parser.set_defaults(command=_doctor)


def _doctor(options: argparse.Namespace) -> int:
    carla_root = Path(options.carla_root) if options.carla_root else None
    checks = examine(Path(options.root), carla_root=carla_root, python=options.python, port=options.port)
    for check in checks:
        word = {True: "ok", False: "MISSING", None: "note"}[check.ok]
        print(f"{word:8} {check.name:14} {check.found}")
        if not check.ok and check.advice:
            print(f"{'':23} {check.advice}")
    missing = sum(check.ok is False for check in checks)
    print(
        "nothing is missing: the official evaluator can drive"
        if not missing
        else f"{missing} missing. The embedded simulator needs nothing of this."
    )
    return 1 if missing else 0
