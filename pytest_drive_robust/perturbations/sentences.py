"""Perturbations as sentences and back: `InferenceLatency(ms=200)` is `"200 ms latency"`.

Sentences are built from the `phrase` of each class, so that a user's own perturbation has a sentence form as well. A
class declares its sentence in class attributes (see `Perturbation`), so this module knows no perturbation by name.
"""

from __future__ import annotations

import contextlib
import dataclasses
import itertools
import numbers
import re
import string
from collections.abc import Iterable, Mapping, Sequence
from enum import Enum
from typing import TYPE_CHECKING, ClassVar, Generic, Protocol, TypeVar

from pytest_drive_robust.errors import PerturbationError, RequirementError, UsageError, did_you_mean
from pytest_drive_robust.perturbations.readings import READINGS, DriveReading
from pytest_drive_robust.perturbations.severity_text import parse_value, render_value, split_outside_quotes

if TYPE_CHECKING:
    from typing_extensions import Self

CLEAN = "clean"
"""The sentence of the empty stack."""

_READING = "reading"
"""The name that brackets may hold beside the fields of a class, unless the class has a field of this name."""

_NUMBER = r"[-+]?(?:(?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?|inf|nan)"
_BRACKETS = r'(?:"(?:[^"\\]|\\.)*"|[^"()])*'
_VALUE = r'"(?:[^"\\]|\\.)*"|[^\s()",=]+'
_ENDS_A_SETTING = re.compile(r"[#≤≥]|<=|>=")
"""Marks that end a setting in the sentence of a requirement, as the end of the line does."""


class Spoken(Protocol):
    """A dataclass with a sentence form: the part of a perturbation that this module needs."""

    phrase: ClassVar[str]
    variants: ClassVar[Mapping[str, Mapping[str, object]]]
    example: ClassVar[Mapping[str, object]]
    readings: ClassVar[Mapping[str, Mapping[str, object]]]

    def parameters(self) -> dict[str, object]:
        """Return the severities by name."""

    def read_as(self, reading: DriveReading) -> Self:
        """Return the perturbation with the switches of a reading."""


_S = TypeVar("_S", bound=Spoken)


@dataclasses.dataclass(frozen=True)
class Template(Generic[_S]):
    """One sentence form of `cls`: `text` with fields in braces, and the fields that the form implies (`fixed`)."""

    cls: type[_S]
    text: str
    fixed: Mapping[str, object]

    @property
    def shown(self) -> tuple[str, ...]:
        """The names of the fields in braces, in order."""
        return tuple(name for _, name, _, _ in string.Formatter().parse(self.text) if name is not None)

    def fits(self, parameters: Mapping[str, object]) -> bool:
        """Return True when the parameters have every value in `fixed`."""
        return all(name in parameters and parameters[name] == value for name, value in self.fixed.items())

    def fill(self, parameters: Mapping[str, object]) -> str:
        """Return the sentence without brackets. Raises `PerturbationError` when the template shows an unknown field."""
        missing = sorted({*self.shown} - {*parameters})
        if missing:
            raise PerturbationError(
                f"the phrase {self.text!r} of {self.cls.__name__} shows {missing[0]!r}, which is none of its fields "
                f"({', '.join(parameters) or 'it has none'}). Is {self.cls.__name__} decorated with @dataclass?"
            )
        return self.text.format(**{name: render_value(parameters[name]) for name in self.shown})

    def pattern(self) -> re.Pattern[str]:
        """Return the pattern of the filled sentence, any case and spacing, with or without brackets (`_brackets`)."""
        usual = {**_defaults(self.cls), **self.cls.example}
        parts: list[str] = []
        for literal, name, _, _ in string.Formatter().parse(self.text):
            parts.append(_literal(literal, after_number=bool(parts), before_field=name is not None))
            if name is not None:
                value = usual.get(name)
                is_number = isinstance(value, (int, float)) and not isinstance(value, bool)
                parts.append(f"(?P<{name}>{_NUMBER if is_number else _VALUE})")
        return re.compile(rf"\s*{''.join(parts)}\s*(?:\((?P<_brackets>{_BRACKETS})\))?\s*", re.IGNORECASE)


def check_sentences(cls: type[Spoken], others: Iterable[type[Spoken]]) -> None:
    """Raise `PerturbationError` for sentence forms that cannot be read back, or that another class has as well."""
    for form in templates_of(cls):
        lines = form.text.splitlines()
        if len(lines) > 1 or _ENDS_A_SETTING.search(form.text) or form.text.strip().lower() == CLEAN:
            raise PerturbationError(
                f"the phrase {form.text!r} of {cls.__name__} can stand in no requirement: expected one line that is "
                f"not {CLEAN!r}, without '#', '<=' and '>='."
            )
        try:
            parts = list(string.Formatter().parse(form.text))
        except ValueError as error:
            raise PerturbationError(f"the phrase {form.text!r} of {cls.__name__} is malformed: {error}.") from None
        shown = [part[1:] for part in parts if part[1] is not None]
        if any(before[1] and after[1] and not after[0] for before, after in itertools.pairwise(parts)):
            raise PerturbationError(
                f"the phrase {form.text!r} of {cls.__name__} has nothing between two fields: put a blank or a word "
                "there."
            )
        for name, spec, conversion in shown:
            if spec or conversion or name not in _names(cls) or form.shown.count(name) > 1:
                raise PerturbationError(
                    f"the phrase {form.text!r} of {cls.__name__} shows {name!r}. Expected plain names of its fields in "
                    f"braces, each once: {', '.join(_names(cls)) or 'it has none'}."
                )
    for other in others:
        for said, heard in ((cls, other), (other, cls)) if other is not cls else ():
            for sentence in map(_sample, templates_of(said)):
                if _match(sentence, [heard]) is not None:
                    raise PerturbationError(
                        f"{sentence!r} is a sentence of {cls.__name__} and of {other.__name__}. Give {cls.__name__} a "
                        "phrase that no other failure has."
                    )


def templates_of(cls: type[_S]) -> list[Template[_S]]:
    """Return the forms of a class, special ones first: its `variants`, then its `phrase`.

    A class without a phrase gets its own name in words.
    """
    usual = cls.phrase or kebab_name(cls).replace("-", " ")
    return [*(Template(cls, text, fixed) for text, fixed in cls.variants.items()), Template(cls, usual, {})]


def kebab_name(cls: type) -> str:
    """Return the name of a class in lower case with hyphens.

    >>> class BurstFrameDrop: ...
    >>> kebab_name(BurstFrameDrop)
    'burst-frame-drop'
    """
    return re.sub(r"(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])", "-", cls.__name__).lower()


def preset(cls: type[Spoken], reading: str, parameters: Mapping[str, object]) -> dict[str, object]:
    """Return the switches that a reading sets in a failure with these parameters, but those its sentence implies.

    >>> from pytest_drive_robust.perturbations import InferenceLatency
    >>> late, measured = InferenceLatency(ms=200), InferenceLatency(mode="measured")
    >>> preset(InferenceLatency, "released", late.parameters())
    {'mode': 'hold', 'warmup_ticks': 20}
    >>> preset(InferenceLatency, "released", measured.parameters())
    {'warmup_ticks': 20}
    """
    implied = _form_of(cls, parameters).fixed
    return {name: value for name, value in cls.readings.get(reading, {}).items() if name not in implied}


def render(perturbation: Spoken) -> str:
    """Return the sentence; fields that the sentence does not show follow in brackets where they are not the default."""
    parameters = perturbation.parameters()
    sentence, hidden = _form_of(type(perturbation), parameters).fill(parameters), brackets(perturbation)
    return f"{sentence} ({hidden})" if hidden else sentence


def brackets(perturbation: Spoken, *, without: str = "") -> str:
    """Return the text in the brackets: fields that the sentence form does not show and that are not the default.

    The field `without` is left out. Switches that are together those of a reading are shown as `reading=released`.
    """
    cls, parameters = type(perturbation), perturbation.parameters()
    template, defaults = _form_of(cls, parameters), _defaults(cls)
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
    found = _match(text, classes)
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
        if name == _READING and name not in _names(cls):
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
            if end == start + 1 or _match(sentence, classes) is not None:
                break
        if len(words) > 1 and sentence.strip().lower() == CLEAN:
            raise RequirementError(f"{text.strip()!r} does not parse: 'clean' means no perturbation and stands alone.")
        sentences.append(sentence)
        start = end
    return sentences


def _match(text: str, known: Iterable[type[_S]]) -> tuple[Template[_S], re.Match[str]] | None:
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
    open_fields = [name for name in dict.fromkeys((*_names(cls), _READING)) if name not in taken]
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


def retyped(cls: type[Spoken], values: Mapping[str, object]) -> dict[str, object]:
    """Return the values that are not of their field's type, in the type of the field's default.

    A sentence, and so the key of an episode, tells no types: `2` and `2.0` are one number, but `pixels * 2` may wrap
    around, and `range(2.0)` is an error. A field without a default has the type of its `example`.
    """
    defaults = {name: value for name, value in _defaults(cls).items() if value is not None}
    usual, found = {**cls.example, **defaults}, {}
    for name, value in values.items():
        with contextlib.suppress(OverflowError, ValueError):  # no such number or member: the class may refuse it
            typed = _as_type(type(usual.get(name)), value)
            if type(typed) is not type(value):
                found[name] = typed
    return found


def _as_type(kind: type, value: object) -> object:
    """Return a number or word as a float, a whole number or a member of the enumeration `kind`, else `value` itself."""
    if isinstance(value, str) and issubclass(kind, Enum):
        return kind(value)
    if not isinstance(value, numbers.Real) or isinstance(value, bool):
        return value
    is_exact = kind is float or issubclass(kind, Enum) or (kind is int and float(value).is_integer())
    return kind(value) if is_exact else value


def _built(cls: type[_S], values: Mapping[str, object]) -> _S:
    try:
        return cls(**values)
    except UsageError:
        raise
    except Exception as error:  # a user's class may raise anything, as by an `assert`
        raise refused_by(cls, error) from error


def refused_by(cls: type[Spoken], error: Exception) -> PerturbationError:
    """Return the error for severities for which the constructor of a user's class raised `error`."""
    said = str(error) if isinstance(error, (TypeError, ValueError)) else f"{type(error).__name__}: {error}"
    return PerturbationError(f"{cls.__name__} cannot be built from a sentence: {said}")


def _form_of(cls: type[_S], parameters: Mapping[str, object]) -> Template[_S]:
    return next(form for form in templates_of(cls) if form.fits(parameters))


def _names(cls: type) -> list[str]:
    return [field.name for field in dataclasses.fields(cls) if field.init]


def _defaults(cls: type) -> dict[str, object]:
    defaults: dict[str, object] = {}
    for field in dataclasses.fields(cls):
        if field.default is not dataclasses.MISSING:
            defaults[field.name] = field.default
        elif field.default_factory is not dataclasses.MISSING:
            defaults[field.name] = field.default_factory()
    return defaults


def _unknown(text: str, classes: Sequence[type[Spoken]]) -> RequirementError:
    numbers = [float(number) for number in re.findall(r"\d+\.?\d*|\.\d+", text)]
    forms = [template for cls in classes for template in templates_of(cls)]
    message = f"there is no perturbation {text.strip()!r}."
    parts = re.split(r"\s*[+,&]\s*", text.strip())
    if len(parts) > 1 and all(_match(part, classes) for part in parts):
        message += f" Join failures with 'and': {' and '.join(parts)!r}."
    else:
        meant = filter(None, (_example(form, numbers) for form in forms))
        message += did_you_mean(" ".join(text.split()), meant)
    examples = list(filter(None, (_example(form, []) for form in forms)))
    return RequirementError(f"{message} Known sentences: {', '.join(map(repr, [CLEAN, *examples]))}.")


def _example(form: Template[_S], numbers: list[float]) -> str | None:
    """Return a valid sentence of the form, with the given numbers where these are possible; None when there is none."""
    usual = {**form.cls.example, **form.fixed}
    given = {name: _in_unit(name, number) for name, number in zip(form.shown, numbers)}  # noqa: B905
    for values in ({**usual, **given}, usual):
        with contextlib.suppress(UsageError, ValueError):  # an impossible severity is no example
            return form.fill(_built(form.cls, values).parameters())
    return None


def _sample(form: Template[_S]) -> str:
    """Return the example of a form, else a sentence of the form whose severities may be impossible."""
    usual = {**_defaults(form.cls), **form.cls.example, **form.fixed}
    shown = {name: usual[name] if isinstance(usual.get(name), (int, float, str)) else 1 for name in form.shown}
    return _example(form, []) or form.fill(shown)


def _in_unit(name: str, number: float) -> float:
    """Convert a number in the wrong unit: `0.2` ms was meant in seconds, `200` s in milliseconds."""
    if name.split("_")[-1] == "ms" and 0.0 < number < 1.0:
        return 1000.0 * number
    return number / 1000.0 if name.endswith("_s") and number >= 100.0 else number


def _literal(text: str, *, after_number: bool, before_field: bool) -> str:
    """Return words of a template as a pattern; the blank between a number and its unit may be left out."""
    words = r"\s+".join(re.escape(word) for word in text.split())
    if not words and after_number and before_field:
        return r"\s+"  # between two fields: without it, 15 would be 1 and 5
    before = r"\s*" if after_number else ""
    after = r"\s+" if words and text[-1:].isspace() else ""
    return before + words + after
