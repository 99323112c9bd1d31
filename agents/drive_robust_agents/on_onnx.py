"""The learned agents on ONNX Runtime: `tcp-onnx` is `tcp` with the same weights.

The network is about twice as fast on a CPU. Both plan alike to 1e-3 along the golden drives of the
tests, but a closed loop makes much of little: an episode of `tcp-onnx` need not end as that of `tcp` does, and is
stored as another agent's. Needs the extra `onnx`.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import ClassVar

from drive_robust_agents._nets import require
from drive_robust_agents._wrappers.learned_agent import ON_ONNX, LearnedAgent
from drive_robust_agents.simlingo import SimLingo
from drive_robust_agents.tcp import TCP
from drive_robust_agents.uniad import UniAD
from drive_robust_agents.vad import VAD

__all__ = ["SimLingoOnnx", "TCPOnnx", "UniADOnnx", "VADOnnx"]

require("onnx", "onnxruntime", extra="onnx")

_ENGINE = {"engine": "onnx"}


class _Onnx(LearnedAgent):
    """Before the class of an agent: its engine is ONNX Runtime, all else is as it ships."""

    computed_by = ON_ONNX

    def __init__(self, *, weights: str | Path | None = None) -> None:
        super().__init__(engine="onnx", weights=weights)


class TCPOnnx(_Onnx, TCP):
    """`tcp`, in the mode `traj`."""

    configuration: ClassVar[Mapping[str, str]] = {**TCP.configuration, **_ENGINE}


class SimLingoOnnx(_Onnx, SimLingo):
    """`simlingo` without commentary: ONNX Runtime knows the plan only."""

    configuration: ClassVar[Mapping[str, str]] = {**SimLingo.configuration, **_ENGINE}


class UniADOnnx(_Onnx, UniAD):
    """`uniad`."""

    configuration: ClassVar[Mapping[str, object]] = {**UniAD.configuration, **_ENGINE}


class VADOnnx(_Onnx, VAD):
    """`vad`."""

    configuration: ClassVar[Mapping[str, str]] = {**VAD.configuration, **_ENGINE}
