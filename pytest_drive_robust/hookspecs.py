"""The hooks that plugins and `conftest.py` files may implement. This file is their manual."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from pytest_drive_robust.registry.registry import Registry

__all__ = ["pytest_drive_robust_register"]


@pytest.hookspec(historic=True)
def pytest_drive_robust_register(registry: Registry) -> None:
    """Add your own agents, perturbations, simulators and metrics.

    **Who calls it, when:** pytest-drive-robust itself, once per session, when pytest is configured; also without
    `--drive-robust`, because requirements are read in every collection. Import heavy libraries inside your factories.
    The hook is historic: a `conftest.py` that is loaded later, while tests are collected, is called at that moment,
    so a registration always comes before the requirements of its folder are read.

    **In which process:** in every process that collects tests: the main one and, under `pytest -n`, each worker.
    Register the same names everywhere, and register factories rather than objects: agents are made where they drive.

    :param registry: has `register_agent(name, factory)`, `register_perturbation(cls, name=None)`,
        `register_simulator(name, factory)` and `register_metric(name, function)`. A name given here wins over an
        entry point of that name; a name given by two hooks is a `UsageError` that names both.

    A `conftest.py` that adds an agent and a perturbation. `optionalhook=True` keeps the file valid where
    pytest-drive-robust is not installed::

        from dataclasses import dataclass

        import pytest

        from pytest_drive_robust import Control, Image, Perturbation


        class Cautious:
            def sensors(self):
                return []

            def reset(self, route, seed):
                pass

            def act(self, observation):
                return Control(throttle=0.3) if observation.speed.mps < 3.0 else Control()


        @dataclass
        class Dimmed(Perturbation):
            gain: float = 0.5
            phrase = "dimmed camera {gain}"

            def observe(self, observation):
                return observation.map_images(
                    lambda name, image: Image((image.pixels * self.gain).astype("uint8"), image.tick)
                )


        @pytest.hookimpl(optionalhook=True)
        def pytest_drive_robust_register(registry):
            registry.register_agent("cautious", Cautious)
            registry.register_perturbation(Dimmed)

    `RD under dimmed camera 0.5 <= 0.20` is a requirement from then on, and `--drive-agent cautious` an agent.

    Outside pytest, `drive-robust -p conftest.py COMMAND` calls the hook; the replay lines of failures begin that way.
    """
