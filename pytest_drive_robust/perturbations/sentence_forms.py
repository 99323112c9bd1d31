"""The sentence forms of a perturbation class: its phrase, its special sentences, and the pattern that reads them.

A class declares them in class attributes (see `Perturbation`), so no module of sentences knows a perturbation by name.
"""

from __future__ import annotations

import dataclasses
import re
import string
from collections.abc import Mapping
from typing import TYPE_CHECKING, ClassVar, Generic, Protocol, TypeVar

from pytest_drive_robust.errors import PerturbationError
from pytest_drive_robust.perturbations.readings import DriveReading
from pytest_drive_robust.perturbations.severity_text import render_value

if TYPE_CHECKING:
    from typing_extensions import Self

_NUMBER = r"[-+]?(?:(?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?|inf|nan)"
_BRACKETS = r'(?:"(?:[^"\\]|\\.)*"|[^"()])*'
_VALUE = r'"(?:[^"\\]|\\.)*"|[^\s()",=]+'


class Spoken(Protocol):
    """A dataclass with a sentence form: the part of a perturbation that sentences need."""

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
        usual = {**defaults_of(self.cls), **self.cls.example}
        parts: list[str] = []
        for literal, name, _, _ in string.Formatter().parse(self.text):
            parts.append(_literal(literal, after_number=bool(parts), before_field=name is not None))
            if name is not None:
                value = usual.get(name)
                is_number = isinstance(value, (int, float)) and not isinstance(value, bool)
                parts.append(f"(?P<{name}>{_NUMBER if is_number else _VALUE})")
        return re.compile(rf"\s*{''.join(parts)}\s*(?:\((?P<_brackets>{_BRACKETS})\))?\s*", re.IGNORECASE)


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


def form_of(cls: type[_S], parameters: Mapping[str, object]) -> Template[_S]:
    """Return the form that tells these severities."""
    return next(form for form in templates_of(cls) if form.fits(parameters))


def names_of(cls: type) -> list[str]:
    """Return the names of the severities."""
    return [field.name for field in dataclasses.fields(cls) if field.init]


def defaults_of(cls: type) -> dict[str, object]:
    """Return the defaults of the severities that have one."""
    defaults: dict[str, object] = {}
    for field in dataclasses.fields(cls):
        if field.default is not dataclasses.MISSING:
            defaults[field.name] = field.default
        elif field.default_factory is not dataclasses.MISSING:
            defaults[field.name] = field.default_factory()
    return defaults


def _literal(text: str, *, after_number: bool, before_field: bool) -> str:
    """Return words of a template as a pattern; the blank between a number and its unit may be left out."""
    words = r"\s+".join(re.escape(word) for word in text.split())
    if not words and after_number and before_field:
        return r"\s+"  # between two fields: without it, 15 would be 1 and 5
    before = r"\s*" if after_number else ""
    after = r"\s+" if words and text[-1:].isspace() else ""
    return before + words + after
