"""Parses requirements from sentences: `METRIC under SETTING <= LIMIT` or `FAILURE margin >= SEVERITY`, one per line."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from textwrap import indent

from pytest_drive_robust.errors import PerturbationError, RequirementError, UsageError, did_you_mean
from pytest_drive_robust.perturbations.base import Perturbation, Setting
from pytest_drive_robust.perturbations.ladder import Ladder, failure_word, ladder_of
from pytest_drive_robust.perturbations.sentence_forms import form_of
from pytest_drive_robust.perturbations.sentences import refused_by
from pytest_drive_robust.perturbations.severity_text import render_value, split_outside_quotes
from pytest_drive_robust.registry.registry import default_registry
from pytest_drive_robust.verdict.known_metrics import known_metric
from pytest_drive_robust.verdict.nearest import nearest_sentence
from pytest_drive_robust.verdict.requirement import ANY_TICK_S, MarginRequirement, Requirement, Written

Known = Mapping[str, type[Perturbation]]

_FORM = "METRIC under SETTING <= LIMIT"
_EXAMPLE = "RD under 200 ms latency <= 0.30"
_COMPARISONS = {"<=": "<=", ">=": ">=", "≤": "<=", "≥": ">="}
_COMPARISON = re.compile("<=|>=|≤|≥")
# Comparisons that people write instead; the "=" of a parameter such as "(mode=hold)" has no space before it.
_NO_COMPARISON = re.compile(r"==|!=|=<|=>|<|>|(?<=\s)=|\b(?:is|below|above|at most|at least|less than|more than)\b")
_QUOTED = re.compile(r'"(?:[^"\\]|\\.)*"')
_DIGITS = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_NUMBER = re.compile(_DIGITS)
_MARGIN = re.compile(
    rf"(?P<words>.+?)\s+margin\s*(?:>=|≥)\s*(?P<level>{_DIGITS})\s*(?P<unit>[a-z]*)"
    rf"(?:\s*\((?:(?P<metric>\w+)\s*(?P<comparison><=|>=|≤|≥)\s*(?P<limit>{_DIGITS})\s*(?:,|(?=\))))?"
    rf"\s*(?P<others>(?:{_QUOTED.pattern}|[^\"()])*)\))?",
    re.IGNORECASE,
)
_ASKS_FOR_A_MARGIN = re.compile(r".+?\s+margin\s*[<>=≤≥]", re.IGNORECASE)
_MARGIN_FORM = "FAILURE margin >= SEVERITY (METRIC <= LIMIT)"
_IN_UNIT_OF_LADDER = {("s", "ms"): 1000.0, ("ms", "s"): 0.001, ("cm", "m"): 0.01, ("km", "m"): 1000.0}

DEFAULT_LIMIT = 0.30
"""The limit of RD in a margin sentence without a limit."""


def requirements(text: str | Path, *more: str, known: Known | None = None) -> list[Requirement]:
    """Return the requirements of a text or a file, one a line, in order; blank lines and `#` comments are skipped.

    Sentences may be given one by one, too: `requirements("DS under clean >= 60", "RD under 200 ms latency <= 0.30")`.

    `known` are the perturbations that sentences may use, by default all registered ones. Raises one `RequirementError`
    that lists all problems of the text: sentences that do not parse, with the line, the expected form and the nearest
    valid sentence; a requirement that occurs twice; a text without any requirement. Also raises `RequirementError` for
    an argument that is neither text nor a path.
    """
    for given in (text, *more):
        if not isinstance(given, str if more else (str, Path)):
            raise RequirementError(
                f"requirements() was given a value of type {type(given).__name__}. Expected a text with one sentence a "
                f"line, as in requirements('{_EXAMPLE}'), several such texts, or a file, as in "
                "requirements(Path('limits.txt'))."
            )
    from_registry = known is None
    known = default_registry().perturbations() if known is None else known
    found: dict[str, tuple[int, Requirement]] = {}
    problems: list[str] = []
    path, text = (text.absolute(), _read(text)) if isinstance(text, Path) else (None, "\n".join((text, *more)))
    for number, line in enumerate(text.splitlines(), 1):
        sentence = split_outside_quotes(line, "#")[0].strip()
        if not sentence:
            continue
        try:
            parsed = _parsed(sentence, known)
        except UsageError as error:
            problems.append(f"line {number}: {sentence}\n{indent(str(error), '    ')}")
            continue
        object.__setattr__(parsed, "written", Written(path, number, sentence))
        first, _ = found.setdefault(str(parsed), (number, parsed))
        if first != number:
            problems.append(f"line {number}: {sentence}\n    says the same as line {first}. Remove one of them.")
    if problems:
        count = "1 problem" if len(problems) == 1 else f"{len(problems)} problems"
        where = path.name if path else "the requirements"
        hint = "" if path else _meant_as_file(text)
        raise RequirementError(
            "\n  ".join([f"{count} in {where}:", *problems]) + hint + (_left_out() if from_registry else "")
        )
    if not found:
        raise RequirementError(f"the text holds no requirement. Expected lines such as '{_EXAMPLE}'.")
    return [parsed for _, parsed in found.values()]


def _meant_as_file(text: str) -> str:
    """Return a hint to pass a `Path` when `text` is the name of a file, else an empty string."""
    name = text.strip()
    try:
        is_file = Path(name).is_file()
    except (OSError, ValueError):  # too long for a name, or with a null character
        return ""
    return f"\nThere is a file of that name: to read it, write requirements(Path({name!r}))." if is_file else ""


def _read(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8-sig")  # some editors begin a file with a byte order mark
    except (OSError, ValueError) as error:
        raise RequirementError(f"the requirements in {str(path)!r} cannot be read: {error}.") from None


def _left_out() -> str:
    """Return the registered failures that do not load, one line each; empty when all failures load."""
    problems = default_registry().problems()
    return "".join(f"\nLeft out: {problem}" for problem in problems)


def _parsed(line: str, known: Known) -> Requirement:
    sentence = " ".join(split_outside_quotes(line, r"\s+"))
    try:
        return _parse(sentence, known)
    except UsageError as error:
        # the nearest sentence to a margin may be a limit, which says the opposite
        suggestion = None if _asks_for_a_margin(sentence) else nearest_sentence(sentence, known, _canonical)
        hint = f"\nNearest valid sentence: {suggestion}" if suggestion else ""
        raise RequirementError(f"{error}{hint}") from None


def _asks_for_a_margin(sentence: str) -> bool:
    return _ASKS_FOR_A_MARGIN.match(_without_quotes(sentence)) is not None


def _without_quotes(sentence: str) -> str:
    """Return the sentence with null characters in place of quoted severities; the length stays equal."""
    return _QUOTED.sub(lambda quoted: "\0" * len(quoted.group()), sentence)


def _canonical(sentence: str, known: Known) -> str | None:
    try:
        return str(_parse(sentence, known))
    except UsageError:
        return None


def _parse(sentence: str, known: Known) -> Requirement:
    margin = _parse_margin(sentence, known)
    if margin is not None:
        return margin
    outside = _without_quotes(sentence)
    comparison = _COMPARISON.search(outside)
    if comparison is None:
        wrong = _NO_COMPARISON.search(outside)
        given = f"{wrong.group()!r} cannot be used here" if wrong else "there is no comparison"
        raise RequirementError(f"{given}. Expected '<=' or '>=' before the limit: '{_FORM}'.")
    metric, under, setting = _left_side(sentence[: comparison.start()].strip())
    if not under:
        raise RequirementError(f"the word 'under' is missing after the metric. Expected '{_FORM}'.")
    known_metric(metric)  # an unknown metric is named before a setting that is missing
    if not setting:
        raise RequirementError(f"the setting after 'under' is missing. Expected 'clean' or a perturbation: '{_FORM}'.")
    limit = _limit(metric, sentence[comparison.end() :].strip())
    return Requirement(metric, Setting.parse(setting, known), _COMPARISONS[comparison.group()], limit)


def _parse_margin(sentence: str, known: Known) -> MarginRequirement | None:
    """Return the requirement of a margin sentence such as `latency margin >= 150 ms`, or None for another sentence.

    Raises `RequirementError` for an unknown failure, a wrong unit and a margin sentence in another form,
    `PerturbationError` for a severity that the failure cannot have.
    """
    found = _MARGIN.fullmatch(sentence)
    if found is None:
        if _asks_for_a_margin(sentence):
            raise RequirementError(f"{sentence!r} states no margin. Expected '{_MARGIN_FORM}', the brackets optional.")
        return None
    ladder = _ladder(found["words"], known)
    unit = found["unit"].lower()
    if unit != ladder.unit:
        given = f"has the unit {unit!r}" if unit else "has no unit"
        level = float(found["level"]) * _IN_UNIT_OF_LADDER.get((unit, ladder.unit), 1.0)
        raise RequirementError(
            f"the severity {found['level']} {given}. Expected {ladder.unit or 'none'}: "
            f"'{ladder.word} margin >= {level:g} {ladder.unit}'.".replace(" '.", "'.")
        )
    metric = known_metric(found["metric"] or "RD")
    comparison = _COMPARISONS[found["comparison"] or "<="]
    limit = float(found["limit"]) if found["limit"] else DEFAULT_LIMIT
    failure = _at(ladder, float(found["level"]))
    others = found["others"]
    setting = Setting.parse(_with_parameters(failure, others, ladder.field), known) if others else Setting.of(failure)
    return MarginRequirement(metric, setting, comparison, limit)


def _with_parameters(failure: Perturbation, others: str, field: str) -> str:
    """Return the sentence of the failure with `others` in its brackets, and its severity `field` wherever that stands.

    A sentence that does not show the severity would lose it: the brackets hold it then, beside `others`.
    """
    parameters = failure.parameters()
    form = form_of(type(failure), parameters)
    is_said = field in form.shown or field in form.fixed
    severity = "" if is_said else f"{field}={render_value(parameters[field])}, "
    return f"{form.fill(parameters)} ({severity}{others})"


def _ladder(words: str, known: Known) -> Ladder:
    by_word: dict[str, list[type[Perturbation]]] = {}
    for cls in dict.fromkeys(known.values()):
        by_word.setdefault(failure_word(cls).lower(), []).append(cls)
    called = by_word.get(" ".join(words.lower().split()), [])
    if not called:
        hint = did_you_mean(words, by_word)
        raise RequirementError(
            f"there is no failure called {words!r}.{hint} Expected one of {', '.join(sorted(by_word))}."
        )
    graded = [cls for cls in called if cls.ladder is not None] or called
    if len(graded) > 1:
        names = " and ".join(cls.__name__ for cls in graded)
        raise RequirementError(
            f"{words!r} may be {names}. Name the failure by its sentence, as in '{_EXAMPLE}', or give one of them "
            "another phrase."
        )
    try:
        return ladder_of(graded[0], dt_s=ANY_TICK_S)
    except PerturbationError as error:
        raise RequirementError(str(error)) from None
    except UsageError:
        raise
    except Exception as error:  # of the class itself
        raise RequirementError(str(refused_by(graded[0], error, "its ladder"))) from None


def _at(ladder: Ladder, level: float) -> Perturbation:
    """Return the failure at severity `level`. Raises `PerturbationError`, also in place of errors of its class."""
    try:
        return ladder.at(level)
    except UsageError:
        raise
    except Exception as error:  # of the class itself
        raise refused_by(type(ladder.template), error) from error


def _left_side(text: str) -> tuple[str, str, str]:
    """Split the text before the comparison into the metric, the word "under" (or an empty string) and the setting."""
    words = text.split(" ", 2)
    if len(words) < 2 or words[1] != "under":
        return words[0], "", ""
    return words[0], words[1], words[2] if len(words) == 3 else ""


def _limit(metric: str, text: str) -> float:
    if _NUMBER.fullmatch(text):
        return float(text)
    number = _NUMBER.match(text)
    if number and text[number.end() :].strip() in ("%", "percent", "pct"):
        value = float(number.group())
        plain = value / 100.0 if metric in ("RD", "SR") else value
        raise RequirementError(
            f"the limit {text!r} has a unit. Expected a plain number: {known_metric(metric).format_limit(plain)}."
        )
    given = f"the limit is {text!r}" if text else "the limit is missing"
    raise RequirementError(f"{given}. Expected a plain number such as 0.30 for RD and SR or 40 for DS.")
