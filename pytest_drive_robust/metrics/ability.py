"""Multi-ability: success rates of five overlapping groups of scenario types.

Source: Bench2Drive `tools/ability_benchmark.py`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType

from pytest_drive_robust.arithmetic.signals import mean
from pytest_drive_robust.domain.outcome import InfractionKind
from pytest_drive_robust.domain.result import EpisodeResult
from pytest_drive_robust.metrics.episodes import mean_over_routes, require_scorable
from pytest_drive_robust.metrics.score import is_success


def _types(names: str) -> frozenset[str]:
    return frozenset(names.split())


ABILITIES: Mapping[str, frozenset[str]] = MappingProxyType(
    {
        "Overtaking": _types(
            "Accident AccidentTwoWays ConstructionObstacle ConstructionObstacleTwoWays HazardAtSideLane "
            "HazardAtSideLaneTwoWays ParkedObstacle ParkedObstacleTwoWays VehicleOpensDoorTwoWays"
        ),
        "Merging": _types(
            "CrossingBicycleFlow EnterActorFlow HighwayCutIn HighwayExit InterurbanActorFlow "
            "InterurbanAdvancedActorFlow MergerIntoSlowTraffic MergerIntoSlowTrafficV2 NonSignalizedJunctionLeftTurn "
            "NonSignalizedJunctionLeftTurnEnterFlow NonSignalizedJunctionRightTurn ParkingExit SequentialLaneChange "
            "SignalizedJunctionLeftTurn SignalizedJunctionLeftTurnEnterFlow SignalizedJunctionRightTurn"
        ),
        "Emergency_Brake": _types(
            "BlockedIntersection ControlLoss DynamicObjectCrossing HardBreakRoute OppositeVehicleRunningRedLight "
            "OppositeVehicleTakingPriority ParkingCrossingPedestrian ParkingCutIn PedestrianCrossing StaticCutIn "
            "VehicleTurningRoute VehicleTurningRoutePedestrian"
        ),
        "Give_Way": _types("InvadingTurn YieldToEmergencyVehicle"),
        "Traffic_Signs": _types(
            "BlockedIntersection CrossingBicycleFlow EnterActorFlow NonSignalizedJunctionLeftTurn "
            "NonSignalizedJunctionLeftTurnEnterFlow NonSignalizedJunctionRightTurn OppositeVehicleRunningRedLight "
            "OppositeVehicleTakingPriority PedestrianCrossing SignalizedJunctionLeftTurn "
            "SignalizedJunctionLeftTurnEnterFlow SignalizedJunctionRightTurn T_Junction VanillaNonSignalizedTurn "
            "VanillaNonSignalizedTurnEncounterStopsign VanillaSignalizedTurnEncounterGreenLight "
            "VanillaSignalizedTurnEncounterRedLight VehicleTurningRoute VehicleTurningRoutePedestrian"
        ),
    }
)
"""The scenario types of each ability; a type may be in two of them. `HardBreakRoute` is the schema's spelling."""

SIGNS = "Traffic_Signs"
"""The ability with its own success rule, see `abilities`."""
_SIGN_INFRACTIONS = (InfractionKind.RED_LIGHT, InfractionKind.STOP_SIGN)
_EVALUATOR = "bench2drive"
"""The version entry of episodes that the official evaluator drove; its records do not say `junction_passed`."""


def abilities(results: Sequence[EpisodeResult]) -> dict[str, float | None]:
    """Return the success rate (0..1) of each ability over its routes, or None when no episode belongs to the ability.

    Traffic_Signs has its own rule: an episode that failed later counts when the ego passed the first junction by 8
    waypoints without running a red light or a stop sign. Traffic_Signs is also None when the records do not say that of
    an episode (see `signs_between`). Raises `ComparisonError` for no episode or an `infra_error`.
    """
    require_scorable(results)
    rates = {
        ability: mean_over_routes(
            [result for result in results if result.scenario in scenarios],
            _masters_signs if ability == SIGNS else is_success,
        )
        for ability, scenarios in ABILITIES.items()
    }
    return rates if signs_between(results) is None else {**rates, SIGNS: None}


def signs_between(results: Sequence[EpisodeResult]) -> tuple[float, float] | None:
    """Return the smallest and largest possible Traffic_Signs rate (0..1), or None when it is known or has no route.

    Records of the official evaluator do not say whether the first junction was passed; `drive-robust score` with
    `--routes` and `--carla-root` asks the maps.
    """
    signs = [result for result in results if result.scenario in ABILITIES[SIGNS]]
    low = mean_over_routes(signs, _masters_signs)
    high = mean_over_routes(signs, lambda result: _masters_signs(result) or _may_master_signs(result))
    return None if low is None or high is None or low == high else (low, high)


def mean_ability(rates: Mapping[str, float | None]) -> float | None:
    """Return the plain mean of the abilities that have data, or None when none has."""
    known = [rate for rate in rates.values() if rate is not None]
    return mean(known) if known else None


def _masters_signs(result: EpisodeResult) -> bool:
    return is_success(result) or (result.junction_passed and _obeyed(result))


def _may_master_signs(result: EpisodeResult) -> bool:
    return _EVALUATOR in result.versions and _obeyed(result) and result.route_completion_pct > 0.0


def _obeyed(result: EpisodeResult) -> bool:
    return all(infraction.kind not in _SIGN_INFRACTIONS for infraction in result.infractions)
