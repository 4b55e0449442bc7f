"""What a configuration file may say: pydantic models of the YAML, one class a section.

The models are strict (a boolean or a string is not a number), frozen, and carry for every key its meaning with units
and what is allowed; the faults and the JSON schema are written from there. Sizes that depend on the dimension d of the
problem are checked against the validation context ``{"d": d, "n": n}``, so the door is
:func:`gbt_ocp.experiments.config.loading.load_config`, which knows the problem.
"""

from __future__ import annotations

import math
from contextlib import suppress
from typing import TYPE_CHECKING, Annotated, Any, Literal, Union

from pydantic import AfterValidator, BeforeValidator, Field, ValidationInfo

from gbt_ocp.experiments.build.tracker_kinds import TrackerKind
from gbt_ocp.experiments.build.trackers import TRACKERS
from gbt_ocp.experiments.config import catalogue
from gbt_ocp.experiments.config import yaml_dialect as dialect
from gbt_ocp.experiments.config.guidance import AnyGuidance, PlannerGuidance
from gbt_ocp.experiments.config.keys import (
    Positive,
    Section,
    as_tuples,
    key,
)
from gbt_ocp.experiments.config.limits import Limits
from gbt_ocp.experiments.config.replay import Replay
from gbt_ocp.experiments.config.target import CaseTarget, ManoeuvreTarget, ProblemTarget, TrackTarget, TurningTarget
from gbt_ocp.experiments.config.tracker import GaussianProcessSection, TrackerSection
from gbt_ocp.experiments.config.tracking_problem import TrackingProblem
from gbt_ocp.experiments.config.vehicle import FossenVehicle, ProblemVehicle

SOLVERS = {
    "auto": "compiled where a C compiler is found, ipopt otherwise",
    "compiled": "interior point in C99, generated for the problem",
    "ipopt": "interior point (IPOPT through CasADi), the reference",
}
"""Values of ``planner.solver``."""


def _above_minus_d(value: float, info: ValidationInfo) -> float:
    if value <= -(info.context or {}).get("d", 3):
        raise ValueError("κ > -d")
    return value


def _direction(value: tuple[float, float, float]) -> tuple[float, float, float]:
    if not any(value):
        raise ValueError("zero")
    return value


def _plain_options(value: dict[str, Any]) -> dict[str, Any]:
    for item in value.values():
        if isinstance(item, dict):
            _plain_options(item)
        elif not isinstance(item, str | int | float | list) or (isinstance(item, float) and not math.isfinite(item)):
            raise ValueError("not a plain value")
    return value


Direction = Annotated[tuple[float, float, float], BeforeValidator(as_tuples), AfterValidator(_direction)]


class Sensor(Section):
    """The bearing sensor (section 5.6)."""

    period_s: float = key(0.1, "T, sampling period in s.", "a number > 0", gt=0.0)
    noise_deg: float = key(0.0, "Standard deviation of the bearing noise in degrees.", "a number >= 0", ge=0.0)
    missed_probability: float = key(0.0, "Probability that a bearing is missed.", "a number in [0, 1)", ge=0.0, lt=1.0)
    outlier_deg: float = key(0.0, "Size of a sporadic outlier in degrees.", "a number >= 0", ge=0.0)
    outlier_every_s: float = key(10.0, "Time between outliers in s.", "a number > 0", gt=0.0)
    latency_s: float = key(
        0.0, "Time in s from a measurement to its arrival at the tracker, which knows both.", "a number >= 0", ge=0.0
    )


class Planner(Section):
    """The trajectory optimisation."""

    pieces: int = key(5, "p, pieces of the trajectory.", "a whole number from 1 to tracker.forecast (p <= n)", ge=1)
    degree: int = key(2, "L, degree of the pieces.", "a whole number from 2 to 5", ge=2, le=5)
    continuity: int | None = key(
        None,
        "Derivatives that are continuous between pieces; null is L - 1, the paper's. Fewer leave a piece more freedom.",
        "null, or a whole number from 1 to planner.degree - 1",
        ge=1,
    )
    period_s: float | None = key(
        None,
        "Length of a piece in s, after which the next plan is made; null is one sampling period.",
        "null, or a whole multiple of sensor.period_s",
        gt=0.0,
    )
    formulation: Literal["penalty", "hard"] = key(
        "penalty", "Thrust limits as the paper's penalty or as constraints.", "penalty, hard"
    )
    nodes: int = key(4, "n_c, intervals a piece at which limits are imposed.", "a whole number >= 1", ge=1)
    gamma: float = key(0.98, "γ, share of the limit that the solver is held to.", "a number in (0, 1]", gt=0.0, le=1.0)
    width: float = key(0.01, "ϖ, width of the penalty's smoothing, in thrust_units.", "a number > 0", gt=0.0)
    weight: float = key(1000.0, "w_p, weight of the penalty.", "a number > 0", gt=0.0)
    thrust_units: Literal["normalised", "newton"] = key(
        "normalised", "Unit of the penalised thrust: the limit, or N and N m.", "normalised, newton"
    )
    kappa: Annotated[float, AfterValidator(_above_minus_d)] = key(
        1.0, "κ, spread of the sigma points.", "a number > -{d} (κ > -d)"
    )
    objective: Literal[
        "similarity",
        "fisher_logdet",
        "fisher_trace",
        "fisher_min_eigenvalue",
        "posterior_variance",
        "condition_number",
    ] = key(
        "similarity",
        "What the plan maximises (of the variance and the condition number: minimises); all but similarity and "
        "fisher_trace need IPOPT.",
        "similarity, fisher_logdet, fisher_trace, fisher_min_eigenvalue, posterior_variance, condition_number",
    )
    similarity: Literal["signed", "axial"] = key(
        "signed",
        "Whether a bearing opposite to the desired one counts as the worst, as in the paper, or the same.",
        "signed, axial",
    )
    range_pull: float = key(
        0.2, "Weight of the pull towards the target; 0.02 in preset paper.", "a number >= 0", ge=0.0
    )
    range_reference_m: float = key(1.0, "Range in m below which the pull fades.", "a number > 0", gt=0.0)
    solver: Literal["auto", "compiled", "ipopt"] = key("auto", "Solver of the NLP.", "auto, compiled, ipopt")
    solver_options: Annotated[dict[str, Any], AfterValidator(_plain_options)] = key(
        {},
        "Options handed to the solver; those in a mapping under compiled or ipopt to that solver only.",
        "a mapping of option names to finite numbers, strings, booleans or lists",
    )


class DesiredBearing(Section):
    """How the desired bearings turn: one turn in m sampling periods, or in a time."""

    m: int | None = key(
        None,
        "Desired bearings a turn (default 10, 4 in space).",
        "a whole number >= 1, or null beside period_s",
        ge=1,
    )
    period_s: Positive | Literal["auto"] | None = key(
        None,
        "Time of a turn in s, instead of m; auto, the default beside limits.range.nearest_m, is the vehicle's fastest.",
        "a number > 0, auto, or null beside m",
    )
    speed_mps: Literal["sensor"] | Positive | None = key(
        "sensor",
        "Speed in m/s that going round the target may ask for; farther away the bearing turns more slowly. sensor: "
        "with noisy bearings the speed that the vehicle keeps up, else null. null: never slower.",
        "sensor, null, or a number > 0",
    )
    target_speed: float = key(
        1.0, "Speed of the target in m/s that the vehicle can keep up with while it circles.", "a number >= 0", ge=0.0
    )
    phase: Literal["fixed", "measured"] = key(
        "fixed",
        "Where the turn is: on from the x axis by the clock, or in each plan on from the present line of sight.",
        "fixed, measured",
    )
    axis: Direction | None = key(
        None, "Axis of the turn, in space only (default [0, 0, 1]).", "3 numbers that are not all zero"
    )


def _any_tracker() -> Any:
    """The sections of all kinds of trackers."""
    return Union[tuple(kind.section for kind in TRACKERS.values())]  # noqa: UP007  # made when it is asked for


if TYPE_CHECKING:
    AnyTracker = TrackerSection
else:
    AnyTracker = _any_tracker()


class Configuration(Section):
    """A checked experiment with every default filled in; made by :func:`gbt_ocp.load_config`."""

    name: str = key(
        "run", "Name of the run.", "letters, digits, dots, dashes and underscores", pattern=r"^[\w-][\w.-]*$"
    )
    problem: str = key("case2", "A shipped problem, or a path to a Python file.", "a name, or a path to a .py file")
    preset: Literal["default", "paper"] = key("default", "Fills what is not written.", "default, paper")
    seed: int = key(0, "Seed of every random draw.", "a whole number >= 0", ge=0)
    duration_s: float = key(30.0, "Length of the run in s.", "a number of at least two sampling periods", gt=0.0)
    target: CaseTarget | ManoeuvreTarget | TurningTarget | TrackTarget | ProblemTarget = Field(
        discriminator="kind", description="The target's motion (default: the problem's)."
    )
    sensor: Sensor = Field(default_factory=Sensor, description="The bearing sensor.")
    tracker: AnyTracker = Field(
        default_factory=lambda: GaussianProcessSection(kind="gp"),
        discriminator="kind",
        description="How the target's motion is estimated.",
    )
    guidance: AnyGuidance = Field(
        default_factory=lambda: PlannerGuidance(kind="planner"), description="How the vehicle moves."
    )
    planner: Planner = Field(default_factory=Planner, description="How the trajectory is optimised.")
    limits: Limits = Field(default_factory=Limits, description="Limits besides thrust.")
    desired_bearing: DesiredBearing = Field(default_factory=DesiredBearing, description="How desired bearings turn.")
    vehicle: FossenVehicle | ProblemVehicle = Field(
        default_factory=lambda: FossenVehicle(kind="fossen"), discriminator="kind", description="The vehicle."
    )
    replay: Replay = Field(default_factory=Replay, description="Recorded bearings replayed.")

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle as a mapping: the class of a registered tracker's section need not be importable where it is read."""
        return _unpickled, (self.model_dump(),)

    @property
    def problem_object(self) -> TrackingProblem:
        """The problem module's ``problem``; looked up when asked for, so that the configuration pickles."""
        return catalogue.load_problem(self.problem)

    @property
    def dimension(self) -> int:
        """d, the dimension of the space."""
        return self.problem_object.dimension

    @property
    def steps_a_piece(self) -> int:
        """Sampling periods that a piece of the plan lasts."""
        return round((self.planner.period_s or self.sensor.period_s) / self.sensor.period_s)

    @property
    def standoff(self) -> float | None:
        """Least range to the target in m, ``None`` without one."""
        return self.limits.range.nearest_m if self.limits.range is not None else None

    @property
    def forecast_period(self) -> float:
        """Time between two predicted positions in s."""
        return self.tracker.forecast_period_s or self.sensor.period_s

    @property
    def forecasts_a_piece(self) -> int:
        """Predicted positions that a piece of the plan lasts."""
        return round((self.planner.period_s or self.sensor.period_s) / self.forecast_period)

    def to_mapping(self) -> dict[str, Any]:
        """The resolved configuration as plain lists, mappings and numbers: every default written out."""
        return self.model_dump(mode="json")

    def to_yaml(self) -> str:
        """The resolved configuration as a file; loading it again gives an equal configuration."""
        return dialect.dump(self.to_mapping())


def _unpickled(values: dict[str, Any]) -> Configuration:
    """A configuration from its pickled mapping, in a process that may not have loaded its problem yet."""
    with suppress(catalogue.ProblemError):  # a run says so itself, with all that it needs
        catalogue.load_problem(values["problem"])
    return Configuration.model_validate(values)


def register_tracker(kind: TrackerKind) -> None:
    """Add a kind of tracker, for as long as the program runs.

    ``tracker.kind`` may name it from then on: in YAML files, on the command line, in sweeps and replays. A problem's
    Python file is the place to call it for trackers of one's own.

    Raises
    ------
    ValueError
        If a kind of this package has the name.
    """
    there = TRACKERS.get(kind.name)
    if there is not None and there.section.__module__ == TrackerSection.__module__:
        raise ValueError(f"kind: found {kind.name!r}, which is a kind of this package; allowed: another name")
    TRACKERS[kind.name] = kind
    accept_registered()


def accept_registered() -> None:
    """Have configurations take the kinds of trackers that there are now."""
    Configuration.model_fields["tracker"].annotation = _any_tracker()
    Configuration.model_rebuild(force=True)


def schema() -> dict[str, Any]:
    """JSON schema of a file as a user writes it: every key optional, no others allowed, each with meaning and units."""
    tree = Configuration.model_json_schema()
    tree["title"] = "gbt_ocp configuration"
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **_as_written(tree)}


def _as_written(node: Any) -> Any:
    if isinstance(node, list):
        return [_as_written(item) for item in node]
    if not isinstance(node, dict):
        return node
    # What a problem or a preset fills in need not be written. Without a required kind several branches of a union
    # can hold at once, which oneOf would refuse.
    written = {
        {"oneOf": "anyOf"}.get(key, key): _as_written(value)
        for key, value in node.items()
        if key not in ("required", "discriminator", "allowed")
    }
    if isinstance(node.get("allowed"), str):
        allowed = node["allowed"].replace("{d}", "d").replace("{n}", "n = d + 1")
        written["description"] = f"{node['description']} Allowed: {allowed}."
    return written
