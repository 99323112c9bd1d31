"""One episode request on its way to a worker process."""

from __future__ import annotations

import pickle
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from pytest_drive_robust.domain.episode import Episode
from pytest_drive_robust.domain.route import Route
from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.perturbations.base import Setting

if TYPE_CHECKING:
    from pytest_drive_robust.registry.registry import Registry
    from pytest_drive_robust.runner.plan import EpisodeRequest

__all__ = ["PickledRequest"]


@dataclass(frozen=True, slots=True)
class PickledRequest:
    """An episode with its route. `setting` is pickled; None where it does not pickle, and its sentence must do."""

    episode: Episode
    route: Route
    setting: bytes | None

    @classmethod
    def of(cls, request: EpisodeRequest) -> PickledRequest:
        """Pickle what a worker needs of a request."""
        try:
            setting: bytes | None = pickle.dumps(request.setting)
        except Exception:  # a class of a conftest.py that another one pushed out of sys.modules, a lambda, a lock ...
            setting = None
        return cls(request.episode, request.route, setting)

    def read_setting(self, registry: Registry) -> Setting:
        """Return the setting, in the worker. Raises `UsageError` when its classes are not to be had there."""
        problem = "its perturbations do not pickle"
        if self.setting is not None:
            try:
                found: Any = pickle.loads(self.setting)
                if isinstance(found, Setting):
                    return found
                problem = f"it came out as {found!r}"
            except Exception as error:
                problem = f"{type(error).__name__}: {error}"
        try:
            parsed = Setting.parse(self.episode.setting, registry.perturbations())
        except UsageError:
            parsed = None
        if parsed is None or str(parsed) != self.episode.setting:
            raise UsageError(
                f"the setting {self.episode.setting!r} cannot be sent to the process that drives the episode "
                f"({problem}). Define its perturbations in a module that can be imported and register them in "
                "pytest_drive_robust_register, or give --drive-executor inline."
            )
        return parsed
