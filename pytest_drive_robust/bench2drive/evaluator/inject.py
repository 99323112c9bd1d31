"""Our perturbations inside an official Bench2Drive evaluation, without a change to any of its files.

Started by its path, with the Python of the evaluator (3.7 or later, numpy 1.17 or later)::

    PDR_SETTING='{"seed": 0, "stack": [...]}' python inject.py .../leaderboard_evaluator.py --routes=... --agent=...

it wraps two methods of the checkout that is on the path, then runs the evaluator as if it had been started directly:

* `SensorInterface.get_data`: what it returns is perturbed, once per tick, however often it is called;
* `AgentWrapper.__call__`: while a latency keeps the agent's computer busy the agent is not called, and the command that
  is due reaches the vehicle.

`ScenarioManager.load_scenario` tells which route begins; seeds and state are set there. This file only finds its own
package, in a Python that is older than the package is written for; `injection/` does the work. The package's own
`perturbations` change the signals, so equal images and measurements are perturbed to the same bits as in the embedded
simulator.

=================== ==================================================================================================
variable            meaning
=================== ==================================================================================================
`PDR_SETTING`       JSON: `seed`, `stack` (a list of `name` and `parameters`), and if wanted `dt_s` (0.05), `setting`
                    (the sentence, for the log) and `log`. `setting_as_json` of the package writes it.
`PDR_LOG`           a file that gets one line of JSON for each route: what was injected, and in which ticks
`PDR_ROUTE`         the name of the route where no `ScenarioManager` tells it
=================== ==================================================================================================

Without `PDR_SETTING` the variables of the paper's released code decide (`ROBUSTNESS_ENABLE`, `GPS_NOISE_STD`, ...), and
`ROBUSTNESS_SEED` is the seed. A repetition of a route adds its number to the seed.

Frame numbers stay those of the tick, also on a stale image. An error of the injection ends a route as "Simulation
crashed": it is never counted against the agent.
"""

from __future__ import annotations

import dataclasses
import importlib
import importlib.util
import os
import runpy
import sys
import typing
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

REFUSED = 78
"""Exit code when the setting cannot be used: the configuration error of sysexits.h."""


@contextmanager
def _like_later_pythons() -> Iterator[None]:
    """Let old Pythons import our modules: they lack `slots` of dataclasses and some names for type checkers."""
    own = vars(typing).copy(), dataclasses.dataclass

    def dataclass(cls: Any = None, *, slots: bool = False, **options: Any) -> Any:
        return own[1](cls, **options) if cls is not None else own[1](**options)

    class Annotation:
        def __class_getitem__(cls, item: Any) -> Any:
            return cls

    if sys.version_info < (3, 10):  # noqa: UP036 - this file runs in older ones
        dataclasses.dataclass = dataclass
        for name in {"Literal", "Protocol"} - set(own[0]):
            setattr(typing, name, Annotation)
    try:
        yield
    finally:
        dataclasses.dataclass = own[1]
        for name in set(vars(typing)) - set(own[0]):
            delattr(typing, name)


def _import_ours(*names: str) -> Any:
    """Return modules of `injection` from the package of this file, even if another version is installed."""
    folder = Path(__file__).resolve().parents[2]
    package = folder.name
    if package not in sys.modules:
        found: Any = importlib.util.spec_from_file_location(
            package, str(folder / "__init__.py"), submodule_search_locations=[str(folder)]
        )
        sys.modules[package] = importlib.util.module_from_spec(found)
        found.loader.exec_module(sys.modules[package])
    with _like_later_pythons():
        return [importlib.import_module(f"{package}.bench2drive.evaluator.injection.{name}") for name in names]


plan, seams = _import_ours("plan", "seams")


def main(arguments: list[str]) -> None:
    """Run an evaluator with the injection: `inject.py EVALUATOR.py [its arguments]`."""
    if not arguments:
        print("usage: inject.py LEADERBOARD_EVALUATOR.py [its arguments]", file=sys.stderr)
        sys.exit(REFUSED)
    evaluator = os.path.abspath(arguments[0])
    sys.argv = [evaluator, *list(arguments[1:])]
    sys.path[0] = os.path.dirname(evaluator)  # as if it had been started itself; our folder has no modules for it
    try:
        seams.install()
    except plan.SettingRefusedError as error:
        print(f"drive-robust: {error}", file=sys.stderr, flush=True)
        sys.exit(REFUSED)
    runpy.run_path(evaluator, run_name="__main__")


if __name__ == "__main__":
    main(sys.argv[1:])
