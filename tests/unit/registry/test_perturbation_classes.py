"""The classes of perturbations that may be registered."""

from __future__ import annotations

from dataclasses import dataclass

import pytest
from registry_samples import Install, NoisyWheel

from pytest_drive_robust.errors import PluginError
from pytest_drive_robust.perturbations import BUILTIN, Perturbation
from pytest_drive_robust.registry.registry import Registry


def test_a_broken_perturbation_is_left_out_of_all_and_told_as_a_problem(install: Install) -> None:
    install("broken-noise", "2.1", group="perturbations", entry="hum", source="1 / 0")
    registry = Registry()
    classes = registry.perturbations()
    assert "hum" not in classes
    assert "gps-noise" in classes
    (problem,) = registry.problems()
    assert "broken-noise 2.1" in str(problem)
    assert "ZeroDivisionError" in str(problem)


def test_an_entry_that_is_no_perturbation_is_a_plugin_error(install: Install) -> None:
    install("odd-noise", "1.0", group="perturbations", entry="odd", source="class Entry: pass")
    with pytest.raises(PluginError, match=r"odd-noise 1\.0 is not a perturbation"):
        Registry().perturbation("odd")


def failure(phrase: str) -> type[Perturbation]:
    """Return a new class of that sentence, with one severity."""
    return dataclass(
        type("Dimmed", (Perturbation,), {"__annotations__": {"gain": float}, "gain": 0.5, "phrase": phrase})
    )


@pytest.mark.parametrize(
    ("phrase", "message"),
    [
        ("{gain} ms latency", "is a sentence of Dimmed and of InferenceLatency"),
        ("dimmed {gain} to {gain}", "shows 'gain'.*each once: gain"),
        ("dimmed {gain:.2f}", "shows 'gain'.*plain names"),
        ("dimmed {level}", "shows 'level'.*each once: gain"),
        ("dimmed {gain", "is malformed"),
        ("camera #{gain} off", "can stand in no requirement: expected one line"),
        ("dimmed <= {gain}", "without '#', '<=' and '>='"),
        ("dimmed >= {gain}", "can stand in no requirement"),
        ("dimmed ≤ {gain}", "can stand in no requirement"),
        ("dimmed ≥ {gain}", "can stand in no requirement"),
        ("dimmed\n{gain}", "can stand in no requirement"),
        ("Clean", "that is not 'clean'"),
    ],
)
def test_a_sentence_that_cannot_be_read_back_is_refused_where_it_is_registered(phrase: str, message: str) -> None:
    with pytest.raises(PluginError, match=rf"perturbation 'dimmed' from .* cannot be used: .*{message}"):
        Registry().register_perturbation(failure(phrase))


def test_a_phrase_that_would_be_read_out_of_the_sentence_of_another_failure_is_refused() -> None:
    body = {"__annotations__": {"kind": str}, "kind": "red", "phrase": "{kind} ms latency"}
    with pytest.raises(PluginError, match="'200 ms latency' is a sentence of Tinted and of InferenceLatency"):
        Registry().register_perturbation(dataclass(type("Tinted", (Perturbation,), body)))


def test_a_phrase_that_became_a_severity_is_refused_where_it_is_registered() -> None:
    body = {"__annotations__": {"gain": float, "phrase": str}, "gain": 0.5, "phrase": "dimmed {gain}"}
    with pytest.raises(PluginError, match=r"'dimmed' from .* cannot be used: Dimmed has 'phrase' as a severity"):
        Registry().register_perturbation(dataclass(type("Dimmed", (Perturbation,), body)))


def test_two_failures_of_one_sentence_are_both_left_out_with_their_origins(install: Install) -> None:
    source = (
        "from dataclasses import dataclass\nfrom pytest_drive_robust import Perturbation\n"
        "@dataclass\nclass Entry(Perturbation):\n    gain: float = 0.5\n    phrase = 'dimmed {gain}'\n"
    )
    install("dims", "1.0", group="perturbations", entry="dim", source=source)
    registry = Registry()
    registry.register_perturbation(failure("dimmed {gain}"))
    registry.register_perturbation(NoisyWheel)
    assert not {"dim", "dimmed"} & registry.perturbations().keys()
    assert "noisy-wheel" in registry.perturbations()
    (problem,) = registry.problems()
    assert "'dim' from dims 1.0 and 'dimmed' from" in str(problem)
    assert "'dimmed 0.5' is a sentence of Entry and of Dimmed" in str(problem)


def test_two_failures_of_one_sentence_are_told_apart_without_a_default_of_their_severities() -> None:
    registry = Registry()
    for name, severity in (("One", "gain"), ("Other", "factor")):
        body = {"__annotations__": {severity: float}, "phrase": f"dimmed {{{severity}}}"}
        registry.register_perturbation(dataclass(type(name, (Perturbation,), body)))
    assert not {"one", "other"} & registry.perturbations().keys()
    (problem,) = registry.problems()
    assert "'dimmed 1' is a sentence of One and of Other" in str(problem)


def test_one_failure_by_two_names_and_one_that_replaces_another_are_told_apart(install: Install) -> None:
    install("dims", "1.0", group="perturbations", entry="dimmed", source="1 / 0")
    registry = Registry()
    dimmed = failure("dimmed {gain}")
    registry.register_perturbation(dimmed)
    registry.register_perturbation(dimmed, "also-dimmed")
    assert {"dimmed", "also-dimmed"} <= registry.perturbations().keys()
    assert registry.problems() == ()


def test_a_failure_derived_from_a_built_in_one_needs_a_phrase_only() -> None:
    for cls in BUILTIN.values():
        derived = dataclass(type("Derived", (cls,), {"phrase": f"derived {cls.phrase}"}))
        registry = Registry()
        registry.register_perturbation(derived)
        assert registry.perturbations()["derived"] is derived


def test_severities_of_a_class_that_nobody_made_a_dataclass_are_refused_with_what_to_write() -> None:
    for body in (
        {"__annotations__": {"gain": float}, "gain": 0.5, "phrase": "dimmed {gain}"},
        {"__annotations__": {"gain": float}, "phrase": "dimmed {gain}"},
        {"__annotations__": {"gain": "float"}, "gain": 0.5},
    ):
        with pytest.raises(
            PluginError,
            match=r"has 'gain', which is no severity, .* no dataclass: write @dataclass above the class",
        ):
            Registry().register_perturbation(type("Dimmed", (Perturbation,), body))


def test_what_is_no_severity_needs_no_dataclass() -> None:
    body = {"__annotations__": {"table": "ClassVar[int]", "_seen": int, "phrase": str}, "table": 3, "_seen": 0}
    Registry().register_perturbation(type("Dimmed", (Perturbation,), {**body, "phrase": "dimmed"}))


def test_an_object_in_place_of_a_perturbation_is_refused() -> None:
    with pytest.raises(
        PluginError, match=r"NoisyWheel.* is not a perturbation: .*subclass of Perturbation, without br"
    ):
        Registry().register_perturbation(NoisyWheel())  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("said", "message"),
    [
        ({"ladder": ("gian", (0.9, 0.5))}, r"the ladder of Dimmed is \('gian', \(0\.9, 0\.5\)\), expected .*\(gain\)"),
        ({"ladder": ["gain", 0.9, 0.5]}, "the ladder of Dimmed is .*, expected one of its fields"),
        ({"ladder": ("gain", ())}, "the ladder of Dimmed is .*values from mild to severe"),
        ({"ladder": ("gain", "low high")}, "the ladder of Dimmed is .*values from mild to severe"),
        ({"variants": {"dark": {"gian": 0.1}}}, "'variants' of Dimmed names 'gian', .* Did you mean 'gain'"),
        ({"readings": {"released": {"gian": 0.1}}}, "'readings' of Dimmed names 'gian'"),
        ({"example": {"gian": 0.1}}, "'example' of Dimmed names 'gian'"),
        ({"variants": ["dark"]}, "cannot be used: AttributeError: 'list' object has no attribute"),
    ],
)
def test_what_a_failure_says_of_itself_is_checked_where_it_is_registered(said: dict[str, object], message: str) -> None:
    body = {"__annotations__": {"gain": float}, "gain": 0.5, "phrase": "dimmed {gain}", **said}
    with pytest.raises(PluginError, match=message):
        Registry().register_perturbation(dataclass(type("Dimmed", (Perturbation,), body)))


def test_a_ladder_of_ticks_and_one_beside_a_field_without_a_default_are_taken() -> None:
    body = {
        "__annotations__": {"place": str, "late_ms": float},
        "phrase": "{late_ms} ms late",
        "ladder": ("late_ms", "ticks"),
    }
    Registry().register_perturbation(dataclass(type("Late", (Perturbation,), body)))
