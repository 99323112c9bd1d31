"""Registers the plugin objects of this process under `--drive-robust`. Imported only with that option.

Modules that few sessions use are imported late: each import adds a millisecond to a run whose episodes are all stored.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import pytest

from pytest_drive_robust.options.execution import ExecutionOptions
from pytest_drive_robust.options.run import RunOptions
from pytest_drive_robust.plugin import xdist
from pytest_drive_robust.plugin.backends import backend_for
from pytest_drive_robust.plugin.collection import CollectionPlugin
from pytest_drive_robust.plugin.driving import DrivingPlugin
from pytest_drive_robust.plugin.external_options import external_options
from pytest_drive_robust.plugin.fixtures import DRIVE_CONTEXT
from pytest_drive_robust.plugin.interrupt import InterruptPlugin
from pytest_drive_robust.plugin.judging import DriveContext
from pytest_drive_robust.plugin.misspelt_names import refuse_unknown_keys
from pytest_drive_robust.plugin.moved_root import refuse_moved_root
from pytest_drive_robust.plugin.process_roles import is_controller, is_worker, worker_input
from pytest_drive_robust.plugin.regression_checks import RegressionChecks
from pytest_drive_robust.plugin.reporting import ReportingPlugin, header
from pytest_drive_robust.plugin.run_outputs import LocalRunRecord, RunOutputs
from pytest_drive_robust.plugin.stopped_tests import StoppedTestsPlugin
from pytest_drive_robust.plugin.terminal import progress_for
from pytest_drive_robust.plugin.unread_ini import refuse_unread_ini
from pytest_drive_robust.plugin.waivers import WaivingPlugin
from pytest_drive_robust.registry.plugins import plugin_words
from pytest_drive_robust.regression.options import RegressionOptions
from pytest_drive_robust.regression.waivers import Waivers
from pytest_drive_robust.runner.cache_key.code_text import begin_run
from pytest_drive_robust.runner.campaign import Campaign
from pytest_drive_robust.runner.scheduler import Observer
from pytest_drive_robust.store.base import EpisodeStore
from pytest_drive_robust.store.opening import new_run_name, open_store


def activate(config: pytest.Config) -> None:
    """Register the plugin objects that this process needs. Raises `UsageError` for options that cannot be used."""
    if not is_worker(config):
        refuse_moved_root(config)
        refuse_unread_ini(config)
    refuse_unknown_keys(config)
    options = replace(RunOptions.from_pytest_config(config), plugins=plugin_words(config.pluginmanager))
    execution = ExecutionOptions.from_pytest_config(config)
    options = external_options(config, options, execution)
    regression = RegressionOptions.from_pytest_config(config)
    waivers = Waivers.of(regression.waivers)
    config.pluginmanager.register(WaivingPlugin(waivers), "drive_robust_waiving")
    config.pluginmanager.register(StoppedTestsPlugin(), "drive_robust_stopping")
    config.pluginmanager.register(InterruptPlugin(), "drive_robust_interrupt")
    if options.plan:
        from pytest_drive_robust.plugin.plan_option import check_plan_alone

        check_plan_alone(config)
    checks = RegressionChecks(regression, options, waivers)  # before driving: a missing reference costs no episode
    session = _Session(config, options, execution, regression, checks, waivers)
    if not is_worker(config):
        session.report()
        return
    folder = xdist.join_run(config, options, session.drive)
    if not options.is_external:
        from pytest_drive_robust.plugin.idle_workers import IdleWorkerPlugin

        context = config.stash[DRIVE_CONTEXT]
        idle = IdleWorkerPlugin(folder, worker_input(config)["workerid"], context.scopes, context.campaign)
        config.pluginmanager.register(idle, "drive_robust_idle_worker")


class _Session(NamedTuple):
    """The options of the run and the checks made from them, for the plugin objects of this process."""

    config: pytest.Config
    options: RunOptions
    execution: ExecutionOptions
    regression: RegressionOptions
    checks: RegressionChecks
    waivers: Waivers

    def report(self) -> None:
        """Register the reports of the run, in the controller of pytest-xdist or in the only process, which also drives.

        Raises `UsageError` for options that cannot be used.
        """
        config, options = self.config, self.options
        if options.report_path is not None:
            from pytest_drive_robust.report.pages.folder import check_folder  # loads the page templates

            check_folder(options.report_path, source="--drive-report")
        first_line = " ".join((header(options), *self.regression.in_words()))
        record: LocalRunRecord | xdist.SharedRunRecord
        if is_controller(config):
            self.execution.check_workers()
            record = xdist.start_run(config, options)
        else:
            name = new_run_name()
            begin_run(name)
            store = open_store(options, config.rootpath, run=name)
            record = local = LocalRunRecord(progress_for(config), store)
            self.drive(store, local)
        outputs = RunOutputs(options, record, self.checks)
        config.pluginmanager.register(ReportingPlugin(config, outputs, first_line), "drive_robust_reporting")
        if options.probe:
            from pytest_drive_robust.plugin.probe_option import ProbePlugin

            config.pluginmanager.register(ProbePlugin(config, options, outputs), "drive_robust_probing")

    def drive(self, store: EpisodeStore, observer: Observer) -> None:
        """Register the plugin objects that drive episodes into `store` and send events to `observer`."""
        config, options, execution = self.config, self.options, self.execution
        scopes, executor = backend_for(config, options, execution, store=store, ticked=observer.ticked)
        keeps = options.store != "off"  # later runs read these episodes by key, so the key must fit the agent
        campaign = Campaign(
            store,
            executor,
            observer,
            metrics=options.metrics,
            whole=self.regression.drives_all,
            budget_s=execution.budget_s,
            require_unchanged=scopes.require_unchanged if keeps else lambda agent: None,
        )
        config.stash[DRIVE_CONTEXT] = DriveContext(options, scopes, campaign, self.waivers)
        config.pluginmanager.register(DrivingPlugin(campaign, executor.last_words), "drive_robust_driving")
        collection = CollectionPlugin(self.checks)
        config.pluginmanager.register(collection, "drive_robust_collection")
        if options.plan:
            from pytest_drive_robust.plugin.plan_option import PlanPlugin

            planned = (collection.requests, collection.verdict_plans, collection.unplanned)
            plan = PlanPlugin(config, campaign, store, *planned, executor)
            config.pluginmanager.register(plan, "drive_robust_planning")
