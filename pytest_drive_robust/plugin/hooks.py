"""The pytest plugin: options, activation, and hand-over to objects that do the work. Inert without `--drive-robust`.

Where things are: `plugin/fixtures.py` has what tests use, `plugin/xdist.py` every decision about pytest-xdist,
`runner/campaign.py` the episodes, `report/` what people read.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Generator, Iterator
from contextlib import contextmanager
from functools import partial
from typing import TYPE_CHECKING, Any

import pytest

from pytest_drive_robust import errors
from pytest_drive_robust.options.table import (
    DEFAULT_SIMULATOR,
    EXECUTION_OPTIONS,
    MARKER_LINE,
    OPTIONS,
    REGRESSION_OPTIONS,
)
from pytest_drive_robust.plugin import xdist as distributed
from pytest_drive_robust.plugin.fixtures import (
    DRIVER,
    INCONCLUSIVE,
    NEEDS_FLAG,
    BrokenRequirementError,
    Driver,
    NotJudgedError,
    drive,
    drive_agent,
)
from pytest_drive_robust.plugin.selection import everything_ran
from pytest_drive_robust.report.numbers import legible

if TYPE_CHECKING:
    from pathlib import Path

    from pytest_drive_robust.options.execution import ExecutionOptions
    from pytest_drive_robust.options.marker import MarkerOptions
    from pytest_drive_robust.options.run import RunOptions
    from pytest_drive_robust.plugin.plan import PlanPlugin
    from pytest_drive_robust.plugin.run_owner import Record, RunOwner
    from pytest_drive_robust.regression.options import RegressionOptions
    from pytest_drive_robust.regression.waivers import Waivers
    from pytest_drive_robust.runner.campaign import Observer
    from pytest_drive_robust.runner.plan import Scope
    from pytest_drive_robust.store.base import EpisodeStore
    from pytest_drive_robust.verdict.requirement import Requirement

__all__ = ["drive", "drive_agent"]

_NOT_JUDGED = "drive_robust_not_judged"
_FIXTURES = frozenset({"drive", "drive_agent"})
_PROBLEMS = pytest.StashKey["dict[str, str]"]()
"""Usage errors found while collecting, in order: what is wrong, and where first; one of the run itself has no place."""

_PLANNING = "drive_robust_planning"
_ADVICE = pytest.StashKey["dict[str, None]"]()
"""What the routes of the selected tests cannot show, each sentence once."""


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the options of the group drive-robust and an ini key for each."""
    group = parser.getgroup("drive-robust", "drive-robust: closed-loop robustness requirements")
    group.addoption("--drive-robust", action="store_true", help="drive episodes and judge requirements")
    group.addoption("--drive-probe", action="store_true", help="drive one clean episode twice: does one seed suffice?")
    group.addoption("--drive-fresh", action="store_true", help="drive again what earlier runs left in the store")
    group.addoption(
        "--drive-plan", action="store_true", help="show which episodes are needed and stored; drive nothing"
    )
    for option in (*OPTIONS, *EXECUTION_OPTIONS, *REGRESSION_OPTIONS):
        default = f" (default: {option.default})" if option.default else ""
        bare = {"nargs": "?", "const": option.bare} if option.bare else {}
        text = f"{option.help}{default}".replace("%", "%%")  # argparse formats it
        group.addoption(option.flag, metavar=option.metavar, default=None, help=text, **bare)
        parser.addini(option.ini, f"as {option.flag}: {option.help}", default="")


def pytest_addhooks(pluginmanager: pytest.PytestPluginManager) -> None:
    """Add our own hooks."""
    from pytest_drive_robust import hookspecs

    pluginmanager.add_hookspecs(hookspecs)


@pytest.hookimpl(trylast=True)  # the terminal reporter must be there
def pytest_configure(config: pytest.Config) -> None:
    """Register names and, with `--drive-robust`, what drives and reports."""
    config.addinivalue_line("markers", MARKER_LINE)
    problems: dict[str, str] = {}
    config.stash[_PROBLEMS] = problems
    config.stash[_ADVICE] = {}
    with _as_usage_error():
        # Also without the switch: suites that are only collected may use registered perturbations in their sentences.
        config.hook.pytest_drive_robust_register.call_historic(kwargs={"registry": _LazyRegistry()})
        if config.getoption("drive_robust"):
            _activate(config)
    if config.pluginmanager.hasplugin("xdist"):
        config.pluginmanager.register(distributed.ProblemCourier(problems), "drive_robust_problems")


def pytest_unconfigure() -> None:
    """Forget the names that this session's conftest files registered."""
    registry = sys.modules.get("pytest_drive_robust.registry.registry")
    if registry is not None:
        registry.default_registry.cache_clear()


def pytest_make_parametrize_id(val: object) -> str | None:
    """Requirements name their test cases."""
    model = sys.modules.get("pytest_drive_robust.verdict.requirement")  # not loaded: then it cannot be one
    return val.id if model is not None and isinstance(val, model.Requirement) else None


@pytest.hookimpl(wrapper=True)
def pytest_make_collect_report(
    collector: pytest.Collector,
) -> Generator[None, pytest.CollectReport, pytest.CollectReport]:
    """A sentence that we do not understand is a usage error (exit code 4), not a traceback of our parser."""
    report = yield
    error = _usage_error_in(report)
    if error is None:
        return report
    collector.config.stash[_PROBLEMS].setdefault(str(error), collector.nodeid or collector.name)
    return pytest.CollectReport(collector.nodeid, "passed", None, [])


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Check the markers; without `--drive-robust`, skip what would have to drive."""
    for item in items:
        if item.get_closest_marker("drive_robust") is not None:
            _check(config, item.nodeid, partial(_marker_of, item))
    if not config.getoption("drive_robust"):
        skip = pytest.mark.skip(reason=NEEDS_FLAG)
        for item in _driving(items):
            item.add_marker(skip)


@pytest.hookimpl(tryfirst=True)
def pytest_collection_finish(session: pytest.Session) -> None:
    """Everything that can be checked without driving is checked here; then the plan is made."""
    config = session.config
    driver = config.stash.get(DRIVER, None)
    if driver is not None and not config.stash[_PROBLEMS]:
        _plan(driver, session)
    problems = config.stash[_PROBLEMS]
    if problems and distributed.is_worker(config):
        session.items.clear()  # the controller reports the problems, see distributed.ProblemCourier
    elif problems:
        raise pytest.UsageError("\n".join(distributed.sentences(problems)))


class _LazyRegistry:
    """`default_registry()`, imported when a hook first touches it: most sessions have no such hook."""

    def __getattr__(self, name: str) -> Any:
        from pytest_drive_robust.registry.registry import default_registry

        return getattr(default_registry(), name)


class DrivingPlugin:
    """In every process that runs tests. `last_words()` are what broken episodes printed since it was asked last."""

    def __init__(self, driver: Driver, last_words: Callable[[], tuple[tuple[str, str], ...]] = tuple) -> None:
        self._driver = driver
        self._last_words = last_words

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_makereport(
        self, call: pytest.CallInfo[None]
    ) -> Generator[None, pytest.TestReport, pytest.TestReport]:
        """Our message in one line for the short summary, and a mark on what could not be judged."""
        report = yield
        error = call.excinfo.value if call.excinfo is not None else None
        if report.failed and isinstance(error, (BrokenRequirementError, NotJudgedError)):
            crash = getattr(report.longrepr, "reprcrash", None)
            if crash is not None:
                crash.message = str(error).partition("   (")[0].partition("\n")[0]
            if isinstance(error, NotJudgedError):
                vars(report)[_NOT_JUDGED] = True  # a plain attribute: it travels from workers
            report.sections += [
                (legible(f"printed by {episode}"), legible(text)) for episode, text in self._last_words()
            ]
        return report

    def pytest_unconfigure(self) -> None:
        """Close simulators."""
        self._driver.campaign.close()


class ReportingPlugin:
    """In the one process that people look at: the only one, or the controller of pytest-xdist."""

    def __init__(self, config: pytest.Config, owner: RunOwner, header: str) -> None:
        self._config = config
        self._owner = owner
        self._header = header
        self._ran = False

    def pytest_report_header(self) -> str:
        """The effective choices, in one line."""
        return self._header

    def pytest_report_collectionfinish(self) -> list[str]:
        """Before anything is driven: what so many routes cannot show."""
        return [f"drive-robust: {text}" for text in self._config.stash[_ADVICE]]

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtestloop(self) -> None:
        """Tests are about to run; --fixtures, --markers and the like never come here."""
        only_looking = ("collectonly", "setupplan", "setuponly", "drive_plan")
        self._ran = not any(self._config.getoption(name, False) for name in only_looking)

    @pytest.hookimpl(tryfirst=True)
    def pytest_report_teststatus(
        self, report: pytest.TestReport
    ) -> tuple[str, str, tuple[str, dict[str, bool]]] | None:
        """What could not be judged counts as an error of the test; an open verdict is neither dot nor F."""
        if getattr(report, _NOT_JUDGED, False):
            return "error", "E", ("ERROR", {"red": True})
        if report.when == "call" and report.passed and any(name == INCONCLUSIVE for name, _ in report.user_properties):
            return "inconclusive", "~", ("INCONCLUSIVE", {"yellow": True})
        return None

    @pytest.hookimpl(trylast=True)
    def pytest_sessionfinish(self, session: pytest.Session) -> None:
        """Close the books. A run that drove no episode, or whose file was not written, is not green."""
        if self._ran and not self._config.stash[_PROBLEMS]:
            problem = self._owner.finish(whole=everything_ran(session))
            if problem and session.exitstatus == pytest.ExitCode.OK:
                session.exitstatus = pytest.ExitCode.TESTS_FAILED

    def pytest_terminal_summary(self, terminalreporter: pytest.TerminalReporter) -> None:
        """The table, and why the run is not green."""
        text = self._owner.text(colour=terminalreporter.hasmarkup)
        if text:
            terminalreporter.section("drive-robust")
            terminalreporter.write_line(text)
        for title, text in self._owner.sections(colour=terminalreporter.hasmarkup):
            terminalreporter.section(title)
            terminalreporter.write_line(text)


def _activate(config: pytest.Config) -> None:
    """With `--drive-robust`: decide what this process does, and register only that."""
    from dataclasses import replace

    from pytest_drive_robust.options.execution import ExecutionOptions
    from pytest_drive_robust.options.run import RunOptions
    from pytest_drive_robust.plugin.assembly import is_outside, outside_settings
    from pytest_drive_robust.plugin.interrupt import StopPlugin
    from pytest_drive_robust.plugin.waivers import WaivingPlugin
    from pytest_drive_robust.registry.plugins import plugin_words
    from pytest_drive_robust.regression.options import RegressionOptions
    from pytest_drive_robust.regression.waivers import Waivers

    settings = replace(RunOptions.from_pytest_config(config), plugins=plugin_words(config.pluginmanager))
    execution = ExecutionOptions.from_pytest_config(config)
    settings = outside_settings(config, settings, execution)
    choices = RegressionOptions.from_pytest_config(config, config.rootpath)
    waivers = Waivers.of(choices.waivers)
    config.pluginmanager.register(WaivingPlugin(waivers), "drive_robust_waiving")
    config.pluginmanager.register(StopPlugin(), "drive_robust_stopping")
    if not distributed.is_worker(config):
        _own_the_run(config, settings, execution, choices, waivers)
        return
    begin = partial(_drive_here, config, settings, execution, choices, shared=True)
    folder = distributed.join_run(config, settings, begin)
    if not is_outside(settings):
        _help_others(config, folder)


def _own_the_run(
    config: pytest.Config,
    settings: RunOptions,
    execution: ExecutionOptions,
    choices: RegressionOptions,
    waivers: Waivers,
) -> None:
    """In the process that reports: drive here, or follow what the workers drive."""
    from pytest_drive_robust.plugin.plan import check_plan_alone
    from pytest_drive_robust.plugin.regressions import Epilogue
    from pytest_drive_robust.plugin.run_owner import LocalRecord, RunOwner
    from pytest_drive_robust.plugin.screen import progress_for
    from pytest_drive_robust.store.opening import new_run_name, open_store

    if config.getoption("drive_plan"):
        check_plan_alone(config)
    epilogue = Epilogue(choices, settings, waivers)  # before anything is driven: its reference may not be there
    routes = _routes_in_words(settings)
    record: Record
    if distributed.is_controller(config):
        execution.check_workers()
        record = distributed.start_run(config, settings, execution)
    else:
        record = local = LocalRecord(progress_for(config), open_store(settings, config.rootpath, run=new_run_name()))
        _drive_here(config, settings, execution, choices, local.store, local, shared=False)
    owner = RunOwner(settings, record, versions={"pytest": pytest.__version__}, epilogue=epilogue)
    header = " ".join((_header(settings, routes), *choices.in_words()))
    config.pluginmanager.register(ReportingPlugin(config, owner, header), "drive_robust_reporting")
    if config.getoption("drive_probe"):
        from pytest_drive_robust.plugin.probe import ProbePlugin

        config.pluginmanager.register(ProbePlugin(config, settings, owner), "drive_robust_probing")


def _drive_here(
    config: pytest.Config,
    settings: RunOptions,
    execution: ExecutionOptions,
    choices: RegressionOptions,
    store: EpisodeStore,
    observer: Observer,
    *,
    shared: bool,
) -> None:
    from pytest_drive_robust.plugin.assembly import crew_of
    from pytest_drive_robust.runner.campaign import Campaign

    scopes, executor = crew_of(config, settings, execution, shared=shared, store=store, ticked=observer.ticked)
    campaign = Campaign(
        store, executor, observer, metrics=settings.metrics, whole=choices.drives_all, budget_s=execution.budget_s
    )
    driver = Driver(settings, scopes, campaign)
    config.stash[DRIVER] = driver
    config.pluginmanager.register(DrivingPlugin(driver, getattr(executor, "last_words", tuple)), "drive_robust_driving")
    if config.getoption("drive_plan"):
        from pytest_drive_robust.plugin.plan import PlanPlugin

        config.pluginmanager.register(PlanPlugin(config, store, slots=executor.slots), _PLANNING)


def _help_others(config: pytest.Config, folder: Path) -> None:
    """In a worker of pytest-xdist."""
    from pytest_drive_robust.plugin.helping import HelpingPlugin

    driver = config.stash[DRIVER]
    name: str = config.workerinput["workerid"]  # type: ignore[attr-defined]
    config.pluginmanager.register(HelpingPlugin(folder, name, driver.scopes, driver.campaign), "drive_robust_helping")


def _plan(driver: Driver, session: pytest.Session) -> None:
    """Check the names that the run and each test use, and tell how many episodes the selected tests need."""
    from pytest_drive_robust.verdict.requirement import Requirement, by_evidence

    _check(session.config, "", driver.scopes.check)
    requests: dict[str, Any] = {}
    advice = session.config.stash[_ADVICE]
    scopes: dict[tuple[str, str], Scope] = {}
    judged = 0

    def add(item: pytest.Item) -> None:
        nonlocal judged
        scope = driver.scopes.of(_marker_of(item))
        scopes.setdefault((scope.agent, scope.routes_spec), scope)
        callspec = getattr(item, "callspec", None)
        params = callspec.params.values() if callspec is not None else ()
        wanted = [value for value in params if isinstance(value, Requirement)]
        for requirement in wanted:
            driver.scopes.check_setting(requirement.setting)
            advice.update(dict.fromkeys(_advice(driver, item, requirement, len(scope.routes))))
        requests.update(scope.plan(wanted))
        verdict_rule = _marker_of(item).verdict_rule(driver.settings.verdict_rule).for_routes(len(scope.routes))
        judged += by_evidence(wanted, verdict_rule)

    for item in _driving(session.items):
        _check(session.config, item.nodeid, partial(add, item))
    if driver.settings.correction != "none":
        session.config.stash[DRIVER] = driver._replace(family=max(1, judged))
    driver.campaign.planned(requests, ahead=not distributed.is_worker(session.config))
    _check(session.config, "", lambda: driver.scopes.check_requests(requests.values()))
    planning: PlanPlugin | None = session.config.pluginmanager.get_plugin(_PLANNING)
    if planning is not None:
        planning.see(requests)
    distributed.send_advice(session.config, driver.campaign.tell, tuple(advice))
    _check(session.config, "", lambda: driver.campaign.identified(map(driver.scopes.identify, scopes.values())))


def _advice(driver: Driver, item: pytest.Item, requirement: Requirement, routes: int) -> list[str]:
    """What the routes of a test cannot show. Raises `UsageError` where they can show next to nothing."""
    verdict_rule = _marker_of(item).verdict_rule(driver.settings.verdict_rule).for_routes(routes)
    advice = requirement.advice(verdict_rule, routes)
    if advice.level == "refuse":
        raise errors.UsageError(f"{advice.text} Or judge exactly these routes: --drive-verdict list.")
    return [advice.text] if advice.text else []


def _check(config: pytest.Config, where: str, attempt: Any) -> None:
    """Call `attempt`; what is wrong in it becomes one of the session's problems."""
    try:
        attempt()
    except errors.UsageError as error:
        config.stash[_PROBLEMS].setdefault(str(error), where)


def _driving(items: list[pytest.Item]) -> Iterator[pytest.Item]:
    return (item for item in items if not _FIXTURES.isdisjoint(getattr(item, "fixturenames", ())))


def _marker_of(item: pytest.Item) -> MarkerOptions:
    from pytest_drive_robust.options.marker import MarkerOptions

    return MarkerOptions.from_marks(item.iter_markers("drive_robust"))


def _usage_error_in(report: pytest.CollectReport) -> errors.UsageError | None:
    """Our usage error behind a failed collection, also when a conftest.py raised it."""
    call = report.__dict__.get("call")
    error = call.excinfo.value if call is not None and call.excinfo is not None else None
    error = getattr(error, "cause", error)
    return error if isinstance(error, errors.UsageError) else None


def _routes_in_words(settings: RunOptions) -> str:
    """How many routes are driven, and what they are called."""
    from pytest_drive_robust.plugin.assembly import is_outside
    from pytest_drive_robust.registry.registry import default_registry
    from pytest_drive_robust.runner.routes import default_spec, resolve_routes, routes_for

    if is_outside(settings):
        return settings.routes if settings.routes_given else f"all of {settings.simulator}"
    if settings.simulator == DEFAULT_SIMULATOR:
        return f"{len(resolve_routes(settings.routes))} ({settings.routes})"
    try:
        simulator = default_registry().simulator(settings.simulator)
    except errors.UsageError:  # the collection says what is wrong, or a conftest.py deeper down knows the name
        return settings.routes
    spec = default_spec(settings, simulator)
    return f"{len(routes_for(spec, simulator))} ({spec})"


def _header(settings: RunOptions, routes: str) -> str:
    seeds = ",".join(map(str, settings.seeds))
    correction = "" if settings.correction == "none" else f" correction={settings.correction}"
    return (
        f"drive-robust: agent={settings.agent} sim={settings.simulator} routes={routes} "
        f"seeds={seeds} metrics={settings.metrics}{correction}"
    )


@contextmanager
def _as_usage_error() -> Iterator[None]:
    """Our usage errors as pytest's, which end with exit code 4 and without a traceback."""
    try:
        yield
    except errors.UsageError as error:
        raise pytest.UsageError(str(error)) from None
