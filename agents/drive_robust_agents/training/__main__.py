"""`python -m drive_robust_agents.training COMMAND`: from the expert to weights that ship."""

from __future__ import annotations

import argparse
import os
import sys
from importlib import import_module

from drive_robust_agents.training.prerequisites import TRAINING, require_packages
from pytest_drive_robust.errors import DriveRobustError

_COMMANDS = {
    "reproduce": "everything below in one go, as for the weights that ship",
    "collect": "frames and labels, by drives of the expert",
    "train": "a network, from frames",
    "evaluate": "candidates in closed loop, on routes that were neither trained nor are judged on",
    "graphs": "what ONNX Runtime needs beside weights: written by `train`, again for weights that have none",
    "publish": "the chosen weights, into the package or a folder",
    "instructions": "whether simlingo does what it is told",
}

_IMPORTS = {
    "train": TRAINING,
    "evaluate": ("rich",),
    "graphs": ("torch", "onnx"),
    "publish": ("torch", "safetensors"),
}
"""Packages of the extra that the module of a command, or a function far behind its start, imports.

`reproduce` and `collect` look for theirs when they run, so that their help is there without."""


def main(arguments: list[str] | None = None) -> int:
    """Run the command line; return the exit code: 4 for unusable input or output, 130 when interrupted."""
    os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")  # before torch is imported: its threads spin otherwise
    given = sys.argv[1:] if arguments is None else arguments
    parser = argparse.ArgumentParser(prog="python -m drive_robust_agents.training", description=__doc__)
    parsers = parser.add_subparsers(dest="command", required=True)
    for name, words in _COMMANDS.items():
        one = parsers.add_parser(name, help=words, description=words)
        if given and given[0] == name:  # import only the given command's module
            try:
                require_packages(*_IMPORTS.get(name, ()))
                import_module(f"drive_robust_agents.training.{name}").add_arguments(one)
            except DriveRobustError as error:
                parser.exit(4, f"{error}\n")
    options = parser.parse_args(given)
    try:
        code: int = import_module(f"drive_robust_agents.training.{options.command}").run(options)
    except DriveRobustError as error:
        parser.exit(4, f"{error}\n")
    except OSError as error:  # from a given file or folder, or from a full disk
        parser.exit(4, f"{error.filename or 'a file'}: {error.strerror or error}.\n")
    except KeyboardInterrupt:  # `collect` and `train` print their own progress
        print("stopped; the same command goes on")
        return 130
    return code


if __name__ == "__main__":
    raise SystemExit(main())
