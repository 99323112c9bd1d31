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
    "RAY_ADDRESS": "the cluster of ``--drive-executor ray`` where ``--drive-ray-address`` says nothing",
    "IS_BENCH2DRIVE": "Bench2Drive's switch: an official agent is then given a name to save under, as officially",
    "CARLA_ROOT": "the folder of CARLA, for the official evaluator",
    "CUDA_VISIBLE_DEVICES": "the devices that Ray gives an episode: a worker with others is not used for it",
}
"""What this package reads beside the variables of the paper."""


def environment() -> str:
    """Return the variables that are read, but those of the paper."""
    return list_table(("variable", "meaning"), [(f"``{name}``", what) for name, what in _VARIABLES.items()])
