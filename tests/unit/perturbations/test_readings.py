"""Readings preset the switches that nobody said, and a sentence that says both is refused with both."""

from __future__ import annotations

import copy
import dataclasses
import pickle
from typing import ClassVar

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pytest_drive_robust.errors import PerturbationError, UnknownNameError
from pytest_drive_robust.perturbations import (
    BUILTIN,
    BurstFrameDrop,
    GpsNoise,
    InferenceLatency,
    PartialObservation,
    Perturbation,
    Setting,
    SpeedNoise,
)
from pytest_drive_robust.perturbations.ladder import ladder_of
from pytest_drive_robust.perturbations.readings import READINGS, DriveReading
from pytest_drive_robust.perturbations.readings import __doc__ as table

PAPER, RELEASED = (DriveReading(name, f"--drive-reading {name}") for name in READINGS)

SWITCHES = {
    "inference-latency": {
        "paper": {"mode": "fifo", "warmup_ticks": 0},
        "released": {"mode": "hold", "warmup_ticks": 20},
    },
    "burst-frame-drop": {"paper": {"length": "fixed"}, "released": {"length": "uniform"}},
    "partial-observation": {"released": {"area": False}},
}
OTHERS = {"mode": ("fifo", "hold"), "warmup_ticks": (0, 7, 20), "length": ("fixed", "uniform"), "area": (False, True)}


def made(name: str, **severities: object) -> Perturbation:
    return BUILTIN[name](**{**BUILTIN[name].example, **severities})


@pytest.mark.parametrize("name", BUILTIN)
def test_a_class_says_where_the_readings_differ_and_its_default_is_the_papers(name: str) -> None:
    assert {key: dict(value) for key, value in BUILTIN[name].readings.items()} == SWITCHES.get(name, {})
    for switch, value in BUILTIN[name].readings.get("paper", {}).items():
        assert made(name).parameters()[switch] == value


@pytest.mark.parametrize("name", BUILTIN)
def test_the_table_of_the_readings_names_every_failure_and_every_switch(name: str) -> None:
    assert table is not None
    row = next(line for line in table.splitlines() if line.startswith(name.replace("-", " ").replace("gps", "GPS")))
    switches = {switch for of_reading in SWITCHES.get(name, {}).values() for switch in of_reading}
    assert all(f"`{switch}=" in table for switch in switches)
    assert bool(switches) != ("the same in both" in row)


@pytest.mark.parametrize(
    ("given", "released"),
    [
        (InferenceLatency(ms=200), "200 ms latency (reading=released)"),
        (InferenceLatency(200), "200 ms latency (reading=released)"),
        (InferenceLatency(ms=200, mode="hold"), "200 ms latency (reading=released)"),
        (InferenceLatency(mode="measured"), "measured latency (reading=released)"),
        (BurstFrameDrop(length_s=3, probability=0.1), "3 s burst frame drop (reading=released, probability=0.1)"),
        (PartialObservation(0.8, fill="gray"), "occlusion 0.8 (fill=gray)"),
        (GpsNoise(std_m=5), "GPS noise 5 m"),
        (SpeedNoise(mean=0.2), "speed noise 0.2"),
    ],
)
def test_a_reading_sets_the_switches_that_nobody_said(given: Perturbation, released: str) -> None:
    before = given.parameters()
    assert str(given.read_as(RELEASED)) == released
    assert given.parameters() == before


def test_the_sentence_of_a_reading_is_that_of_its_switches() -> None:
    spelled = Setting.parse("200 ms latency (mode=hold, warmup_ticks=20) and 1 s burst frame drop (length=uniform)")
    short = Setting.parse("200 ms latency (reading=released) and 1 s burst frame drop (reading=released)")
    assert spelled == short
    assert str(spelled) == str(short)
    assert str(short.baseline) == "0 ms latency (reading=released)"


@pytest.mark.parametrize("sentence", ["200 ms latency (mode=hold)", "200 ms latency (reading=released)"])
def test_half_of_a_readings_switches_are_no_reading(sentence: str) -> None:
    assert str(Setting.parse(sentence)) == sentence


def test_who_is_nearest_to_the_failure_decides_how_it_is_read() -> None:
    stack = Setting.parse("200 ms latency (reading=paper) and 1 s burst frame drop")
    assert str(stack.read_as(RELEASED)) == "200 ms latency and 1 s burst frame drop (reading=released)"
    assert str(stack.read_as(RELEASED).read_as(PAPER)) == str(stack.read_as(RELEASED))
    assert stack.read_as(None) is stack


@pytest.mark.parametrize(
    ("given", "reading", "said", "has"),
    [
        (InferenceLatency(ms=200, mode="fifo"), RELEASED, "mode=fifo", "mode=hold"),
        (InferenceLatency(200, "hold"), PAPER, "mode=hold", "mode=fifo"),
        (InferenceLatency(ms=200, warmup_ticks=5), RELEASED, "warmup_ticks=5", "warmup_ticks=20"),
        (InferenceLatency(mode="measured", warmup_ticks=0), RELEASED, "warmup_ticks=0", "warmup_ticks=20"),
        (BurstFrameDrop(length="uniform"), PAPER, "length=uniform", "length=fixed"),
        (PartialObservation(area=True), RELEASED, "area=true", "area=false"),
    ],
)
def test_a_switch_that_contradicts_the_reading_is_refused_with_both_names(
    given: Perturbation, reading: DriveReading, said: str, has: str
) -> None:
    with pytest.raises(PerturbationError) as refused:
        given.read_as(reading)
    message = str(refused.value)
    assert said in message
    assert f"contradicts the reading {reading.name!r}, which has {has} ({reading.asked})" in message


def test_a_mask_ratio_of_the_area_contradicts_the_released_code_and_not_the_papers_text() -> None:
    assert PartialObservation(area=True).read_as(PAPER) == PartialObservation(area=True)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("200 ms latency (reading=relesed)", r"Did you mean 'released'"),
        ("200 ms latency (reding=released)", r"Did you mean 'reading'"),
        ("200 ms latency (reading=)", "not name=value"),
    ],
)
def test_a_reading_that_does_not_parse_is_refused(text: str, message: str) -> None:
    with pytest.raises(Exception, match=message):
        Setting.parse(text)


def test_an_unknown_reading_says_who_asked_for_it() -> None:
    with pytest.raises(UnknownNameError, match="asked for by --drive-reading older"):
        DriveReading("older", "--drive-reading older")


@pytest.mark.parametrize("duplicate", [copy.deepcopy, copy.copy, lambda item: pickle.loads(pickle.dumps(item))])
def test_what_was_said_is_not_forgotten_by_a_copy(duplicate) -> None:  # type: ignore[no-untyped-def]
    assert str(duplicate(InferenceLatency(ms=200)).read_as(RELEASED)) == "200 ms latency (reading=released)"
    with pytest.raises(PerturbationError, match="contradicts"):
        duplicate(InferenceLatency(ms=200, mode="fifo")).read_as(RELEASED)
    assert str(duplicate(InferenceLatency(ms=200).read_as(PAPER)).read_as(RELEASED)) == "200 ms latency"


def test_a_switch_that_was_changed_was_said_and_what_was_read_stays_so() -> None:
    with pytest.raises(PerturbationError, match="mode=fifo contradicts the reading 'released'"):
        InferenceLatency(ms=200).with_severities(mode="fifo").read_as(RELEASED)
    late = InferenceLatency(200).read_as(PAPER).with_severities(ms=100)
    assert str(late.read_as(RELEASED)) == "100 ms latency"
    assert str(InferenceLatency(200).read_as(RELEASED)) == "200 ms latency (reading=released)"
    with pytest.raises(PerturbationError, match="contradicts"):
        InferenceLatency(200, "fifo").read_as(RELEASED)


def test_a_ladder_keeps_to_its_reading_and_compares_with_what_is_read_so() -> None:
    ladder = ladder_of(InferenceLatency, dt_s=0.05, reading=RELEASED)
    assert str(ladder.at(100.0)) == "100 ms latency (reading=released)"
    assert ladder.level_of(InferenceLatency(ms=150)) == 150.0
    assert ladder.name == "latency (reading=released)"
    assert ladder_of(InferenceLatency, dt_s=0.05).name == "latency"
    assert (
        str(ladder_of(InferenceLatency, dt_s=0.05).at(100.0).read_as(RELEASED)) == "100 ms latency (reading=released)"
    )


def test_a_class_with_a_field_of_that_name_keeps_it() -> None:
    @dataclasses.dataclass
    class Gauge(Perturbation):
        reading: str = "low"
        phrase: ClassVar[str] = "broken gauge"

    known = {"gauge": Gauge}
    assert Setting.parse("broken gauge (reading=high)", known) == Setting.of(Gauge("high"))
    assert str(Gauge("high").read_as(RELEASED)) == "broken gauge (reading=high)"


def test_a_users_failure_says_where_its_readings_differ() -> None:
    @dataclasses.dataclass
    class Flicker(Perturbation):
        rate_hz: float = 2.0
        smooth: bool = True
        phrase: ClassVar[str] = "{rate_hz} Hz flicker"
        readings: ClassVar = {"paper": {"smooth": True}, "released": {"smooth": False}}

    assert str(Flicker(rate_hz=3).read_as(RELEASED)) == "3 Hz flicker (reading=released)"
    assert Setting.parse("3 Hz flicker (reading=released)", {"flicker": Flicker}) == Setting.of(
        Flicker(3, smooth=False)
    )


@given(st.data(), st.sampled_from([PAPER, RELEASED]), st.booleans())
def test_brackets_and_a_run_ask_for_a_reading_alike(data: st.DataObject, reading: DriveReading, short: bool) -> None:
    """Whatever is said in the brackets: both agree on what is driven, or both refuse it; and it is read back."""
    name = data.draw(st.sampled_from(sorted(SWITCHES)))
    switches = sorted({switch for of_reading in SWITCHES[name].values() for switch in of_reading})
    said = {switch: data.draw(st.sampled_from(OTHERS[switch])) for switch in switches if data.draw(st.booleans())}
    form = str(made(name))
    brackets = [f"{switch}={str(value).lower()}" for switch, value in said.items()]
    spaced = (", " if short else " ,  ").join
    plain = Setting.parse(f"{form} ({spaced(brackets)})" if brackets else form)
    own = f"{form} ({spaced([*brackets, f'reading={reading.name}'])})"
    has = BUILTIN[name].readings.get(reading.name, {})
    if any(has.get(switch, value) != value for switch, value in said.items()):
        for refused in (lambda: plain.read_as(reading), lambda: Setting.parse(own)):
            with pytest.raises(PerturbationError, match=f"contradicts the reading '{reading.name}'"):
                refused()
        return
    read = plain.read_as(reading)
    assert read == Setting.parse(own) == Setting.parse(str(read))
    assert {switch: read.perturbations[0].parameters()[switch] for switch in has} == dict(has)
    assert all(read.perturbations[0].parameters()[switch] == value for switch, value in said.items())
