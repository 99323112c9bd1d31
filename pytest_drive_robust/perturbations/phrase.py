"""Perturbations as sentences and back: `InferenceLatency(ms=200)` is `"200 ms latency"`.

Built from the `phrase` of each class, so that a user's own perturbation has a sentence form as well.
"""

from __future__ import annotations

import contextlib
import dataclasses
import re
from collections.abc import Iterable, Mapping

from pytest_drive_robust.errors import PerturbationError, RequirementError, UsageError, nearest
from pytest_drive_robust.perturbations.base import Perturbation
from pytest_drive_robust.perturbations.template import Template, templates_of
from pytest_drive_robust.perturbations.values import field_types, parse_value, render_value, split_outside_quotes

__all__ = ["matches", "parse", "render"]


def render(perturbation: Perturbation) -> str:
    """The sentence of a perturbation; fields that it does not show follow in brackets when they are not the default."""
    parameters = perturbation.parameters()
    template = next(form for form in templates_of(type(perturbation)) if form.fits(parameters))
    defaults = _defaults(type(perturbation))
    hidden = [
        f"{name}={render_value(value)}"
        for name, value in parameters.items()
        if name not in template.shown and name not in template.fixed
        if name not in defaults or value != defaults[name]
    ]
    sentence = template.fill(parameters)
    return f"{sentence} ({', '.join(hidden)})" if hidden else sentence


def parse(text: str, known: Iterable[type[Perturbation]]) -> Perturbation:
    """The inverse of `render` over the classes `known`. Case and spacing do not matter; `"200ms latency"` is fine.

    Raises `RequirementError` with the nearest valid sentence, and `PerturbationError` when the sentence is right but
    its severity is not.
    """
    classes = list(known)
    found = _match(text, classes)
    if found is None:
        raise _unknown(text, classes)
    template, match = found
    cls = template.cls
    values: dict[str, object] = dict(template.fixed)
    groups = match.groupdict()
    brackets = groups.pop("_brackets")
    for name, value in groups.items():
        values[name] = _converted(cls, name, value)
    for name, value in _bracketed(text, brackets, cls, values):
        values[name] = _converted(cls, name, value)
    return _built(cls, values)


def matches(text: str, known: Iterable[type[Perturbation]]) -> bool:
    """True when the text has the form of a sentence of one of the classes; its severities may still be refused."""
    return _match(text, known) is not None


def _match(text: str, known: Iterable[type[Perturbation]]) -> tuple[Template, re.Match[str]] | None:
    for cls in known:
        for template in templates_of(cls):
            match = template.pattern().fullmatch(text)
            if match is not None:
                return template, match
    return None


def _bracketed(text: str, brackets: str | None, cls: type, taken: Mapping[str, object]) -> Iterable[tuple[str, str]]:
    """The `name=value` pairs within the brackets, names checked."""
    if brackets is None:
        return
    open_fields = [name for name in field_types(cls) if name not in taken]
    for pair in split_outside_quotes(brackets, ","):
        name, equals, value = (part.strip() for part in pair.partition("="))
        if name in open_fields and value:
            yield name, value
            continue
        message = f"{text.strip()!r} does not parse: "
        if not equals or not value:
            message += f"{pair.strip()!r} in the brackets is no name=value."
        elif name in taken:
            message += f"{name!r} is already said in the sentence itself."
        else:
            close = nearest(name, open_fields)
            message += f"{cls.__name__} has no field {name!r}."
            message += f" Did you mean {close!r}?" if close is not None else ""
        raise RequirementError(f"{message} The brackets may hold: {', '.join(open_fields) or 'nothing'}.")


def _converted(cls: type, name: str, text: str) -> object:
    kind = field_types(cls).get(name, object)
    try:
        return parse_value(text, kind)
    except ValueError:
        expected = getattr(kind, "__name__", str(kind))
        raise PerturbationError(f"{cls.__name__}: {name} is {text!r}, expected {expected}") from None


def _built(cls: type[Perturbation], values: Mapping[str, object]) -> Perturbation:
    try:
        return cls(**values)
    except TypeError as error:
        raise PerturbationError(f"{cls.__name__} cannot be built from a sentence: {error}") from error


def _defaults(cls: type[Perturbation]) -> dict[str, object]:
    defaults: dict[str, object] = {}
    for field in dataclasses.fields(cls):
        if field.default is not dataclasses.MISSING:
            defaults[field.name] = field.default
        elif field.default_factory is not dataclasses.MISSING:
            defaults[field.name] = field.default_factory()
    return defaults


def _unknown(text: str, classes: list[type[Perturbation]]) -> RequirementError:
    numbers = [float(number) for number in re.findall(r"\d+\.?\d*|\.\d+", text)]
    forms = [template for cls in classes for template in templates_of(cls)]
    near = nearest(" ".join(text.split()), filter(None, (_example(form, numbers) for form in forms)))
    message = f"there is no perturbation {text.strip()!r}."
    if near is not None:
        message += f" Did you mean {near!r}?"
    examples = [example for form in forms if (example := _example(form, []))]
    return RequirementError(f"{message} Known sentences: {', '.join(map(repr, ['clean', *examples]))}.")


def _example(form: Template, numbers: list[float]) -> str | None:
    """A valid sentence of the form, with the given numbers as far as they are possible."""
    usual = {**getattr(form.cls, "example", {}), **form.fixed}
    given = {name: _in_unit(name, number) for name, number in zip(form.shown, numbers, strict=False)}
    for values in ({**usual, **given}, usual):
        with contextlib.suppress(UsageError):  # an impossible severity is no example
            return form.fill(_built(form.cls, values).parameters())
    return None


def _in_unit(name: str, number: float) -> float:
    """`0.2` for milliseconds was meant in seconds, `200` for seconds in milliseconds."""
    if name.split("_")[-1] == "ms" and 0.0 < number < 1.0:
        return 1000.0 * number
    return number / 1000.0 if name.endswith("_s") and number >= 100.0 else number
