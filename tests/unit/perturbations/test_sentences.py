from __future__ import annotations

from dataclasses import InitVar, dataclass
from enum import Enum
from typing import ClassVar, Literal

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pytest_drive_robust.errors import PerturbationError, RequirementError
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
from pytest_drive_robust.perturbations.sentence_checks import check_sentences
from pytest_drive_robust.perturbations.sentences import parse, render

finite = st.floats(0.0, 1e6)
milliseconds = st.one_of(finite, st.integers(0, 5000))
share = st.floats(0.0, 1.0)

perturbations = st.one_of(
    st.builds(
        BurstFrameDrop,
        length_s=st.floats(1e-3, 1e6),
        probability=share,
        length=st.sampled_from(["fixed", "uniform"]),
    ),
    st.builds(
        PartialObservation,
        ratio=share,
        area=st.booleans(),
        fill=st.sampled_from(["black", "gray", "blur"]),
    ),
    st.builds(GpsNoise, std_m=finite),
    st.builds(SpeedNoise, mean=finite, std=finite, clip=st.booleans()),
    st.builds(
        InferenceLatency,
        ms=milliseconds,
        mode=st.sampled_from(["fifo", "hold"]),
        warmup_ticks=st.integers(0, 10**6),
    ),
    st.builds(
        InferenceLatency,
        mode=st.just("measured"),
        warmup_ticks=st.integers(0, 40),
        replay_s=st.lists(finite, max_size=4).map(tuple),
    ),
    st.builds(SensorDelay, camera_ms=milliseconds, ego_ms=st.none() | milliseconds),
    st.builds(FrameBlend, frames=st.integers(1, 10**6), weights=st.sampled_from(["uniform", "linear"])),
)


@given(st.lists(perturbations, max_size=4))
def test_every_setting_is_read_back_from_its_sentence(stack: list[Perturbation]) -> None:
    setting = Setting.of(*stack)
    again = Setting.parse(str(setting))
    assert again == setting
    assert [item.parameters() for item in again.perturbations] == [item.parameters() for item in stack]
    assert str(again) == str(setting)


@pytest.mark.parametrize(
    ("perturbation", "sentence"),
    [
        (BurstFrameDrop(length_s=1), "1 s burst frame drop"),
        (BurstFrameDrop(length_s=0.2), "0.2 s burst frame drop"),
        (PartialObservation(ratio=0.8), "occlusion 0.8"),
        (PartialObservation(ratio=0.8, area=True, fill="gray"), "occlusion 0.8 (area=true, fill=gray)"),
        (GpsNoise(std_m=15), "GPS noise 15 m"),
        (SpeedNoise(mean=0.2), "speed noise 0.2"),
        (InferenceLatency(ms=500), "500 ms latency"),
        (InferenceLatency(mode="measured", warmup_ticks=20), "measured latency (reading=released)"),
        (InferenceLatency(mode="measured", replay_s=(0.5,)), "measured latency (replay_s=0.5/)"),
        (SensorDelay(camera_ms=100), "100 ms sensor delay"),
        (FrameBlend(frames=4), "4 frame blend"),
    ],
)
def test_the_sentences_are_these(perturbation: Perturbation, sentence: str) -> None:
    assert str(perturbation) == sentence


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("  200   MS  Latency ", "200 ms latency"),
        ("200ms latency", "200 ms latency"),
        ("2e2 ms latency", "200 ms latency"),
        ("0.2s burst frame drop", "0.2 s burst frame drop"),
        ("1.0 s burst frame drop", "1 s burst frame drop"),
        (".5 s BURST FRAME DROP", "0.5 s burst frame drop"),
        ("gps noise 5m", "GPS noise 5 m"),
        ("Occlusion 0.50", "occlusion 0.5"),
        ("200 ms latency(mode = hold,warmup_ticks=20)", "200 ms latency (reading=released)"),
        ("200 ms latency (warmup_ticks=20.0, mode=hold)", "200 ms latency (reading=released)"),
        ("200 ms latency (mode=fifo)", "200 ms latency"),
        ("100 ms sensor delay (ego_ms=none)", "100 ms sensor delay"),
        ("speed noise 0.2 (clip=TRUE)", "speed noise 0.2 (clip=true)"),
        ("MEASURED latency", "measured latency"),
        ("occlusion 0.5  AND\t100ms latency", "occlusion 0.5 and 100 ms latency"),
        ("Clean ", "clean"),
    ],
)
def test_friendly_spellings_mean_the_canonical_sentence(text: str, sentence: str) -> None:
    assert str(Setting.parse(text)) == sentence


@pytest.mark.parametrize(
    ("text", "near"),
    [
        ("200 s latency", "200 ms latency"),
        ("0.2 s latency", "200 ms latency"),
        ("200 latency", "200 ms latency"),
        ("latency 200 ms", "200 ms latency"),
        ("latency", "200 ms latency"),
        ("200 ms latncy", "200 ms latency"),
        ("ocllusion 0.8", "occlusion 0.8"),
        ("oclusion 5", "occlusion 0.5"),
        ("GPS noise 5", "GPS noise 5 m"),
        ("GPS noise 5 cm", "GPS noise 5 m"),
        ("gps drift 15 m", "GPS noise 15 m"),
        ("3 s frame drop", "3 s burst frame drop"),
        ("30 s frame drop", "30 s burst frame drop"),
        ("3000 ms burst frame drop", "3 s burst frame drop"),
        ("speed 0.5", "speed noise 0.5"),
        ("measurd latency", "measured latency"),
        ("occlusion 0.5 and 100 s latency", "100 ms latency"),
    ],
)
def test_a_sentence_that_does_not_parse_names_the_nearest_valid_one(text: str, near: str) -> None:
    with pytest.raises(RequirementError) as caught:
        Setting.parse(text)
    assert f"Did you mean {near!r}?" in str(caught.value)
    assert str(Setting.parse(near)) == near


def test_words_without_a_neighbour_get_the_list_of_sentences() -> None:
    with pytest.raises(RequirementError, match="there is no perturbation 'zzz'") as caught:
        Setting.parse("zzz")
    message = str(caught.value)
    assert "Did you mean" not in message
    for sentence in ("clean", "1 s burst frame drop", "occlusion 0.5", "200 ms latency", "measured latency"):
        assert repr(sentence) in message


@pytest.mark.parametrize("text", ["", "and", "occlusion 0.5 and", "200 ms latency (mode=hold", "200 ms latency )"])
def test_fragments_do_not_parse(text: str) -> None:
    with pytest.raises(RequirementError, match="there is no perturbation"):
        Setting.parse(text)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("200 ms latency (mod=hold)", "InferenceLatency has no field 'mod'. Did you mean 'mode'?"),
        ("200 ms latency (ms=100)", "'ms' is already said in the sentence itself"),
        ("measured latency (mode=hold)", "'mode' is already said"),
        ("200 ms latency (hold)", "'hold' in the brackets is not name=value"),
        ("200 ms latency ()", "in the brackets is not name=value"),
        ("200 ms latency (mode=)", "'mode=' in the brackets is not name=value"),
        ("clean and occlusion 0.5", "'clean' means no perturbation and stands alone"),
    ],
)
def test_brackets_and_clean_are_explained(text: str, message: str) -> None:
    with pytest.raises(RequirementError) as caught:
        Setting.parse(text)
    assert message in str(caught.value)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("-100 ms latency", "InferenceLatency: ms is -100,"),
        ("nan ms latency", "ms is nan"),
        ("occlusion 1.5", "PartialObservation: ratio is 1.5"),
        ("200 ms latency (mode=holt)", "Did you mean 'hold'?"),
        ("2.5 frame blend", "FrameBlend: frames is 2.5, expected a whole number"),
        ("speed noise 0.5 (clip=maybe)", "SpeedNoise: clip is 'maybe', expected True or False"),
        ("measured latency (replay_s=fast)", "InferenceLatency: replay_s is 'fast', expected a tuple of seconds"),
    ],
)
def test_impossible_severities_are_refused_by_the_perturbation_itself(text: str, message: str) -> None:
    with pytest.raises(PerturbationError) as caught:
        Setting.parse(text)
    assert message in str(caught.value)


@dataclass
class Dimmed(Perturbation):
    gain: float = 0.5
    phrase = "dimmed camera {gain}"


@dataclass
class RainAndFog(Perturbation):
    millimetres: int = 3
    tint: str = "gray"
    layers: tuple[str, ...] = ()
    weights: tuple[float, ...] = ()
    phrase: ClassVar[str] = "rain and fog of {millimetres} mm"


@dataclass
class LensTint(Perturbation):
    colour: str = "red"
    strength: float | None = None
    kind: Literal["film", "glass"] = "film"
    phrase: ClassVar[str] = "{colour} lens tint"


@dataclass
class DeadPixels(Perturbation):
    count: int


THIRD_PARTY = {**BUILTIN, "dimmed": Dimmed, "rain": RainAndFog, "tint": LensTint, "dead-pixels": DeadPixels}
anything = st.text(max_size=8)

third_party = st.one_of(
    st.builds(Dimmed, gain=st.floats(allow_nan=False)),
    st.builds(
        RainAndFog,
        millimetres=st.integers(),
        tint=anything,
        layers=st.lists(anything, max_size=3).map(tuple),
        weights=st.lists(st.floats(allow_nan=False), max_size=3).map(tuple),
    ),
    st.builds(
        LensTint,
        colour=anything,
        strength=st.none() | st.floats(allow_nan=False),
        kind=st.sampled_from(["film", "glass"]),
    ),
    st.builds(DeadPixels, count=st.integers()),
)


@given(st.lists(third_party | perturbations, min_size=1, max_size=3))
def test_classes_of_users_have_a_sentence_form_as_well(stack: list[Perturbation]) -> None:
    setting = Setting.of(*stack)
    again = Setting.parse(str(setting), THIRD_PARTY)
    assert again == setting
    assert str(again) == str(setting)


def test_what_a_sentence_does_not_say_is_this() -> None:
    plain = (BurstFrameDrop(), PartialObservation(), GpsNoise(), SpeedNoise(), InferenceLatency(ms=0), SensorDelay())
    assert [tuple(item.parameters().values()) for item in (*plain, FrameBlend())] == [
        (1.0, 0.01, "fixed"),
        (0.5, False, "black"),
        (5.0,),
        (0.5, 0.2, False),
        (0.0, "fifo", 0, ()),
        (100.0, None),
        (3, "uniform"),
    ]


@pytest.mark.parametrize("colour", ["none", "True", "NaN", "inf", "Infinity", "infinity", "12", "-0", "1e3", "1_0"])
def test_a_word_that_looks_like_something_else_stays_a_word(colour: str) -> None:
    assert Setting.parse(str(Setting.of(LensTint(colour))), THIRD_PARTY) == Setting.of(LensTint(colour))


class Colour(str, Enum):
    RED = "red"
    DARK_BLUE = "dark blue"


@pytest.mark.parametrize("colour", Colour)
def test_a_member_of_an_enumeration_of_words_is_its_word(colour: Colour) -> None:
    setting = Setting.of(LensTint(colour))
    assert str(setting) == str(LensTint(colour.value))
    assert Setting.parse(str(setting), THIRD_PARTY) == setting


@dataclass
class Exposure(Perturbation):
    gain: float = 1.5
    frames: int = 3
    colour: Colour = Colour.RED
    offset: float | None = None
    phrase = "exposure {gain}"
    example: ClassVar = {"offset": 0.5}


@pytest.mark.parametrize(
    "given",
    [
        Exposure(2, 4.0, "dark blue", 1),  # type: ignore[arg-type]
        Exposure(np.float32(2.0), np.int64(4), Colour.DARK_BLUE, 1.0),  # type: ignore[arg-type]
    ],
)
def test_a_severity_has_the_type_of_its_default_however_it_is_given(given: Exposure) -> None:
    sentence = 'exposure 2 (frames=4, colour="dark blue", offset=1)'
    for setting in (Setting.of(given), given + GpsNoise(), Setting.parse(sentence, {"exposure": Exposure})):
        values = setting.perturbations[0].parameters().values()
        assert [*map(repr, values)] == ["2.0", "4", repr(Colour.DARK_BLUE), "1.0"]
    assert str(Setting.of(given)) == sentence


def test_a_severity_that_no_default_s_type_can_hold_is_left_to_the_class() -> None:
    odd = Exposure(10**400, 4.5, "black", None)  # type: ignore[arg-type]
    assert Setting.of(odd).perturbations[0] is odd
    assert type(Setting.of(Exposure(frames=True)).perturbations[0].parameters()["frames"]) is bool


@given(perturbations)
def test_a_built_in_failure_has_these_types_itself(perturbation: Perturbation) -> None:
    assert Setting.of(perturbation).perturbations[0] is perturbation


def test_a_class_without_a_phrase_is_called_by_its_name() -> None:
    assert str(DeadPixels(count=12)) == "dead pixels (count=12)"
    with pytest.raises(PerturbationError, match=r"DeadPixels cannot be built from a sentence: .*count"):
        Setting.parse("dead pixels", THIRD_PARTY)


def test_suggestions_know_the_classes_of_users() -> None:
    with pytest.raises(RequirementError, match=r"Did you mean 'dimmed camera 0\.3'\?"):
        Setting.parse("dimed camera 0.3", THIRD_PARTY)
    with pytest.raises(RequirementError, match=r"there is no perturbation 'dimmed camera 0\.3'"):
        Setting.parse("dimmed camera 0.3")


def test_a_class_whose_annotations_do_not_resolve_is_read_by_the_looks_of_the_values() -> None:
    @dataclass
    class Local(Perturbation):
        word: Undefined = "a"  # type: ignore[name-defined]  # noqa: F821
        number: Undefined = 1  # type: ignore[name-defined]  # noqa: F821
        pair: Undefined = ()  # type: ignore[name-defined]  # noqa: F821
        phrase = "local {word}"

    for local in (Local("b", 2.5, (1, "x")), Local("5", True, (None,)), Local('"and (', -3, ("a/b", ""))):
        assert parse(render(local), [Local]) == local


@dataclass
class Wobble(Perturbation):
    metres: float = 1.0
    hertz: float = 2.0
    phrase = "wobble {metres} {hertz}"


def test_two_numbers_in_a_row_are_not_cut_out_of_one() -> None:
    assert parse("wobble 1.5  25", [Wobble]) == Wobble(1.5, 25)
    with pytest.raises(RequirementError, match=r"there is no perturbation 'wobble 15'\. Did you mean 'wobble 15 2'"):
        parse("wobble 15", [Wobble])


def test_a_phrase_with_nothing_between_two_fields_is_refused() -> None:
    @dataclass
    class Glued(Wobble):
        phrase = "wobble {metres}{hertz}"

    with pytest.raises(PerturbationError, match="has nothing between two fields: put a blank or a word there"):
        check_sentences(Glued, ())


@dataclass
class Asserted(Perturbation):
    gain: float = 0.0
    phrase = "asserted {gain}"

    def __post_init__(self) -> None:
        assert 0.0 < self.gain <= 1.0, "a share"


def test_an_assert_of_a_class_refuses_the_severity_and_spoils_no_suggestion() -> None:
    known = {"asserted": Asserted, **BUILTIN}
    with pytest.raises(PerturbationError, match="Asserted cannot be built from a sentence: AssertionError: a share"):
        Setting.parse("asserted 3", known)
    with pytest.raises(RequirementError, match=r"no perturbation '3 ms latenzy'\. Did you mean '3 ms latency'"):
        Setting.parse("3 ms latenzy", known)


def test_a_phrase_that_shows_no_field_is_explained() -> None:
    class Forgot(Perturbation):
        gain: float = 0.5
        phrase = "forgotten {gain}"

    with pytest.raises(PerturbationError, match=r"shows 'gain', .* Is Forgot decorated with @dataclass\?"):
        str(Forgot())


def test_a_severity_without_a_sentence_form_is_refused() -> None:
    with pytest.raises(PerturbationError, match="only these have a sentence form"):
        str(Dimmed(gain={"a": 1}))  # type: ignore[arg-type]


def test_a_class_does_not_inherit_the_sentence_of_another_failure() -> None:
    class GpsBias(GpsNoise):
        pass

    assert str(GpsBias(std_m=3)) == "gps bias (std_m=3)"
    assert type(Setting.parse("GPS noise 3 m", {"gps-bias": GpsBias, **BUILTIN}).perturbations[0]) is GpsNoise


def test_severities_that_are_no_fields_are_refused() -> None:
    class WeakThrottle(Perturbation):
        def __init__(self, gain: float) -> None:
            self.gain = gain

    with pytest.raises(PerturbationError, match=r"WeakThrottle has an __init__ of its own.*write @dataclass"):
        Setting.of(WeakThrottle(0.0))


def test_what_only_the_constructor_takes_is_refused() -> None:
    @dataclass
    class Weak(Perturbation):
        gain: float = 0.5
        offset: InitVar[float] = 0.0
        phrase = "weak {gain}"

    @dataclass
    class Own(Perturbation):
        gain: float = 0.5
        phrase = "own {gain}"

        def __init__(self, gain: float = 0.5, offset: float = 0.0) -> None:
            self.gain = gain + offset

    for cls in (Weak, Own):
        with pytest.raises(PerturbationError, match=rf"{cls.__name__} is made with 'offset', which is no field"):
            Setting.of(cls(0.4))


@pytest.mark.parametrize("name", ["phrase", "variants", "example", "ladder", "readings", "files"])
def test_what_a_class_says_about_itself_is_no_severity(name: str) -> None:
    said: dict[str, object] = {"phrase": "weak {gain}", "files": (), "ladder": None}
    body = {"__annotations__": {"gain": float, name: object}, "gain": 0.5, **said, name: said.get(name, ())}
    annotated = dataclass(type("Weak", (Perturbation,), body))
    told = f"Weak has '{name}' as a severity, because it is annotated: write it without an annotation"
    with pytest.raises(PerturbationError, match=told):
        Setting.of(annotated(0.4))


def test_what_a_class_says_about_itself_may_be_annotated_as_such() -> None:
    @dataclass
    class Weak(Perturbation):
        gain: float = 0.5
        phrase: ClassVar[str] = "weak {gain}"
        files: ClassVar = ()

    assert str(Setting.of(Weak(0.4))) == "weak 0.4"


@pytest.mark.parametrize("joint", [" + ", ", ", " & ", ","])
def test_who_joins_failures_otherwise_is_told_the_word(joint: str) -> None:
    with pytest.raises(RequirementError, match=r"Join failures with 'and': 'occlusion 0.5 and 100 ms latency'"):
        Setting.parse(f"occlusion 0.5{joint}100 ms latency")


def test_a_name_is_said_once_in_the_brackets() -> None:
    with pytest.raises(RequirementError, match="'mode' is said twice"):
        Setting.parse("200 ms latency (mode=hold, mode=fifo)")


def test_a_switch_in_a_phrase_is_read_back() -> None:
    @dataclass
    class Flip(Perturbation):
        on: bool = True
        phrase = "flip {on}"

    known = {"flip": Flip}
    assert Setting.parse(str(Setting.of(Flip(on=False))), known) == Setting.of(Flip(on=False))
