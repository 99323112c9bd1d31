"""The manual of our hooks tells the truth."""

from __future__ import annotations

import inspect
import textwrap

import pytest

from pytest_drive_robust import hookspecs
from pytest_drive_robust.perturbations import Setting
from pytest_drive_robust.registry.registry import Registry
from pytest_drive_robust.testing import check_agent, check_perturbation


def _example() -> str:
    """The code block of the docstring: everything indented after its `::`."""
    text = inspect.cleandoc(hookspecs.pytest_drive_robust_register.__doc__ or "")
    _, _, after = text.partition("is not installed::\n")
    lines = [line for line in after.splitlines() if not line or line.startswith("    ")]
    return textwrap.dedent("\n".join(lines))


def test_the_example_registers_an_agent_and_a_perturbation_that_keep_their_contracts() -> None:
    module: dict[str, object] = {"__name__": __name__}  # @dataclass looks its module up
    exec(compile(_example(), "conftest.py", "exec"), module)
    registry = Registry()
    module["pytest_drive_robust_register"](registry)  # type: ignore[operator]
    report = check_agent(lambda: registry.agent("cautious"))
    assert report.ok, str(report)
    setting = Setting.parse("dimmed camera 0.25", registry.perturbations())
    (perturbation,) = setting.perturbations
    report = check_perturbation(perturbation)
    assert report.ok, str(report)


def test_every_hook_has_our_prefix_is_historic_and_documented() -> None:
    for name in hookspecs.__all__:
        hook = getattr(hookspecs, name)
        assert name.startswith("pytest_drive_robust_")
        assert hook.pytest_spec["historic"] is True
        for question in ("Who calls it", "In which process", "optionalhook=True"):
            assert question in (hook.__doc__ or "")


def test_a_plugin_manager_accepts_the_hooks_and_reaches_plugins_that_come_late() -> None:
    class Plugin:
        @pytest.hookimpl(optionalhook=True)
        def pytest_drive_robust_register(self, registry: Registry) -> None:
            registry.register_metric("late", len)

    manager = pytest.PytestPluginManager()
    manager.add_hookspecs(hookspecs)
    registry = Registry()
    manager.hook.pytest_drive_robust_register.call_historic(kwargs={"registry": registry})
    manager.register(Plugin())
    assert "late" in dict(registry.names("metrics"))
