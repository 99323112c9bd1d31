"""The sentence of a perturbation class as a template that is filled for `str()` and matched for parsing."""

from __future__ import annotations

import dataclasses
import re
import string
from collections.abc import Mapping

from pytest_drive_robust.errors import PerturbationError
from pytest_drive_robust.perturbations.base import Perturbation
from pytest_drive_robust.perturbations.values import field_types, is_number_type, render_value

__all__ = ["Template", "kebab_name", "templates_of"]

_NUMBER = r"[-+]?(?:(?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?|inf|nan)"
_BRACKETS = r'(?:"(?:[^"\\]|\\.)*"|[^"()])*'
_VALUE = r'"(?:[^"\\]|\\.)*"|[^\s()",=]+'


@dataclasses.dataclass(frozen=True)
class Template:
    """One sentence form of `cls`: `text` with its fields in braces, and the fields that it implies (`fixed`)."""

    cls: type[Perturbation]
    text: str
    fixed: Mapping[str, object]

    @property
    def shown(self) -> tuple[str, ...]:
        """The names of the fields in braces, in order."""
        return tuple(name for _, name, _, _ in string.Formatter().parse(self.text) if name is not None)

    def fits(self, parameters: Mapping[str, object]) -> bool:
        """True when the parameters have all that the form implies."""
        return all(name in parameters and parameters[name] == value for name, value in self.fixed.items())

    def fill(self, parameters: Mapping[str, object]) -> str:
        """The sentence without brackets. Raises `PerturbationError` when the template shows an unknown field."""
        missing = sorted({*self.shown} - {*parameters})
        if missing:
            raise PerturbationError(
                f"the phrase {self.text!r} of {self.cls.__name__} shows {missing[0]!r}, which is none of its fields "
                f"({', '.join(parameters) or 'it has none'}). Is {self.cls.__name__} decorated with @dataclass?"
            )
        return self.text.format(**{name: render_value(parameters[name]) for name in self.shown})

    def pattern(self) -> re.Pattern[str]:
        """Matches the filled sentence, in any case and spacing, with or without brackets (group `brackets`)."""
        kinds = field_types(self.cls)
        parts: list[str] = []
        for literal, name, _, _ in string.Formatter().parse(self.text):
            parts.append(_literal(literal, after_number=bool(parts)))
            if name is not None:
                parts.append(f"(?P<{name}>{_NUMBER if is_number_type(kinds.get(name, object)) else _VALUE})")
        return re.compile(rf"\s*{''.join(parts)}\s*(?:\((?P<_brackets>{_BRACKETS})\))?\s*", re.IGNORECASE)


def templates_of(cls: type[Perturbation]) -> list[Template]:
    """The forms of a class, special ones first: its `variants` (`{"measured latency": {"mode": "measured"}}`), then
    its `phrase`; a class without a phrase gets its own name in words."""
    variants: Mapping[str, Mapping[str, object]] = getattr(cls, "variants", {})
    usual = cls.phrase or kebab_name(cls).replace("-", " ")
    return [*(Template(cls, text, fixed) for text, fixed in variants.items()), Template(cls, usual, {})]


def kebab_name(cls: type) -> str:
    """`"burst-frame-drop"` for `BurstFrameDrop`.

    >>> kebab_name(Perturbation)
    'perturbation'
    """
    return re.sub(r"(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])", "-", cls.__name__).lower()


def _literal(text: str, *, after_number: bool) -> str:
    """Words of a template as a pattern; the blank between a number and its unit may be left out."""
    words = r"\s+".join(re.escape(word) for word in text.split())
    before = r"\s*" if after_number else ""
    after = r"\s+" if words and text[-1:].isspace() else ""
    return before + words + after
