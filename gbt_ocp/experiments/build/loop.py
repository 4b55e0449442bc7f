"""From a checked configuration to the parts of a closed loop."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any, cast

import numpy as np

from gbt_ocp.experiments.build.desired import build_desired_bearing, paced
from gbt_ocp.experiments.build.limits import with_effort, with_limits
from gbt_ocp.experiments.build.objective import build_hypotheses, build_joint, build_objective, build_past, build_path
from gbt_ocp.experiments.build.own_vehicle import own_vehicle
from gbt_ocp.experiments.build.plant import build_plant
from gbt_ocp.experiments.build.sensors import build_sensor, build_sensors
from gbt_ocp.experiments.build.trackers import build_tracker
from gbt_ocp.experiments.build.world import Streams, build_start, build_target
from gbt_ocp.experiments.config.guidance import (
    CircumnavigationGuidanceSection,
    ConstantForceGuidanceSection,
    FimPlacementGuidanceSection,
    HelicalGuidanceSection,
    PlannerGuidanceSection,
    RandomGuidanceSection,
    StaticGuidanceSection,
)
from gbt_ocp.experiments.config.schema import Configuration
from gbt_ocp.experiments.config.vehicle import DrivenVehicleSection, FossenVehicleSection, VehicleParametersSection
from gbt_ocp.guidance.apart import OwnSide
from gbt_ocp.guidance.circumnavigation import Circumnavigation
from gbt_ocp.guidance.current import Current, CurrentObserver, KnownCurrent
from gbt_ocp.guidance.fim_placement import FimPlacement
from gbt_ocp.guidance.helical import HelicalGuidance
from gbt_ocp.guidance.helm import SteeringLimits
from gbt_ocp.guidance.objectives import RangePull
from gbt_ocp.guidance.open_loop import ConstantForce, RandomThrust, Static
from gbt_ocp.guidance.others import OtherVehicles
from gbt_ocp.guidance.planned import PlannedMotion
from gbt_ocp.guidance.startup import CrossFirst
from gbt_ocp.guidance.strategy import Guidance
from gbt_ocp.guidance.swept import DesiredTurn
from gbt_ocp.guidance.water import InWater
from gbt_ocp.models.bearings import DesiredBearing
from gbt_ocp.models.contracts import made
from gbt_ocp.models.fossen import FossenParameters, FossenVehicle
from gbt_ocp.models.known_vehicles import KNOWN_DRIVEN, KNOWN_VEHICLES
from gbt_ocp.models.targets import Target
from gbt_ocp.models.vehicles import Vehicle
from gbt_ocp.ocp import AnyPlanner, ShootingProblem, ThrustLimit, TrajectoryProblem
from gbt_ocp.ocp.follower import BANDWIDTH
from gbt_ocp.pilot.teamwork import Exchange
from gbt_ocp.simulation.closed_loop import ClosedLoop
from gbt_ocp.tracking.protocol import PositionTracker, Tracker
from gbt_ocp.typing import Array


def build_vehicle(configuration: Configuration) -> Any:
    """The vehicle: a :class:`~gbt_ocp.models.Vehicle`, or a :class:`~gbt_ocp.models.DrivenBody` that is not flat.

    Raises
    ------
    ValueError
        If the problem's own vehicle lacks something or moves in another number of dimensions.
    """
    section = configuration.vehicle
    if isinstance(section, DrivenVehicleSection):
        return KNOWN_DRIVEN[section.model].make(section.thrust_max, section.thrust_min)
    if not isinstance(section, FossenVehicleSection):
        return own_vehicle(configuration)
    given = section.parameters
    if isinstance(given, VehicleParametersSection):
        parameters = FossenParameters(
            given.mass, given.inertia, given.added_mass, given.linear_drag, given.quadratic_drag
        )
    else:
        parameters = KNOWN_VEHICLES[given].parameters(configuration.dimension)
    return FossenVehicle(parameters, section.thrust_max, section.thrust_min)


def build_current(configuration: Configuration, vehicle: Vehicle) -> Current | None:
    """What the planner knows of the current; ``None`` where it plans for still water."""
    known = getattr(configuration.vehicle, "current", "none")
    if known == "none":
        return None
    return CurrentObserver(vehicle) if known == "unknown" else KnownCurrent(known)


def build_problem(
    configuration: Configuration, vehicle: Vehicle, current: Current | None = None
) -> TrajectoryProblem | ShootingProblem:
    """The trajectory problem in the formulation that is asked for; with a current, in the frame of the water."""
    section, dimension = configuration.planner, configuration.dimension
    period = section.period_s or configuration.period_s
    problem: TrajectoryProblem | ShootingProblem
    if section.form == "shooting":
        problem = ShootingProblem(vehicle, section.pieces, period, section.thrust, section.steps)
    else:
        problem = TrajectoryProblem(vehicle, section.pieces, period, section.degree, section.continuity)
    problem = problem.maximize(build_objective(configuration))
    if section.range_pull > 0.0:
        problem = problem.maximize(RangePull(dimension, section.range_pull, section.range_reference_m))
    limit = ThrustLimit(vehicle, section.gamma, section.thrust_units)
    if section.formulation == "hard":
        problem = problem.subject_to(limit, nodes=section.nodes)
    else:
        problem = problem.subject_to_penalty(limit, weight=section.weight, width=section.width, nodes=section.nodes)
    problem = with_effort(problem, section, vehicle)
    problem = with_limits(problem, configuration.limits, current, max(len(configuration.vehicles) - 1, 0))
    more = configuration.problem_object.constrain
    if more is None:
        return problem
    constrained = made("constrain", more, problem)
    if not isinstance(constrained, TrajectoryProblem | ShootingProblem):
        raise ValueError(f"constrain: found a {type(constrained).__name__} returned; allowed: a TrajectoryProblem")
    return constrained


def build_flat_problem(configuration: Configuration, vehicle: Vehicle) -> TrajectoryProblem:
    """The same where only the flat form will do.

    Raises
    ------
    ValueError
        If another form is asked for.
    """
    problem = build_problem(configuration, vehicle)
    if not isinstance(problem, TrajectoryProblem):
        raise ValueError(f"planner.form: found {configuration.planner.form}; allowed: flat")
    return problem


def build_planner(configuration: Configuration, vehicle: Vehicle, current: Current | None = None) -> AnyPlanner:
    """The planner with its solver."""
    section = configuration.planner
    own = configuration.problem_object
    if current is None and type(vehicle) is FossenVehicle and own.constrain is None and own.objective is None:
        problem = _posed(_Posing.of(configuration))
    else:
        problem = build_problem(configuration, vehicle, current)
    return problem.compile(section.solver, section.solver_options)


@dataclass(frozen=True)
class _Posing:
    """What a trajectory problem is posed by: a configuration, which counts without its seed."""

    text: str
    configuration: Configuration = field(compare=False)

    @classmethod
    def of(cls, configuration: Configuration) -> _Posing:
        return cls(configuration.model_dump_json(exclude={"seed"}), configuration)


@lru_cache(maxsize=32)
def _posed(by: _Posing) -> TrajectoryProblem | ShootingProblem:
    """The problem of a configuration whose runs differ in their seed alone, which all share it: it does not change.

    Not so with objects that are the user's, or that learn.
    """
    return build_problem(by.configuration, build_vehicle(by.configuration))


def build_guidance(
    configuration: Configuration,
    vehicle: Vehicle,
    desired: DesiredTurn,
    rng: np.random.Generator,
    tracker: Tracker | PositionTracker | None = None,
    others: OtherVehicles | None = None,
) -> Guidance:
    """The observer strategy; the tracker for a plan whose objective asks it for more than a forecast.

    ``others`` are the other vehicles, if there are any.
    """
    section = configuration.guidance
    if isinstance(section, StaticGuidanceSection):
        return Static(vehicle)
    if isinstance(section, ConstantForceGuidanceSection):
        return ConstantForce(vehicle, section.force)
    if isinstance(section, RandomGuidanceSection):
        return RandomThrust(vehicle, section.hold_s, rng)
    period = configuration.period_s
    if isinstance(section, CircumnavigationGuidanceSection):
        return Circumnavigation(
            vehicle, period, speed=section.speed, radial_gain=section.radial_gain, standoff=section.standoff_m
        )
    if isinstance(section, FimPlacementGuidanceSection):
        assert isinstance(desired, DesiredBearing), "only the planner's bearing is paced"
        return FimPlacement(desired, period, standoff=section.standoff_m)
    if isinstance(section, HelicalGuidanceSection):
        return HelicalGuidance(
            vehicle,
            period,
            gain=section.gain,
            amplitude_z=section.amplitude_z,
            amplitude_y=section.amplitude_y,
            frequency=section.frequency,
            standoff=section.standoff_m,
            range_gain=section.range_gain,
            range_damping=section.range_damping,
        )
    current = build_current(configuration, vehicle)
    if others is not None:
        others.current, others.speed = current, configuration.limits.speed
    planner = build_planner(configuration, vehicle, current)
    objective = planner.problem.objectives[0]
    planned = PlannedMotion(
        planner,
        desired,
        configuration.steps_a_piece,
        stride=configuration.forecasts_a_piece,
        begin_at_sight=configuration.desired_bearing.phase == "measured",
        past=build_past(configuration, objective),
        joint=build_joint(configuration, objective, tracker),
        hypotheses=build_hypotheses(configuration, tracker),
        path=build_path(configuration, objective, tracker),
        others=others,
    )
    planned.rehearse()
    strategy: PlannedMotion | CrossFirst = planned
    if section.startup_deviation > 0.0:
        strategy = _crossing_first(configuration, planned, vehicle, _own_side(configuration, others))
    return strategy if current is None else InWater(strategy, current, configuration.forecast_period)


def _own_side(configuration: Configuration, others: OtherVehicles | None) -> OwnSide | None:
    """The own side of a vehicle beside others, where they are to keep apart."""
    distance, standoff = configuration.limits.separation_m, configuration.standoff
    if others is None or distance is None:
        return None
    return OwnSide(others.sides, 0.0 if standoff is None else min(0.5 * distance / standoff, 1.0))


def _crossing_first(
    configuration: Configuration, planned: PlannedMotion, vehicle: Vehicle, side: OwnSide | None
) -> CrossFirst:
    section, kept = cast(PlannerGuidanceSection, configuration.guidance), configuration.limits.range
    return CrossFirst(
        planned,
        vehicle,
        configuration.period_s,
        axis=configuration.desired_bearing.axis or (0.0, 0.0, 1.0),
        deviation=section.startup_deviation,
        speed=section.startup_speed,
        opening=section.startup_opening,
        leg=section.startup_leg_s,
        nearest=0.0 if kept is None else kept.nearest_kept or 0.0,
        limits=SteeringLimits(
            slowest=configuration.limits.speed_min or 0.0,
            radius=configuration.limits.turn_radius_m or 0.0,
            rate=configuration.limits.input_rate,
        ),
        side=side,
    )


def build_loop(configuration: Configuration) -> tuple[ClosedLoop, Array]:
    """The closed loop of a configuration with one vehicle, and where it starts ``(L, n)``.

    Raises
    ------
    ValueError
        If there are several vehicles, or the parts do not go together.
    """
    if configuration.vehicles:
        count = len(configuration.vehicles)
        raise ValueError(f"vehicles: found {count}; allowed: none here, several only with run, sweep and check")
    streams = Streams.of(configuration.seed)
    target = build_target(configuration, streams.target)
    start = build_start(configuration, build_vehicle(configuration), streams.start, target.position(0.0))
    return build_member(configuration, streams, target, start), start


def build_member(
    configuration: Configuration,
    streams: Streams,
    target: Target,
    start: Array,
    exchange: Exchange | None = None,
    others: OtherVehicles | None = None,
) -> ClosedLoop:
    """The closed loop of one vehicle.

    Parameters
    ----------
    configuration
        With its own section ``vehicle``.
    streams
        Of its random draws.
    target
        What it tracks.
    start
        Where it starts ``(L, n)``.
    exchange, others
        How it talks to other vehicles, and what it hears of them, if there are any.
    """
    vehicle = build_vehicle(configuration)
    desired = paced(configuration, build_desired_bearing(configuration, vehicle), vehicle)
    sensor = build_sensor(configuration)
    section = configuration.tracker
    if exchange is not None and getattr(section, "engine", "numpy") == "auto":
        section = section.model_copy(update={"engine": "numpy"})  # the C hears one vehicle alone
    tracker = build_tracker(section, start[0, : configuration.dimension], sensor)
    return ClosedLoop(
        target=target,
        sensor=sensor,
        tracker=tracker,
        guidance=build_guidance(configuration, vehicle, desired, streams.guidance, tracker, others),
        vehicle=vehicle,
        desired=desired,
        window=configuration.tracker.window,
        forecast=configuration.tracker.forecast,
        forecast_period=configuration.forecast_period,
        follow=configuration.vehicle.follow,
        bound_delta=getattr(configuration.tracker, "bound_delta", math.nan),
        rng=streams.sensor,
        plant=build_plant(configuration, vehicle, streams.plant),
        sensors=build_sensors(configuration, streams.sensor),
        follow_bandwidth=configuration.vehicle.follow_bandwidth or BANDWIDTH,
        autopilot=configuration.plant.autopilot_s if configuration.command == "setpoint" else None,
        lead=configuration.setpoint_lead,
        input_rate=configuration.limits.input_rate,
        exchange=exchange,
        thrust_lag=getattr(configuration.vehicle, "thrust_lag_s", None),
    )
