"""Checks of a class's sentence forms when the class is registered."""

from __future__ import annotations

import itertools
import re
import string
from collections.abc import Iterable

from pytest_drive_robust.errors import PerturbationError
from pytest_drive_robust.perturbations.sentence_forms import Spoken, Template, defaults_of, names_of, templates_of
from pytest_drive_robust.perturbations.sentences import CLEAN, example_of, match_of

_ENDS_A_SETTING = re.compile(r"[#≤≥]|<=|>=")
"""Marks that end a setting in the sentence of a requirement, as the end of the line does."""


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
            if spec or conversion or name not in names_of(cls) or form.shown.count(name) > 1:
                raise PerturbationError(
                    f"the phrase {form.text!r} of {cls.__name__} shows {name!r}. Expected plain names of its fields in "
                    f"braces, each once: {', '.join(names_of(cls)) or 'it has none'}."
                )
    for other in others:
        for said, heard in ((cls, other), (other, cls)) if other is not cls else ():
            for sentence in map(_sample, templates_of(said)):
                if match_of(sentence, [heard]) is not None:
                    raise PerturbationError(
                        f"{sentence!r} is a sentence of {cls.__name__} and of {other.__name__}. Give {cls.__name__} a "
                        "phrase that no other failure has."
                    )


def _sample(form: Template[Spoken]) -> str:
    """Return the example of a form, else a sentence of the form whose severities may be impossible."""
    usual = {**defaults_of(form.cls), **form.cls.example, **form.fixed}
    shown = {name: usual[name] if isinstance(usual.get(name), (int, float, str)) else 1 for name in form.shown}
    return example_of(form, []) or form.fill(shown)
