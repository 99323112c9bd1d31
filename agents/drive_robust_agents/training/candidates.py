"""Register unshipped weights as agents: `candidate:tcp=RUN/weights/000100000/tcp.safetensors`.

Options of the agent follow the file: `candidate:tcp=RUN/weights/000100000/tcp.safetensors+tuning=published`.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, cast

from drive_robust_agents.training.recipes.recipe import RECIPES
from pytest_drive_robust.errors import UnknownNameError, UsageError
from pytest_drive_robust.registry.agent_factories import configured
from pytest_drive_robust.registry.registry import default_registry

if TYPE_CHECKING:
    from pytest_drive_robust import Agent
    from pytest_drive_robust.registry.registry import Registry

__all__ = ["WEIGHTS_SUFFIX", "CandidateFactory", "candidate_name", "file_and_options", "pytest_drive_robust_register"]

WEIGHTS_SUFFIX = ".safetensors"


class CandidateFactory:
    """A factory of agents with one weight file. Their code, name and weights key their episodes.

    `options` are the agent's options, as after its name. Raises `UsageError` for unknown options, and for weights of
    another agent.
    """

    def __init__(self, agent: str, file: Path, options: str = "") -> None:
        cls = default_registry().entry("agents", agent).load()
        self._make = cast("Callable[..., Agent]", configured(agent, cls, options) if options else cls)
        if "weights" in getattr(self._make, "keywords", {}):
            raise UsageError(f"{file.name}+{options} names two files of weights: leave out the option 'weights'.")
        self._file = file
        self.__wrapped__ = cls
        self.__module__ = cls.__module__
        self.__qualname__ = getattr(cls, "__qualname__", agent)
        self.weights = (file, *sorted(file.parent.glob(f"{file.stem}*.onnx")))
        self.computed_by = getattr(cls, "computed_by", None)

    def __call__(self) -> Agent:
        """Return a new agent. Raises `UsageError` for weights that are refused."""
        return self._make(weights=self._file)

    def check(self) -> None:
        """Load the weights early. Raises `UsageError` for refused weights."""
        self()


def candidate_name(agent: str, file: Path) -> str:
    """Return the name of the agent of a weight file, valid after `pytest_drive_robust_register`."""
    return f"candidate:{agent}={file.absolute()}"


def candidate(argument: str) -> CandidateFactory:
    """Return the factory of `AGENT=FILE` or `AGENT=FILE+OPTIONS`. Raises `UsageError`."""
    agent, equals, file = argument.partition("=")
    file, options = file_and_options(file)
    if not equals or not Path(file).is_file():
        raise UsageError(f"'candidate:{argument}': expected candidate:AGENT=FILE with a weight file that exists.")
    if agent not in RECIPES:
        raise UnknownNameError.of("learned agent", agent, RECIPES)
    return CandidateFactory(agent, Path(file).absolute(), options)


def file_and_options(text: str) -> tuple[str, str]:
    """Return (file, options of the agent) of a text such as `"tcp.safetensors+tuning=published"`.

    >>> file_and_options("a+b/tcp.safetensors+tuning=published"), file_and_options("tcp.safetensors")
    (('a+b/tcp.safetensors', 'tuning=published'), ('tcp.safetensors', ''))
    """
    file, found, options = text.rpartition(f"{WEIGHTS_SUFFIX}+")
    return (file + WEIGHTS_SUFFIX, options) if found else (text, "")


def pytest_drive_robust_register(registry: Registry) -> None:
    """Make `candidate:AGENT=FILE+OPTIONS` an agent."""
    registry.register_agent("candidate", candidate, argument="AGENT=FILE+OPTIONS")
