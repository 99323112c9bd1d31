"""Sentences to requirements and back, their margins, and what is refused."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pytest_drive_robust.errors import PluginError, RequirementError
from pytest_drive_robust.metrics.table import METRICS
from pytest_drive_robust.perturbations import (
    BUILTIN,
    BurstFrameDrop,
    FrameBlend,
    GpsNoise,
    InferenceLatency,
    PartialObservation,
    Perturbation,
    SensorDelay,
    Setting,
    SpeedNoise,
)
from pytest_drive_robust.registry.registry import default_registry
from pytest_drive_robust.verdict.requirement import MarginRequirement, Requirement
from pytest_drive_robust.verdict.sentences import requirements

SENTENCES = {
    "RD under 200 ms latency <= 0.30": ("RD", Setting.of(InferenceLatency(ms=200)), "<=", 0.30),
    "RD under 3 s burst frame drop <= 0.10": ("RD", Setting.of(BurstFrameDrop(length_s=3)), "<=", 0.10),
    "RD under occlusion 0.8 <= 0.40": ("RD", Setting.of(PartialObservation(ratio=0.8)), "<=", 0.40),
    "SR under GPS noise 5 m >= 0.50": ("SR", Setting.of(GpsNoise(std_m=5)), ">=", 0.50),
    "DS under speed noise 0.2 >= 40": ("DS", Setting.of(SpeedNoise(mean=0.2)), ">=", 40.0),
    "DS under clean >= 60": ("DS", Setting.CLEAN, ">=", 60.0),
    "RD under occlusion 0.5 and 100 ms latency <= 0.40": (
        "RD",
        PartialObservation(ratio=0.5) + InferenceLatency(ms=100),
        "<=",
        0.40,
    ),
    "efficiency under 3 frame blend >= 80": ("efficiency", Setting.of(FrameBlend(frames=3)), ">=", 80.0),
    "comfort under 100 ms sensor delay >= 12.5": ("comfort", Setting.of(SensorDelay(camera_ms=100)), ">=", 12.5),
}


@pytest.mark.parametrize("sentence", SENTENCES)
def test_a_sentence_is_parsed_and_printed_as_it_was(sentence: str) -> None:
    parsed = requirements(sentence)[0]

    assert parsed == Requirement(*SENTENCES[sentence])
    assert str(parsed) == sentence


@pytest.mark.parametrize(
    "sentence",
    [
        "RD under 200 ms latency ≤ 0.30",
        "RD under 200 ms latency <=0.3",
        "  RD  under\t200 ms latency<= .3 ",
        "RD under 200.0 ms latency <= 3e-1",
        "RD under 200 ms latency <= +0.30",
    ],
)
def test_other_ways_to_write_the_same_are_the_same(sentence: str) -> None:
    assert str(requirements(sentence)[0]) == "RD under 200 ms latency <= 0.30"


def test_at_least_may_be_one_character() -> None:
    assert str(requirements("DS under clean ≥ 60")[0]) == "DS under clean >= 60"


def test_a_text_is_parsed_line_by_line_without_comments_and_blank_lines() -> None:
    text = """
        # clean floor
        DS under clean >= 60

        RD under 200 ms latency <= 0.30  # two tenths of a second
    """

    assert [str(one) for one in requirements(text)] == ["DS under clean >= 60", "RD under 200 ms latency <= 0.30"]


def test_sentences_may_be_given_one_by_one() -> None:
    given = ("DS under clean >= 60", "RD under 200 ms latency <= 0.30\nSR under clean >= 0.5")
    assert requirements(*given) == requirements("\n".join(given))
    with pytest.raises(RequirementError, match=r"line 2: RD over clean"):
        requirements("DS under clean >= 60", "RD over clean <= 0.3")


@pytest.mark.parametrize("text", ["", "\n \n", "# nothing yet"])
def test_a_text_without_a_requirement_is_refused(text: str) -> None:
    with pytest.raises(RequirementError, match=r"holds no requirement\. Expected lines such as 'RD under"):
        requirements(text)


def test_a_file_may_begin_with_a_byte_order_mark(tmp_path: Path) -> None:
    (tmp_path / "limits.txt").write_text("DS under clean >= 60\n", encoding="utf-8-sig")
    assert [str(found) for found in requirements(tmp_path / "limits.txt")] == ["DS under clean >= 60"]


@pytest.mark.parametrize("given", [["DS under clean >= 60"], None, 3])
def test_what_is_neither_text_nor_a_path_is_refused_with_its_type(given) -> None:
    message = (
        rf"value of type {type(given).__name__}\. Expected a text with one sentence a line, .* or a file, .*Path\("
    )
    with pytest.raises(RequirementError, match=message):
        requirements(given)
    with pytest.raises(RequirementError, match=message):
        requirements("DS under clean >= 50", given)


def test_a_file_stands_alone(tmp_path: Path) -> None:
    (tmp_path / "limits.txt").write_text("DS under clean >= 60\n")
    texts = ("DS under clean >= 50", tmp_path / "limits.txt")
    for order in (texts, texts[::-1]):
        with pytest.raises(
            RequirementError, match=r"was given a value of type \w*Path\. Expected .* several such texts, or a file"
        ):
            requirements(*order)


def test_a_text_that_is_the_name_of_a_file_is_refused_with_the_way_to_read_it(tmp_path, monkeypatch) -> None:
    (tmp_path / "limits.txt").write_text("DS under clean >= 60\n")
    monkeypatch.chdir(tmp_path)
    with pytest.raises(RequirementError, match=r"to read it, write requirements\(Path\('limits.txt'\)\)"):
        requirements("limits.txt")
    with pytest.raises(RequirementError) as refused:
        requirements("limit.txt")
    assert "Path" not in str(refused.value)


def test_the_same_requirement_twice_is_refused() -> None:
    with pytest.raises(RequirementError, match=r"line 2: DS under clean ≥ 60\.0\n.*says the same as line 1"):
        requirements("DS under clean >= 60\nDS under clean ≥ 60.0")


def test_all_problems_of_a_text_are_told_at_once_with_their_lines() -> None:
    with pytest.raises(RequirementError) as caught:
        requirements("RDD under 200 ms latency <= 0.30\nDS under clean >= 60\nSR under clean == 0.5")

    message = str(caught.value)
    assert message.startswith("2 problems in the requirements:\n")
    assert "line 1: RDD under 200 ms latency <= 0.30" in message
    assert "Nearest valid sentence: RD under 200 ms latency <= 0.30" in message
    assert "line 2" not in message
    assert "line 3: SR under clean == 0.5" in message


@pytest.mark.parametrize(
    ("sentence", "problem", "suggestion"),
    [
        ("RDD under 200 ms latency <= 0.30", "no metric named 'RDD'", "RD under 200 ms latency <= 0.30"),
        ("sr under clean >= 0.5", "Did you mean 'SR'", "SR under clean >= 0.50"),
        ("RD 200 ms latency <= 0.30", "'under' is missing", "RD under 200 ms latency <= 0.30"),
        ("RD with 200 ms latency <= 0.30", "'under' is missing", "RD under 200 ms latency <= 0.30"),
        ("RD under <= 0.30", "setting after 'under' is missing", "RD under 200 ms latency <= 0.30"),
        ("RD <= 0.30", "'under' is missing", "RD under 200 ms latency <= 0.30"),
        ("RD under 200 s latency <= 0.30", "no perturbation '200 s latency'", "RD under 200 ms latency <= 0.30"),
        ("RD under 0.2 s latency <= 0.30", "no perturbation '0.2 s latency'", "RD under 200 ms latency <= 0.30"),
        ("RD under 3000 ms burst frame drop <= 0.3", "no perturbation", "RD under 3 s burst frame drop <= 0.30"),
        ("RD under 0 ms latency (warmup_ticks=20) <= 0.30", "always 0", "RD under 200 ms latency <= 0.30"),
        ("RD under 200ms latncy <= 0.30", "no perturbation '200ms latncy'", "RD under 200 ms latency <= 0.30"),
        ("SR under GPS noise 5 km >= 0.5", "no perturbation 'GPS noise 5 km'", "SR under GPS noise 5 m >= 0.50"),
        ("RD under occlusion 1.5 <= 0.4", "ratio is 1.5", "RD under occlusion 0.5 <= 0.40"),
        ("RD under 3 s burst frame drop and 200 latency <= 0.4", "no perturbation '200 latency'",
         "RD under 3 s burst frame drop and 200 ms latency <= 0.40"),
        ("RD under occlusion 0.5 (fill=blur) & gps noise 5m <= 0.3", "Join failures with 'and'",
         "RD under occlusion 0.5 (fill=blur) and GPS noise 5 m <= 0.30"),
        ("RD under occlusion 0.5 + 200 ms latncy <= 0.3", "no perturbation 'occlusion 0.5 + 200 ms latncy'",
         "RD under occlusion 0.5 and 200 ms latency <= 0.30"),
        ("RD under 200 ms latency == 0.30", "'==' cannot be used here", "RD under 200 ms latency <= 0.30"),
        ("RD under 200 ms latency < 0.30", "'<' cannot be used here", "RD under 200 ms latency <= 0.30"),
        ("SR under clean at least 0.5", "'at least' cannot be used here", "SR under clean >= 0.50"),
        ("RD under 200 ms latency 0.30", "there is no comparison", "RD under 200 ms latency <= 0.30"),
        ("RD under 200 ms latency <= 30 %", "has a unit. Expected a plain number: 0.30",
         "RD under 200 ms latency <= 0.30"),
        ("comfort under clean >= 30%", "has a unit. Expected a plain number: 30", "comfort under clean >= 30"),
        ("RD under 200 ms latency <= 30", "expected a number in -1..1", "RD under 200 ms latency <= 0.30"),
        ("RD under 200 ms latency <= 1.0", "can never fail", "RD under 200 ms latency <= 0.30"),
        ("RD under 200 ms latency <= 1%", "has a unit", "RD under 200 ms latency <= 0.01"),
        ("SR under clean >= 50", "expected a number in 0..1", "SR under clean >= 0.50"),
        ("DS under clean >= 600", "expected a number in 0..100", "DS under clean >= 40"),
        ("DS under clean == 60", "'==' cannot be used here", "DS under clean >= 60"),
        ("DS under clean >=", "the limit is missing", "DS under clean >= 40"),
        ("DS under clean >= sixty", "the limit is 'sixty'", "DS under clean >= 40"),
        ("DS under clean >= 60 points", "the limit is '60 points'", "DS under clean >= 60"),
        ("RD under clean <= 0.3", "always 0", "RD under 200 ms latency <= 0.30"),
        ("RD under 300 ms latency <= 0,4", "the limit is '0,4'", "RD under 300 ms latency <= 0.40"),
        ("DS under 300 ms latency (reading=papr) >= 30", "no reading named 'papr'", "DS under 300 ms latency >= 30"),
        ("0.4 >= RD under 300 ms latency", "'under' is missing", "RD under 300 ms latency <= 0.40"),
        ("DS under clean >= 0", "can never fail", "DS under clean >= 40"),
        ("1. RD under 300 ms latency <= 0.4", "'under' is missing", "RD under 300 ms latency <= 0.40"),
        ("the agent should drive well", "there is no comparison", "RD under 200 ms latency <= 0.30"),
    ],
)  # fmt: skip
def test_what_does_not_parse_is_explained_with_the_nearest_valid_sentence(
    sentence: str, problem: str, suggestion: str
) -> None:
    with pytest.raises(RequirementError, match=re.escape(problem)) as caught:
        requirements(sentence)

    assert str(caught.value).splitlines()[-1].strip() == f"Nearest valid sentence: {suggestion}"
    requirements(suggestion)


@dataclass
class SleepyDriver(Perturbation):
    """A test's own failure, with two severities and no phrase."""

    minutes: float
    depth: int = 2


def test_a_phrase_of_somebody_else_is_known_when_it_is_given() -> None:
    sentence = "DS under sleepy driver (minutes=3) and 100 ms latency >= 30"
    known = {**BUILTIN, "sleepy": SleepyDriver}

    assert str(requirements(sentence, known=known)[0]) == sentence
    with pytest.raises(RequirementError):
        requirements(sentence, known=BUILTIN)
    with pytest.raises(RequirementError, match="Nearest valid sentence: DS under 100 ms latency >= 30"):
        requirements("DS under 100 ms latnecy >= 30", known=known)


def rounded(low: float, high: float) -> st.SearchStrategy[float]:
    return st.floats(low, high).map(lambda value: round(value, 4)).filter(lambda value: low < value < high)


perturbations = st.one_of(
    st.builds(InferenceLatency, ms=st.integers(1, 3000), mode=st.sampled_from(["fifo", "hold"])),
    st.builds(BurstFrameDrop, length_s=rounded(0.05, 10.0)),
    st.builds(PartialObservation, ratio=rounded(0.01, 0.99)),
    st.builds(GpsNoise, std_m=rounded(0.01, 50.0)),
    st.builds(SpeedNoise, mean=rounded(0.01, 2.0)),
    st.builds(SensorDelay, camera_ms=st.integers(50, 1000)),
    st.builds(FrameBlend, frames=st.integers(2, 10)),
)
settings_of_any_size = st.lists(perturbations, max_size=3).map(lambda stack: Setting.of(*stack))


@given(st.sampled_from(sorted(METRICS)), settings_of_any_size, st.sampled_from(["<=", ">="]), st.floats(0.001, 0.999))
def test_every_requirement_survives_being_printed_and_parsed(
    metric: str, setting: Setting, comparison: str, limit: float
) -> None:
    if metric == "RD" and setting.is_clean:
        setting = Setting.of(InferenceLatency(ms=200))
    stated = Requirement(metric, setting, comparison, limit)
    parsed = requirements(str(stated))[0]

    assert parsed == stated
    assert str(parsed) == str(stated)
    assert parsed.id == stated.id


@given(st.text(st.characters(codec="utf-8"), max_size=40))
def test_nonsense_is_refused_and_never_crashes(text: str) -> None:
    with pytest.raises(RequirementError):
        requirements(text)


def parsed(sentence: str) -> Requirement:
    return requirements(sentence, known=BUILTIN)[0]


@pytest.mark.parametrize(
    ("sentence", "canonical", "plain"),
    [
        ("latency margin >= 150 ms", "latency margin >= 150 ms (RD <= 0.30)", "RD under 150 ms latency <= 0.30"),
        (
            "Latency margin ≥ 150ms (RD ≤ .4)",
            "latency margin >= 150 ms (RD <= 0.40)",
            "RD under 150 ms latency <= 0.40",
        ),
        (
            "burst frame drop margin >= 3 s (DS >= 60)",
            "burst frame drop margin >= 3 s (DS >= 60)",
            "DS under 3 s burst frame drop >= 60",
        ),
        ("GPS noise margin >= 5 m", "GPS noise margin >= 5 m (RD <= 0.30)", "RD under GPS noise 5 m <= 0.30"),
        ("occlusion margin >= 0.5", "occlusion margin >= 0.5 (RD <= 0.30)", "RD under occlusion 0.5 <= 0.30"),
        ("frame blend margin >= 5", "frame blend margin >= 5 (RD <= 0.30)", "RD under 5 frame blend <= 0.30"),
    ],
)
def test_a_margin_is_the_requirement_at_that_severity(sentence: str, canonical: str, plain: str) -> None:
    margin, same = parsed(sentence), parsed(plain)
    assert str(margin) == canonical
    assert parsed(canonical) == margin
    assert (margin.metric, margin.setting, margin.comparison, margin.limit) == (
        (same.metric, same.setting, same.comparison, same.limit)
    )
    assert margin != same


def test_its_test_id_says_the_same() -> None:
    assert parsed("latency margin >= 150 ms").id == "latency-margin-ge-150ms-rd-le-0.30"


def test_it_has_an_object_form() -> None:
    margin = MarginRequirement("DS", Setting.of(BurstFrameDrop(length_s=3)), ">=", 60)
    assert str(margin) == "burst frame drop margin >= 3 s (DS >= 60)"
    assert margin.perturbation == BurstFrameDrop(length_s=3)


@pytest.mark.parametrize(
    ("sentence", "message"),
    [
        ("latency margin >= 0.2 s", "has the unit 's'. Expected ms: 'latency margin >= 200 ms'"),
        ("burst frame drop margin >= 500 ms", "Expected s: 'burst frame drop margin >= 0.5 s'"),
        ("GPS noise margin >= 2 km", "Expected m: 'GPS noise margin >= 2000 m'"),
        ("GPS noise margin >= 50 cm", "Expected m: 'GPS noise margin >= 0.5 m'"),
        ("latency margin >= 150", "has no unit. Expected ms: 'latency margin >= 150 ms'"),
        ("occlusion margin >= 0.5 m", "has the unit 'm'. Expected none: 'occlusion margin >= 0.5'"),
        ("latancy margin >= 150 ms", "there is no failure called 'latancy'. Did you mean 'latency'?"),
        ("latency margin >= 150 ms (XY <= 0.3)", "there is no metric named 'XY'"),
        ("latency margin >= 150 ms (RD <= 1)", "holds for every agent"),
        ("latency margin <= 150 ms", "states no margin. Expected 'FAILURE margin >= SEVERITY (METRIC <= LIMIT)'"),
        ("latency margin >= much", "states no margin"),
        ("occlusion margin >= 1.5", "ratio is 1.5"),
    ],
)
def test_what_cannot_be_meant_is_refused(sentence: str, message: str) -> None:
    with pytest.raises(RequirementError) as error:
        parsed(sentence)
    assert message in str(error.value)
    assert "Nearest valid sentence" not in str(error.value)  # a limit would say the opposite of a margin


@dataclass
class LensFilm(Perturbation):
    """A test's own failure: its phrase does not show what has no default."""

    maker: str
    gain: float = 0.5
    phrase = "lens film {gain}"
    example: ClassVar = {"maker": "ours"}
    ladder: ClassVar = ("gain", (0.9, 0.5))


@pytest.mark.parametrize("maker", ["ours", "#1", "a  b", "x <= 3", "the margin >= 2", "(we)"])
def test_a_severity_in_words_is_read_back_whatever_the_words_are(maker: str) -> None:
    setting = Setting.of(LensFilm(maker))
    for stated in (Requirement("RD", setting, "<=", 0.3), MarginRequirement("RD", setting, "<=", 0.3)):
        assert requirements(str(stated), known={**BUILTIN, "lens-film": LensFilm}) == [stated]


@dataclass
class Dirt(Perturbation):
    """A test's own failure: its phrase does not show the severity that its ladder steps through."""

    share: float = 0.3
    kind: str = "mud"
    phrase = "dirt"
    ladder: ClassVar = ("share", (0.1, 0.3, 0.5))


def test_a_margin_keeps_its_severity_where_the_phrase_does_not_show_it() -> None:
    known = {"dirt": Dirt}
    for sentence, dirt in (
        ("dirt margin >= 0.5 (RD <= 0.30)", Dirt(0.5)),
        ("dirt margin >= 0.5 (RD <= 0.30, kind=rain)", Dirt(0.5, "rain")),
        ("dirt margin >= 0.3 (RD <= 0.30, kind=rain)", Dirt(0.3, "rain")),
    ):
        (margin,) = requirements(sentence, known=known)
        assert margin.setting == Setting.of(dirt)
        assert str(margin) == sentence
    with pytest.raises(RequirementError, match="'share' is said twice"):
        requirements("dirt margin >= 0.5 (RD <= 0.30, share=0.1)", known=known)


@dataclass
class Late(Perturbation):
    """A test's own failure, called as one of ours: "latency"."""

    ms: float = 100.0
    phrase = "latency {ms} ms"


@dataclass
class LateBySteps(Late):
    phrase = "latency {ms} ms"
    ladder: ClassVar = ("ms", (50.0, 100.0))


def test_a_margin_of_two_failures_with_one_word_is_refused() -> None:
    with pytest.raises(RequirementError, match="'latency' may be InferenceLatency and LateBySteps"):
        requirements("latency margin >= 150 ms", known={**BUILTIN, "late": LateBySteps})


def test_a_failure_without_steps_takes_no_margin_from_another() -> None:
    (margin,) = requirements("latency margin >= 150 ms", known={**BUILTIN, "late": Late, "again": Late})
    assert type(margin.setting.perturbations[0]) is InferenceLatency


@dataclass
class SlowWheel(Perturbation):
    """A test's own failure: it refuses a severity by a ValueError, as any dataclass may."""

    gain: float = 0.5
    phrase = "slow wheel {gain}"
    ladder: ClassVar = ("gain", (0.9, 0.5))

    def __post_init__(self) -> None:
        if not 0.0 < self.gain <= 1.0:
            raise ValueError(f"gain is {self.gain}, expected 0..1")


@dataclass
class Unusual(Perturbation):
    """A test's own failure: two severities without defaults, and no example of them."""

    gain: float
    offset: float
    phrase = "odd wheel {gain} off {offset}"
    ladder: ClassVar = ("gain", (0.9, 0.5))


@pytest.mark.parametrize(
    ("cls", "sentence", "message"),
    [
        (SlowWheel, "slow wheel margin >= 5", "SlowWheel cannot be built from a sentence: gain is 5.0, expected 0..1"),
        (Unusual, "odd wheel off margin >= 0.5", "Unusual cannot be built from its ladder: .*'offset'"),
    ],
)
def test_what_a_class_raises_of_a_margin_is_a_sentence_that_is_refused(
    cls: type[Perturbation], sentence: str, message: str
) -> None:
    with pytest.raises(RequirementError, match=message):
        requirements(sentence, known={**BUILTIN, "own": cls})


def test_margins_stand_beside_other_requirements() -> None:
    found = requirements("RD under 100 ms latency <= 0.2\nlatency margin >= 150 ms  # a comment", known=BUILTIN)
    assert [type(item) for item in found] == [Requirement, MarginRequirement]
    assert found[1].setting.perturbations == (InferenceLatency(ms=150),)


def test_a_failure_that_does_not_load_is_told_beside_a_sentence_that_does_not_parse(monkeypatch) -> None:
    problems = lambda: (PluginError("the perturbation 'late-dim' from dims 1.0 does not load"),)  # noqa: E731
    monkeypatch.setattr(default_registry(), "problems", problems)
    with pytest.raises(RequirementError, match=r"Left out: .*'late-dim' from dims 1\.0"):
        requirements("RD under late dim 0.5 <= 0.3")
