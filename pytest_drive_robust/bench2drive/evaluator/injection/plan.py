"""The setting to inject, read from environment variables."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from typing import NamedTuple

from pytest_drive_robust.domain.observation import CameraSpec
from pytest_drive_robust.errors import UsageError
from pytest_drive_robust.perturbations import BUILTIN, InferenceLatency, RunningStack, Setting

__all__ = ["InjectionPlan", "SettingRefusedError", "plan_from"]

DT_S = 0.05


class SettingRefusedError(Exception):
    """The environment asks for something that cannot be injected."""


class InjectionPlan(NamedTuple):
    """The injection that the environment asks for: a `Setting`, the base seed, and the setting's sentence `told`.

    `dt_s` is the length of a tick in seconds, `log` the file for the log, empty for none.
    """

    setting: Setting
    seed: int
    dt_s: float
    told: str
    log: str

    def started(self, route: str, repetition: int, rig: Iterable[CameraSpec]) -> RunningStack:
        """Return the setting, started for one route; `repetition` is added to the seed."""
        seed = self.seed + repetition
        return RunningStack.of(self.setting, route_id=route, seed=seed, dt_s=self.dt_s, cameras=tuple(rig))

    @property
    def is_late(self) -> bool:
        """True when the setting has a latency, so that commands come late."""
        return any(isinstance(item, InferenceLatency) for item in self.setting.perturbations)

    @property
    def observes(self) -> bool:
        """True when the setting changes a signal that the agent gets."""
        return not all(isinstance(item, InferenceLatency) for item in self.setting.perturbations)


def plan_from(environ: Mapping[str, str]) -> InjectionPlan:
    """Return the plan of an environment. Raises `SettingRefusedError`, also for an impossible severity."""
    text = environ.get("PDR_SETTING", "").strip()
    try:
        plan = _plan_of_document(text, environ) if text else _plan_of_variables(environ)
        plan.started("", 0, ())
    except UsageError as error:
        raise SettingRefusedError(str(error)) from None
    except (ValueError, TypeError, KeyError, AttributeError) as error:
        raise SettingRefusedError(f"PDR_SETTING is not a setting ({error!r}): {text:.200}") from None
    return plan


def _plan_of_document(text: str, environ: Mapping[str, str]) -> InjectionPlan:
    document = json.loads(text)
    stack = []
    for item in document["stack"]:
        if item["name"] not in BUILTIN:
            known = ", ".join(sorted(BUILTIN))
            raise SettingRefusedError("no perturbation {!r}; known: {}".format(item["name"], known))
        stack.append(BUILTIN[item["name"]](**item.get("parameters", {})))
    log = environ.get("PDR_LOG", "") or str(document.get("log", ""))
    seed, dt_s = int(document.get("seed", 0)), float(document.get("dt_s", DT_S))
    return InjectionPlan(Setting.of(*stack), seed, dt_s, str(document.get("setting", "")), log)


def _plan_of_variables(environ: Mapping[str, str]) -> InjectionPlan:
    """Return the plan of the released code's variables. `ROBUSTNESS_SEED` is the seed, as no option gives one here."""
    text = environ.get("ROBUSTNESS_SEED", "").strip()
    if text and not text.lstrip("+-").isdecimal():
        raise SettingRefusedError(f"ROBUSTNESS_SEED is {text!r}, expected a whole number")
    setting = Setting.from_env({**environ, "ROBUSTNESS_SEED": ""})
    told = "clean" if setting.is_clean else "variables of the released code"
    return InjectionPlan(setting, int(text or 0), DT_S, told, environ.get("PDR_LOG", ""))
