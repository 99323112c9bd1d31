"""The hooks of every session: options, registration of names, checks of the collection.

Without `--drive-robust` nothing is driven. With that option, `plugin.activation` registers the plugin objects that
drive and report. Every pytest session pays for the imports of this module, hence the late imports.
"""

from __future__ import annotations

import sys
from collections.abc import Generator
from functools import partial
from typing import Any

import pytest

from pytest_drive_robust import hookspecs
from pytest_drive_robust.options.table import OPTIONS
from pytest_drive_robust.plugin.fixtures import NEEDS_FLAG, uses_drive

__all__: list[str] = []

_MARKER_LINE = (
    "drive_robust(agent=NAME, routes=SPEC, seeds=[0, 1], reading=NAME, verdict=RULE, margin=SHARE): use these values "
    "in place of --drive-agent, --drive-routes and so on for the marked tests, whatever the command line says."
)

_REGISTRY = "pytest_drive_robust.registry.registry"
_SESSIONS: list[pytest.Config] = []
"""The pytest sessions under way in this process, outermost first: pytester runs one session inside another."""
_OUTER_NAMES = pytest.StashKey[int]()


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the options of the group drive-robust and an ini key for each."""
    group = parser.getgroup(
        "drive-robust",
        "drive-robust: closed-loop robustness requirements (in the ini file: drive_agent for --drive-agent)",
    )
    for option in OPTIONS.values():
        if option.is_switch:
            group.addoption(option.flag, action="store_true", help=option.help)
            continue
        default = f" (default: {option.default})" if option.default else ""
        bare = {"nargs": "?", "const": option.bare} if option.bare else {}
        text = f"{option.help}{default}".replace("%", "%%")  # argparse formats it
        group.addoption(option.flag, metavar=option.metavar, default=None, help=text, **bare)
        parser.addini(option.name, f"as {option.flag}: {option.help}", default="")


def pytest_addhooks(pluginmanager: pytest.PytestPluginManager) -> None:
    """Add our own hooks."""
    pluginmanager.add_hookspecs(hookspecs)


def pytest_plugin_registered(plugin: object, manager: pytest.PytestPluginManager) -> None:
    """Refuse an optional hook whose name is almost that of our hook, because pytest would never call such a hook.

    Its names would be missing, or mean an entry of another plugin.
    """
    names = getattr(plugin, "__dict__", ())
    if any(name.startswith("pytest_drive") and not hasattr(hookspecs, name) for name in names):
        from pytest_drive_robust.plugin.misspelt_names import refuse_unknown_hooks
        from pytest_drive_robust.plugin.usage_errors import raise_as_pytests

        try:
            refuse_unknown_hooks(plugin)
        except Exception as error:
            if all(config.pluginmanager is not manager for config in _SESSIONS):  # before tests are collected
                raise_as_pytests(error)
            raise


@pytest.hookimpl(wrapper=True)
def pytest_load_initial_conftests(parser: pytest.Parser, args: list[str]) -> Generator[None, object, object]:
    """Refuse an unknown `--drive...` option and name the nearest one, after the first conftest files added theirs."""
    result = yield
    if any(word.startswith("--drive") and word.partition("=")[0] not in OPTIONS for word in args):
        from pytest_drive_robust.plugin.misspelt_names import refuse_unknown_options
        from pytest_drive_robust.plugin.usage_errors import raise_as_pytests

        try:
            refuse_unknown_options(parser, args)
        except Exception as error:
            raise_as_pytests(error)
            raise
    return result


@pytest.hookimpl(trylast=True)  # the terminal reporter must be there
def pytest_configure(config: pytest.Config) -> None:
    """Register names and, with `--drive-robust`, the plugin objects that drive and report."""
    config.addinivalue_line("markers", _MARKER_LINE)
    _hide_names_of_outer(config)
    try:
        # Also without the switch: suites that are only collected may use registered perturbations in their sentences.
        config.hook.pytest_drive_robust_register.call_historic(kwargs={"registry": _LazyRegistry()})
        if config.getoption("help", False):  # no test runs, and pytest has not read the words after --help
            return
        if config.getoption("drive_robust"):
            from pytest_drive_robust.plugin.quick_import import quick_import

            with quick_import():
                from pytest_drive_robust.plugin.activation import activate
            activate(config)
        else:
            _refuse_options_alone(config)
    except Exception as error:
        from pytest_drive_robust.plugin.usage_errors import raise_as_pytests, told_of_hook

        raise_as_pytests(told_of_hook(error))
        raise
    if hasattr(config, "workerinput") or config.getoption("dist", "no") != "no":  # pytest-xdist, by whatever name
        _carry_problems(config)


def pytest_unconfigure(config: pytest.Config) -> None:
    """Forget the names that this session's conftest files registered."""
    registry = sys.modules.get(_REGISTRY)
    if config in _SESSIONS:
        _SESSIONS.remove(config)
        if registry is not None:
            registry.forget_names(config.stash.get(_OUTER_NAMES, 0))


def pytest_make_parametrize_id(val: object) -> str | None:
    """Name test cases after their requirements."""
    model = sys.modules.get("pytest_drive_robust.verdict.requirement")  # not loaded: then it cannot be one
    return val.id if model is not None and isinstance(val, model.Requirement) else None


@pytest.hookimpl(wrapper=True)
def pytest_make_collect_report(
    collector: pytest.Collector,
) -> Generator[None, pytest.CollectReport, pytest.CollectReport]:
    """Turn a requirement that does not parse into a usage error (exit code 4) without a traceback of our parser."""
    report = yield
    if not report.failed:
        return report
    from pytest_drive_robust.plugin.usage_errors import problems_of, usage_error_in

    error = usage_error_in(report)
    if error is None:
        return report
    problems_of(collector.config).setdefault(str(error), collector.nodeid or collector.name)
    return pytest.CollectReport(collector.nodeid, "passed", None, [])


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Check the markers; without `--drive-robust`, skip every test that uses `drive`."""
    for item in items:
        if item.get_closest_marker("drive_robust") is not None:
            _check_markers(item)
    if config.getoption("drive_robust"):
        _check_marks_of_others(items)
    else:
        skip = pytest.mark.skip(reason=NEEDS_FLAG)
        for item in items:
            if uses_drive(item):
                item.add_marker(skip)


@pytest.hookimpl(tryfirst=True)
def pytest_collection_finish(session: pytest.Session) -> None:
    """Raise the usage errors found during collection. `plugin.collection` has already planned the episodes."""
    usage_errors = sys.modules.get("pytest_drive_robust.plugin.usage_errors")  # not loaded: nothing is wrong
    if usage_errors is not None:
        usage_errors.refuse_problems(session)


def _refuse_options_alone(config: pytest.Config) -> None:
    """Refuse our options typed without `--drive-robust`: all tests that drive would be skipped, and the run look green.

    Options in `addopts` and PYTEST_ADDOPTS are allowed: they serve the runs with `--drive-robust`. `--collect-only` is
    allowed, too: no test runs.
    """
    if config.option.collectonly:
        return
    for word in map(str, config.invocation_params.args):
        if word.partition("=")[0] in OPTIONS:
            raise pytest.UsageError(
                f"{word} has no effect without --drive-robust. Add --drive-robust, or leave {word} out."
            )


def _hide_names_of_outer(config: pytest.Config) -> None:
    """Hide the registered names of an outer session from this one; `pytest_unconfigure` brings them back."""
    registry = sys.modules.get(_REGISTRY)  # not loaded: there are none
    if _SESSIONS and registry is not None:
        config.stash[_OUTER_NAMES] = registry.hide_names()
    _SESSIONS.append(config)


class _LazyRegistry:
    """Stands for `default_registry()` and imports it when a hook first uses it: most sessions have no such hook."""

    def __getattr__(self, name: str) -> Any:
        from pytest_drive_robust.registry.registry import default_registry

        return getattr(default_registry(), name)


def _carry_problems(config: pytest.Config) -> None:
    """Register the carrier of usage errors from pytest-xdist workers to the controller, when there are workers."""
    from pytest_drive_robust.plugin.process_roles import is_controller, is_worker

    if is_controller(config) or is_worker(config):
        from pytest_drive_robust.plugin.usage_errors import ProblemCourier, problems_of

        config.pluginmanager.register(ProblemCourier(problems_of(config)), "drive_robust_problems")


def _check_marks_of_others(items: list[pytest.Item]) -> None:
    from pytest_drive_robust.plugin.misspelt_names import refuse_unknown_marks
    from pytest_drive_robust.plugin.usage_errors import note_problem

    for item in items:
        note_problem(item.config, item.nodeid, partial(refuse_unknown_marks, item))


def _check_markers(item: pytest.Item) -> None:
    from pytest_drive_robust.options.marker import MarkerOptions
    from pytest_drive_robust.plugin.usage_errors import note_problem

    note_problem(item.config, item.nodeid, lambda: MarkerOptions.from_marks(item.iter_markers("drive_robust")))
