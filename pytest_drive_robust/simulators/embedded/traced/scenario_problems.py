"""Find the mistakes in a scenario of a route file, by the schema of its type."""

from __future__ import annotations

from collections.abc import Iterable

from pytest_drive_robust.domain.route import ScenarioSpec
from pytest_drive_robust.errors import nearest
from pytest_drive_robust.simulators.embedded.traced.schema import (
    BEARINGS,
    INTERVALS,
    OBSTACLES_TWO_WAYS,
    RANGES,
    READERS,
    SCHEMA,
    TypeSchema,
)


def nearest_hint(given: str, known: Iterable[str]) -> str:
    """Return the hint `", did you mean 'speed'?"` for use within a sentence; an empty text when no name is close."""
    close = nearest(given, known)
    return "" if close is None else f", did you mean {close!r}?"


def problems_of(spec: ScenarioSpec, *, strict: bool = False, placed: bool = True) -> list[str]:
    """Return the mistakes in a scenario of a route file, one text each; empty for a correct scenario.

    `strict` refuses elements that the scenario does not read. `placed` requires the places of the scenario type.
    """
    schema = SCHEMA.get(spec.type)
    if schema is None:
        hint = nearest_hint(spec.type, sorted(SCHEMA))
        return [f"unknown scenario type {spec.type!r}{hint} (44 are known: `drive-robust routes list full`)"]
    found: list[str] = []
    for name in RANGES:
        found += _bad_numbers(spec, name)
    for name in (*schema.locations, *schema.optional_locations):
        found += _bad_location(spec, name, needed=placed and name in schema.locations)
    if strict:
        found += _without_effect(spec, schema)
    direction = spec.texts.get("direction")
    if "direction" in spec.parameters or (
        direction is not None and schema.directions and direction not in schema.directions
    ):
        given = direction if direction is not None else spec.parameters["direction"]
        found.append(f"<direction> is {given!r}, expected {' or '.join(schema.directions or BEARINGS)}")
    return found


def _without_effect(spec: ScenarioSpec, schema: TypeSchema) -> list[str]:
    """Return one text for each name of an element or attribute that would have no effect."""
    attributes = {name: _numbers_of(name) for name, types in READERS.items() if spec.type in types}
    if schema.directions or spec.type in OBSTACLES_TWO_WAYS:
        attributes["direction"] = ("value",)
    attributes |= dict.fromkeys((*schema.locations, *schema.optional_locations), ("x", "y", "z"))
    found = []
    for element in (*spec.parameters, *spec.texts):
        if element not in attributes:
            hint = nearest_hint(element, attributes)
            found.append(
                f"<{element}> is no element of {spec.type}{hint} (known: {', '.join(sorted(attributes)) or 'none'})"
            )
            continue
        found += [
            f"<{element}> has an attribute {other!r}, expected {', '.join(attributes[element])}"
            for other in sorted({*spec.parameters.get(element, ())}.difference(attributes[element]))
        ]
    return found


def _numbers_of(element: str) -> tuple[str, ...]:
    """Return the attributes of an element of numbers."""
    return ("from", "to", "value") if element in INTERVALS else ("value",)


def _bad_numbers(spec: ScenarioSpec, name: str) -> list[str]:
    if name in spec.texts:
        return [f"<{name}> has value={spec.texts[name]!r}, expected a finite number"]
    if name not in spec.parameters:
        return []
    given, (low, high), attributes = spec.parameters[name], RANGES[name], _numbers_of(name)
    if not any(attribute in given for attribute in attributes):
        return [f"<{name}> has no {' or '.join(attributes)}"]
    return [
        f"<{name}> has {attribute}={given[attribute]:g}, expected {low:g} to {high:g}"
        for attribute in attributes
        if attribute in given and not low <= given[attribute] <= high
    ]


def _bad_location(spec: ScenarioSpec, name: str, *, needed: bool) -> list[str]:
    given = spec.parameters.get(name)
    if given is None and name not in spec.texts:
        return [f"scenario {spec.type} needs <{name} x= y= z=>, which is missing"] if needed else []
    if given is None or "x" not in given or "y" not in given:
        return [f"<{name}> has no finite x and y"]
    return []
