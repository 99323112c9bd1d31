"""Finds the valid sentence nearest to a sentence that does not parse."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Callable, Mapping
from difflib import SequenceMatcher

from pytest_drive_robust.errors import nearest
from pytest_drive_robust.metrics.table import METRICS
from pytest_drive_robust.perturbations.base import Perturbation
from pytest_drive_robust.perturbations.sentence_forms import templates_of
from pytest_drive_robust.perturbations.severity_text import render_value
from pytest_drive_robust.verdict.known_metrics import metric_names

Known = Mapping[str, type[Perturbation]]

_LIMITS = {"RD": "0.30", "SR": "0.50", "DS": "40", "efficiency": "80", "comfort": "20"}
_TURNED = str.maketrans("<>≤≥", "><≥≤")
_AT_MOST = re.compile(r"<|≤|\b(?:below|at most|less than)\b")
_AT_LEAST = re.compile(r">|≥|\b(?:above|at least|more than|over)\b")
_COMPARISON = re.compile(r"[<>=!≤≥]+|\b(?:is|below|above|at most|at least|less than|more than|over)\b")
_NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)")
_FIELD = re.compile(r"\{(\w+)\}")
_UNITS = frozenset({"ms", "m", "s", "%", "px", "deg"})
_JOIN = re.compile(r"\s+and\s+|\s*[+&,]\s*(?![^(]*\))")
"""The words and signs with which people join failures, outside brackets."""
_QUANTITY = re.compile(rf"({_NUMBER.pattern})\s*(ms|s|m)?(?![a-z])")
_BRACKETS = re.compile(r"\([^()]*\)")
_LIST_MARK = re.compile(r"\s*\d+[.)]\s+")
"""The number of a line in a numbered list: `"1. "`."""
_ALIKE = 0.6
_LONG_S = 10.0
"""The delay in seconds from which on the unit is taken for the mistake, not the number."""


def nearest_sentence(sentence: str, known: Known, read: Callable[[str, Known], str | None]) -> str | None:
    """Return `sentence` with the fewest parts replaced that make it valid, or None when no repair helps.

    `read` returns the canonical form of a valid sentence and None for an invalid one.
    """
    left, comparison, limit = _split(_LIST_MARK.sub("", sentence, count=1))
    if _NUMBER.fullmatch(left):  # "0.3 >= RD under ...": turn the sides round
        left, comparison, limit = limit, comparison.translate(_TURNED), left
    metric, setting = _metric_and_setting(left)
    at_most, at_least = _AT_MOST.search(comparison), _AT_LEAST.search(comparison)
    sign = ">=" if at_least or (not at_most and metric != "RD") else "<="
    parts = _JOIN.split(setting)
    valid = [read(f"DS under {part} >= {_LIMITS['DS']}", known) is not None for part in parts]
    repaired = [
        [
            part if keep else _nearest_phrase(part, known, numbers=numbers)
            for part, keep in zip(parts, kept, strict=True)
        ]
        for kept, numbers in ((valid, True), (valid, False), ([False] * len(parts), False))
    ]
    settings = [setting, *map(" and ".join, repaired)]
    limits = [*_limit_candidates(metric, limit), _LIMITS.get(metric, "0")]
    for phrase in [*settings, "200 ms latency" if metric == "RD" else "clean"]:
        for number in limits:
            found = read(f"{metric} under {phrase} {sign} {number}", known)
            if found is not None:
                return found
    return None


def _split(sentence: str) -> tuple[str, str, str]:
    """Return the text before the first comparison, the comparisons, and the text after the last comparison."""
    outside_brackets = re.sub(r"\([^)]*\)", lambda match: " " * len(match.group()), sentence)
    found = list(_COMPARISON.finditer(outside_brackets))
    if not found:
        return sentence, "", ""
    first, last = found[0].start(), found[-1].end()
    return sentence[:first].strip(), sentence[first:last], sentence[last:].strip()


def _metric_and_setting(left: str) -> tuple[str, str]:
    first, _, rest = left.partition(" ")
    metric = first if first in METRICS else nearest(first, metric_names())
    if metric is None:
        return ("RD", left) if first.lower() != "clean" else ("DS", left)
    second, _, others = rest.partition(" ")
    return metric, others if nearest(second, ["under", "in", "with", "at"]) else rest


def _limit_candidates(metric: str, text: str) -> list[str]:
    number = _NUMBER.search(text.replace(",", "."))  # 0,3 as half of the world writes it
    if number is None:
        return []
    plain = number.group()
    if metric in ("RD", "SR") and (abs(float(plain)) > 1.0 or "%" in text):  # 1 is the end of the range
        return [plain, METRICS[metric].format_limit(float(plain) / 100.0)]
    return [plain]


def _nearest_phrase(text: str, known: Known, *, numbers: bool) -> str:
    """Return the phrase whose words are most like the words of `text` outside brackets, or `text` when none is alike.

    The phrase has the numbers of `text` if `numbers` is set, else usual numbers.
    """
    said = _BRACKETS.sub(" ", text)
    words = _words(said)
    forms = [form for _, cls in sorted(known.items()) for form in templates_of(cls)]
    likeness = [SequenceMatcher(None, words, _words(form.text)).ratio() for form in forms]
    if max(likeness, default=0.0) < _ALIKE:
        return text
    form = forms[likeness.index(max(likeness))]
    quantities = iter(_QUANTITY.findall(said) if numbers else ())
    examples = _examples(form.cls)
    return _FIELD.sub(
        lambda field: _in_unit_of(field.group(1), next(quantities, None)) or examples.get(field.group(1), "1"),
        form.text,
    )


def _in_unit_of(field: str, quantity: tuple[str, str] | None) -> str | None:
    """Return a number such as `("0.2", "s")` converted to the unit at the end of the field's name, None for None."""
    if quantity is None:
        return None
    number, unit = quantity
    if unit == "s" and field.split("_")[-1] == "ms" and float(number) < _LONG_S:
        return f"{1000.0 * float(number):g}"
    if unit == "ms" and field.endswith("_s"):
        return f"{float(number) / 1000.0:g}"
    return number


def _examples(cls: type[Perturbation]) -> dict[str, str]:
    """Return a usual value of each field as text: from the class's `example`, else the default."""
    defaults = {field.name: field.default for field in dataclasses.fields(cls)}
    values = {name: value for name, value in defaults.items() if isinstance(value, (int, float, str))}
    values.update(getattr(cls, "example", {}))
    return {name: render_value(value) for name, value in values.items()}


def _words(phrase: str) -> str:
    """Return the words of a phrase without its numbers and units, in lower case."""
    text = _QUANTITY.sub(" ", _FIELD.sub(" ", phrase.lower()))
    return " ".join(word for word in text.split() if word not in _UNITS)
