"""Perturbations as sentences and back: `InferenceLatency(ms=200)` is `"200 ms latency"`.

Sentences are built from the `phrase` of each class, so that a user's own perturbation has a sentence form as well.
"""

from __future__ import annotations

import contextlib
import re
from collections.abc import Iterable, Mapping, Sequence
from typing import TypeVar

from pytest_drive_robust.errors import PerturbationError, RequirementError, UsageError, did_you_mean
from pytest_drive_robust.perturbations.readings import READINGS, DriveReading
from pytest_drive_robust.perturbations.sentence_forms import (
    Spoken,
    Template,
    defaults_of,
    form_of,
    names_of,
    templates_of,
)
from pytest_drive_robust.perturbations.severity_text import parse_value, render_value, split_outside_quotes

_S = TypeVar("_S", bound=Spoken)

CLEAN = "clean"
"""The sentence of the empty stack."""

_READING = "reading"
"""The name that brackets may hold beside the fields of a class, unless the class has a field of this name."""


def preset(cls: type[Spoken], reading: str, parameters: Mapping[str, object]) -> dict[str, object]:
    """Return the switches that a reading sets in a failure with these parameters, but those its sentence implies.

    >>> from pytest_drive_robust.perturbations import InferenceLatency
    >>> late, measured = InferenceLatency(ms=200), InferenceLatency(mode="measured")
    >>> preset(InferenceLatency, "released", late.parameters())
    {'mode': 'hold', 'warmup_ticks': 20}
    >>> preset(InferenceLatency, "released", measured.parameters())
    {'warmup_ticks': 20}
    """
    implied = form_of(cls, parameters).fixed
    return {name: value for name, value in cls.readings.get(reading, {}).items() if name not in implied}


def render(perturbation: Spoken) -> str:
    """Return the sentence; fields that the sentence does not show follow in brackets where they are not the default."""
    parameters = perturbation.parameters()
    sentence, hidden = form_of(type(perturbation), parameters).fill(parameters), brackets(perturbation)
    return f"{sentence} ({hidden})" if hidden else sentence


def brackets(perturbation: Spoken, *, without: str = "") -> str:
    """Return the text in the brackets: fields that the sentence form does not show and that are not the default.

    The field `without` is left out. Switches that are together those of a reading are shown as `reading=released`.
    """
    cls, parameters = type(perturbation), perturbation.parameters()
    template, defaults = form_of(cls, parameters), defaults_of(cls)
    unusual = {
        name: value
        for name, value in parameters.items()
        if name not in template.shown and name not in template.fixed and name != without
        if name not in defaults or value != defaults[name]
    }
    hidden = [f"{name}={render_value(value)}" for name, value in unusual.items()]
    for reading in READINGS if unusual and _READING not in parameters else ():
        switches = preset(cls, reading, parameters)
        alike = all(parameters[name] == value for name, value in switches.items())
        if alike and switches.keys() & unusual.keys():
            others = (f"{name}={render_value(value)}" for name, value in unusual.items() if name not in switches)
            hidden = [f"{_READING}={reading}", *others]
    return ", ".join(hidden)


def parse(text: str, known: Iterable[type[_S]]) -> _S:
    """Parse a sentence that `render` writes, of one of the classes `known`.

    Case and spacing do not matter; `"200ms latency"` is fine. Raises `RequirementError` with the nearest valid
    sentence, and `PerturbationError` when the sentence is right but its severity is not.
    """
    classes = list(known)
    found = match_of(text, classes)
    if found is None:
        raise _unknown(text, classes)
    template, match = found
    cls = template.cls
    values: dict[str, object] = dict(template.fixed)
    groups = match.groupdict()
    bracketed = groups.pop("_brackets")
    for name, value in groups.items():
        values[name] = parse_value(value)
    reading = None
    for name, value in _bracketed(text, bracketed, cls, values):
        if name == _READING and name not in names_of(cls):
            reading = DriveReading(value, f"{_READING}={value} in {text.strip()!r}")
        else:
            values[name] = parse_value(value)
    made = _built(cls, values)
    return made if reading is None else made.read_as(reading)


def parse_stack(text: str, known: Iterable[type[_S]]) -> tuple[_S, ...]:
    """Read sentences that are joined by "and"; `"clean"` is the empty stack. Raises as `parse` does."""
    if text.strip().lower() == CLEAN:
        return ()
    classes = list(known)
    return tuple(parse(sentence, classes) for sentence in _sentences(text, classes))


def _sentences(text: str, classes: Sequence[type[Spoken]]) -> list[str]:
    """Cut at "and". A sentence of a user's class may itself hold an "and", so the longest match is taken."""
    words = split_outside_quotes(text, r"\s+and\s+")
    sentences: list[str] = []
    start = 0
    while start < len(words):
        for end in range(len(words), start, -1):
            sentence = " and ".join(words[start:end])
            if end == start + 1 or match_of(sentence, classes) is not None:
                break
        if len(words) > 1 and sentence.strip().lower() == CLEAN:
            raise RequirementError(f"{text.strip()!r} does not parse: 'clean' means no perturbation and stands alone.")
        sentences.append(sentence)
        start = end
    return sentences


def match_of(text: str, known: Iterable[type[_S]]) -> tuple[Template[_S], re.Match[str]] | None:
    """Return the form that a sentence has, and its match; None for a sentence of no class of `known`."""
    for cls in known:
        for template in templates_of(cls):
            match = template.pattern().fullmatch(text)
            if match is not None:
                return template, match
    return None


def _bracketed(text: str, brackets: str | None, cls: type, taken: Mapping[str, object]) -> Iterable[tuple[str, str]]:
    """Yield the `name=value` pairs within the brackets. Raises `RequirementError` for a wrong or repeated name."""
    if brackets is None:
        return
    open_fields = [name for name in dict.fromkeys((*names_of(cls), _READING)) if name not in taken]
    said: set[str] = set()
    for pair in split_outside_quotes(brackets, ","):
        name, equals, value = (part.strip() for part in pair.partition("="))
        if name in open_fields and value:
            open_fields.remove(name)
            said.add(name)
            yield name, value
            continue
        message = f"{text.strip()!r} does not parse: "
        if not equals or not value:
            message += f"{pair.strip()!r} in the brackets is not name=value."
        elif name in said:
            message += f"{name!r} is said twice."
        elif name in taken:
            message += f"{name!r} is already said in the sentence itself."
        else:
            message += f"{cls.__name__} has no field {name!r}.{did_you_mean(name, open_fields)}"
        raise RequirementError(f"{message} The brackets may hold: {', '.join(open_fields) or 'nothing'}.")


def _built(cls: type[_S], values: Mapping[str, object]) -> _S:
    try:
        return cls(**values)
    except UsageError:
        raise
    except Exception as error:  # a user's class may raise anything, as by an `assert`
        raise refused_by(cls, error) from error


def refused_by(cls: type[Spoken], error: Exception, source: str = "a sentence") -> PerturbationError:
    """Return the error for severities of `source`, for which the constructor of a user's class raised `error`."""
    said = str(error) if isinstance(error, (TypeError, ValueError)) else f"{type(error).__name__}: {error}"
    return PerturbationError(f"{cls.__name__} cannot be built from {source}: {said}")


def _unknown(text: str, classes: Sequence[type[Spoken]]) -> RequirementError:
    numbers = [float(number) for number in re.findall(r"\d+\.?\d*|\.\d+", text)]
    forms = [template for cls in classes for template in templates_of(cls)]
    message = f"there is no perturbation {text.strip()!r}."
    parts = re.split(r"\s*[+,&]\s*", text.strip())
    if len(parts) > 1 and all(match_of(part, classes) for part in parts):
        message += f" Join failures with 'and': {' and '.join(parts)!r}."
    else:
        meant = filter(None, (example_of(form, numbers) for form in forms))
        message += did_you_mean(" ".join(text.split()), meant)
    examples = list(filter(None, (example_of(form, []) for form in forms)))
    return RequirementError(f"{message} Known sentences: {', '.join(map(repr, [CLEAN, *examples]))}.")


def example_of(form: Template[_S], numbers: list[float]) -> str | None:
    """Return a valid sentence of the form, with the given numbers where these are possible; None when there is none."""
    usual = {**form.cls.example, **form.fixed}
    given = {name: _in_unit(name, number) for name, number in zip(form.shown, numbers)}  # noqa: B905
    for values in ({**usual, **given}, usual):
        with contextlib.suppress(UsageError, ValueError):  # an impossible severity is no example
            return form.fill(_built(form.cls, values).parameters())
    return None


def _in_unit(name: str, number: float) -> float:
    """Convert a number in the wrong unit: `0.2` ms was meant in seconds, `200` s in milliseconds."""
    if name.split("_")[-1] == "ms" and 0.0 < number < 1.0:
        return 1000.0 * number
    return number / 1000.0 if name.endswith("_s") and number >= 100.0 else number
