"""The steps of severities, from mild to severe."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import pytest

from pytest_drive_robust import requirements
from pytest_drive_robust.errors import PerturbationError
from pytest_drive_robust.perturbations import BUILTIN, GpsNoise, InferenceLatency, Perturbation, Setting, SpeedNoise
from pytest_drive_robust.perturbations.ladder import failure_word, ladder_of


@dataclass
class Dimmed(Perturbation):
    gain: float = 0.5
    noise: float = 0.0
    phrase = "dimmed {gain}"
    ladder: ClassVar[tuple[str, tuple[float, ...]]] = ("gain", (0.9, 0.5, 0.1))


@dataclass
class Blinking(Perturbation):
    rate_hz: float = 2.0
    phrase = "blinking {rate_hz}"


@pytest.mark.parametrize("cls", BUILTIN.values())
def test_every_shipped_failure_has_a_ladder_whose_severities_it_can_have(cls: type[Perturbation]) -> None:
    ladder = ladder_of(cls, dt_s=0.05)
    severities = [ladder.severity(level) for level in ladder.levels]
    assert severities == sorted(set(severities))
    assert [ladder.level_of(ladder.at(level)) for level in ladder.levels] == list(ladder.levels)


def test_latency_steps_by_the_ticks_of_the_simulator() -> None:
    assert ladder_of(InferenceLatency, dt_s=0.02).levels[:3] == (20.0, 40.0, 60.0)
    ends = {0.05: 1000.0, 0.06: 960.0, 0.1: 1000.0, 1 / 30: 1000.0, 1.5: 1500.0}
    assert {dt_s: ladder_of(InferenceLatency, dt_s=dt_s).levels[-1] for dt_s in ends} == ends
    ladder = ladder_of(InferenceLatency, dt_s=0.02)
    assert ladder.severity(150.0) == ladder.severity(140.0) < ladder.severity(160.0)


def test_an_object_keeps_its_other_severities() -> None:
    ladder = ladder_of(InferenceLatency(ms=0, mode="hold"), dt_s=0.05)
    assert str(ladder.at(100.0)) == "100 ms latency (mode=hold)"
    with pytest.raises(PerturbationError, match=r"'100 ms latency' is not on the ladder of InferenceLatency\.ms"):
        ladder.level_of(InferenceLatency(ms=100))
    with pytest.raises(PerturbationError, match="is not on the ladder"):
        ladder.level_of(GpsNoise())


def test_a_factor_grows_more_severe_as_it_falls() -> None:
    ladder = ladder_of(SpeedNoise, dt_s=0.05)
    assert ladder.severity(0.2) > ladder.severity(0.5)


def test_one_level_alone_is_of_a_severity_that_grows() -> None:
    ladder = ladder_of(GpsNoise, dt_s=0.05, levels=(5.0,))
    assert ladder.severity(3.0) < ladder.severity(5.0)


def test_a_class_of_a_user_brings_its_own_steps() -> None:
    ladder = ladder_of(Dimmed(noise=0.3), dt_s=0.05)
    assert ladder.levels == (0.9, 0.5, 0.1)
    assert ladder.at(0.1) == Dimmed(gain=0.1, noise=0.3)
    assert ladder.label(0.9) == "0.9"
    assert ladder.label(0.1 + 0.2) == "0.3"


@dataclass
class Dirt(Perturbation):
    share: float = 0.3
    kind: str = "mud"
    phrase = "dirt"
    ladder: ClassVar = ("share", (0.1, 0.3))


def test_the_name_holds_no_level_where_the_phrase_shows_none() -> None:
    assert ladder_of(Dirt, dt_s=0.05).name == "dirt"
    assert ladder_of(Dirt(kind="rain"), dt_s=0.05).name == "dirt (kind=rain)"


def test_a_class_without_steps_is_told_how_to_declare_them() -> None:
    with pytest.raises(PerturbationError, match=r"Blinking has no ladder .* ladder: ClassVar = \('rate_hz', \(mildest"):
        ladder_of(Blinking, dt_s=0.05)


@pytest.mark.parametrize("levels", [(), (1.0, 3.0, 2.0), (1.0, 1.0), (float("nan"),)])
def test_levels_that_do_not_lead_one_way_are_refused(levels: tuple[float, ...]) -> None:
    with pytest.raises(PerturbationError, match="expected at least one, from mild to severe"):
        ladder_of(GpsNoise, dt_s=0.05, levels=levels)


@pytest.mark.parametrize("levels", [["5 m"], 5, [None]])
def test_levels_that_are_no_numbers_are_refused(levels: Any) -> None:
    with pytest.raises(PerturbationError, match="expected a list of numbers, from mild to severe"):
        ladder_of(GpsNoise, dt_s=0.05, levels=levels)


def test_levels_that_the_failure_cannot_have_are_refused_before_anything_is_driven() -> None:
    with pytest.raises(PerturbationError, match=r"std_m is -1\.0"):
        ladder_of(GpsNoise, dt_s=0.05, levels=(5.0, 3.0, -1.0))


def test_failures_are_called_by_the_words_of_their_phrases() -> None:
    words = {failure_word(cls) for cls in BUILTIN.values()}
    assert {"latency", "GPS noise", "burst frame drop", "occlusion", "speed noise", "frame blend"} < words


@dataclass
class LensDirt(Perturbation):
    share: float = 0.3
    ladder: ClassVar = ("share", (0.1, 0.3))


def test_a_class_without_a_phrase_is_called_in_a_margin_as_in_every_other_sentence() -> None:
    known = {"lens-dirt": LensDirt}
    plain, margin = requirements("RD under lens dirt <= 0.3", "lens dirt margin >= 0.1 (RD <= 0.40)", known=known)
    assert (plain.setting, margin.setting) == (Setting.of(LensDirt()), Setting.of(LensDirt(0.1)))
    assert str(margin) == "lens dirt margin >= 0.1 (RD <= 0.40)"


@pytest.mark.parametrize("given", [GpsNoise(std_m=5) + InferenceLatency(ms=100), "GPS noise"])
def test_what_is_not_one_failure_has_no_ladder(given: Any) -> None:
    with pytest.raises(PerturbationError, match="expected one Perturbation"):
        ladder_of(given, dt_s=0.05)


def test_a_ladder_of_a_field_that_is_not_there_is_refused() -> None:
    @dataclass
    class Dim(Perturbation):
        gain: float = 0.5
        ladder = ("gian", (0.9, 0.5))

    with pytest.raises(PerturbationError, match="the ladder of Dim names 'gian', expected gain"):
        ladder_of(Dim, dt_s=0.05)


def test_fields_without_default_are_taken_from_the_example() -> None:
    @dataclass
    class Dust(Perturbation):
        kind: str
        gain: float = 0.5
        example: ClassVar = {"kind": "fine"}
        ladder = ("gain", (0.9, 0.5))

    assert ladder_of(Dust, dt_s=0.05).at(0.5) == Dust("fine", 0.5)
