"""The variables that the package reads."""

from __future__ import annotations

from collections.abc import Mapping

from reference_parts.rst import list_table

_VARIABLES: Mapping[str, str] = {
    "NUMBA_CACHE_DIR": "the folder that compiled kernels are kept in; else the user's cache folder",
    "NUMBA_DISABLE_JIT": "refused when it is set: the embedded world needs compiled kernels",
    "XDG_CACHE_HOME": "where the user's cache folder is, as everywhere on Linux",
    "GITHUB_STEP_SUMMARY": "the file that the table is appended to; GitHub sets it",
    "GITHUB_TOKEN": "what ``drive-robust comment`` may write the comment with; without one it writes none",
    "GITHUB_EVENT_PATH": "the pull request that it comments on; GitHub sets it",
    "GITHUB_REPOSITORY": "the repository of that pull request; GitHub sets it",
    "GITHUB_API_URL": "where GitHub's interface is, for a server of one's own; GitHub sets it",
    "CI": "where it is set, ``drive-robust bless`` is refused",
    "TERM": "``dumb`` and ``unknown`` get lines of progress in place of a live one",
    "RAY_ADDRESS": "the cluster of ``--drive-executor ray`` where ``--drive-ray-address`` says nothing",
    "IS_BENCH2DRIVE": "Bench2Drive's switch: an official agent is then given a name to save under, as officially",
    "CARLA_ROOT": "the folder of CARLA, for the official evaluator",
    "CUDA_VISIBLE_DEVICES": "the GPUs that official evaluators use in turn, by number as in ``0,1``; "
    "under Ray the devices that an episode was given: a worker with others is not used for it",
    "PLANNER_TYPE": "which output of an official agent drives, TCP for one: ``only_traj``, ``only_ctrl`` or "
    "``merge_ctrl_traj``; results of another value are kept apart, and an agent that reads it is refused without it",
    "PDR_SETTING": "JSON of the setting that ``inject.py`` puts into the official evaluator; our runs set it "
    "themselves, and where ``inject.py`` is started by hand without it, the variables of the paper decide",
    "PDR_LOG": "the file to which ``inject.py``, started by hand, writes what was injected, a line of JSON for a route",
    "PDR_ROUTE": "the name of the route in ``inject.py`` where no ``ScenarioManager`` of the evaluator tells it",
    "ROBUSTNESS_SEED": "the seed of the failures in ``inject.py`` where ``PDR_SETTING`` is not set",
}
"""What this package reads beside the variables of the paper."""


def environment() -> str:
    """Return the variables that are read, but those of the paper."""
    return list_table(("variable", "meaning"), [(f"``{name}``", what) for name, what in _VARIABLES.items()])
