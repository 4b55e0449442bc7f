"""What a configuration file may say: pydantic models of the YAML, one class a section.

The models are strict (a boolean or a string is not a number), frozen, and carry for every key its meaning with units
and what is allowed; the faults and the JSON schema are written from there. Sizes that depend on the dimension d of the
problem are checked against the validation context ``{"d": d, "n": n}``, so the door is
:func:`gbt_ocp.experiments.loading.load_config`, which knows the problem.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Discriminator,
    Field,
    Tag,
    ValidationInfo,
)

from gbt_ocp.experiments import catalogue, dialect
from gbt_ocp.experiments.problem import TrackingProblem

TRACKERS = {"gp": "Gaussian process on a window of pseudo-linear bearings (paper, section 3)"}
"""Estimators that exist, by ``tracker.kind``."""

GUIDANCE_LAWS = {
    "planner": "follows the planned trajectory (paper, section 4)",
    "static": "stays where it is (paper, section 5.3, mode 1)",
    "constant_force": "constant body thrust (paper, section 5.3, mode 2)",
    "random": "random body thrust (paper, section 5.3, mode 3)",
}
"""Observer strategies that exist, by ``guidance.kind``."""

SOLVERS = {
    "auto": "compiled where a C compiler is found, ipopt otherwise",
    "compiled": "interior point in C99, generated for the problem",
    "ipopt": "interior point (IPOPT through CasADi), the reference",
}
"""Values of ``planner.solver``."""


def _key(default: Any, meaning: str, allowed: str, **bounds: Any) -> Any:
    """Declare a key; ``{d}`` and ``{n}`` in `allowed` stand for the sizes of the problem."""
    return Field(default, description=meaning, json_schema_extra={"allowed": allowed}, **bounds)


def _tuples(value: Any) -> Any:
    return tuple(_tuples(item) for item in value) if isinstance(value, list | tuple) else value


def _sized(size: str) -> AfterValidator:
    def check(value: tuple[float, ...], info: ValidationInfo) -> tuple[float, ...]:
        wanted = (info.context or {}).get(size)
        if wanted is not None and len(value) != wanted:
            raise ValueError(f"{wanted} numbers")
        return value

    return AfterValidator(check)


def _covariance(value: tuple[tuple[float, ...], ...], info: ValidationInfo) -> tuple[tuple[float, ...], ...]:
    size = (info.context or {}).get("d", len(value))
    if len(value) != size or any(len(row) != size for row in value):
        raise ValueError("square")
    matrix = np.array(value)
    if not np.allclose(matrix, matrix.T, rtol=1e-9, atol=0.0) or np.any(np.linalg.eigvalsh(matrix) <= 0.0):
        raise ValueError("symmetric positive definite")
    return value


def _above_minus_d(value: float, info: ValidationInfo) -> float:
    if value <= -(info.context or {}).get("d", 3):
        raise ValueError("κ > -d")
    return value


def _inertia_positive(added_mass: tuple[float, ...], info: ValidationInfo) -> tuple[float, ...]:
    # A missing coefficient is a fault of its own key.
    mass, inertia = info.data.get("mass", math.inf), info.data.get("inertia", math.inf)
    if any(mass - added <= 0.0 for added in added_mass[:-1]) or inertia - added_mass[-1] <= 0.0:
        raise ValueError("M is not positive")
    return added_mass


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


Positive = Annotated[float, Field(gt=0.0)]
NotNegative = Annotated[float, Field(ge=0.0)]
Numbers = Annotated[tuple[float, ...], BeforeValidator(_tuples)]
PositionNumbers = Annotated[Numbers, _sized("d")]
InputNumbers = Annotated[Numbers, _sized("n")]
PositiveInputNumbers = Annotated[tuple[Positive, ...], BeforeValidator(_tuples), _sized("n")]
NotNegativeInputNumbers = Annotated[tuple[NotNegative, ...], BeforeValidator(_tuples), _sized("n")]
Covariance = Annotated[tuple[tuple[float, ...], ...], BeforeValidator(_tuples), AfterValidator(_covariance)]
Direction = Annotated[tuple[float, float, float], BeforeValidator(_tuples), AfterValidator(_direction)]


class Section(BaseModel):
    """What all sections share: strict types, finite numbers, no unknown keys, frozen."""

    model_config = ConfigDict(strict=True, frozen=True, extra="forbid", allow_inf_nan=False)


class CaseTarget(Section):
    """One of the paper's motions (section 5.2)."""

    kind: Literal["case1", "case2", "case4", "case5"] = Field(description="Case of the paper.")


class ManoeuvreTarget(Section):
    """The circling motions of the paper, with abrupt manoeuvres on request (section 5.6, scenario 5)."""

    kind: Literal["case3", "case6"] = Field(description="Case of the paper.")
    turn_rate_step: float = _key(0.0, "Jump of the turn rate in rad/s.", "a number >= 0", ge=0.0)
    every_s: float = _key(10.0, "Time between jumps in s.", "a number > 0", gt=0.0)


class TrackTarget(Section):
    """A recorded track."""

    kind: Literal["track"] = Field(description="A recorded track.")
    path: str = Field(
        description="CSV file with columns t,x,y[,z] (s, m), relative to the YAML file or else to the current folder.",
        json_schema_extra={"allowed": "an existing CSV file with the columns t,x,y (z in space)"},
        min_length=1,
    )
    length_scale: float = _key(1.0, "Factor on lengths.", "a number > 0", gt=0.0)
    time_scale: float = _key(1.0, "Factor on times; above 1 is slower.", "a number > 0", gt=0.0)
    start_m: PositionNumbers | None = _key(
        None, "Where the first point used is put, in m; null keeps the scaled coordinates.", "null, or {d} numbers"
    )
    start_time_s: float = _key(0.0, "Recorded time skipped, in s.", "a number >= 0", ge=0.0)


class ProblemTarget(Section):
    """The target that the problem module makes."""

    kind: Literal["problem"] = Field(description="The problem module's own target.")


class Sensor(Section):
    """The bearing sensor (section 5.6)."""

    period_s: float = _key(0.1, "T, sampling period in s.", "a number > 0", gt=0.0)
    noise_deg: float = _key(0.0, "Standard deviation of the bearing noise in degrees.", "a number >= 0", ge=0.0)
    missed_probability: float = _key(0.0, "Probability that a bearing is missed.", "a number in [0, 1)", ge=0.0, lt=1.0)
    outlier_deg: float = _key(0.0, "Size of a sporadic outlier in degrees.", "a number >= 0", ge=0.0)
    outlier_every_s: float = _key(10.0, "Time between outliers in s.", "a number > 0", gt=0.0)


class Prior(Section):
    """What is known of the target's position before the first bearing."""

    position: PositionNumbers = Field(
        description="Expected position in m.", json_schema_extra={"allowed": "{d} numbers"}
    )
    std: float | None = _key(
        None, "Standard deviation on each axis in m.", "a number > 0, or null beside covariance", gt=0.0
    )
    covariance: Covariance | None = _key(
        None,
        "Covariance in m^2, instead of std.",
        "a symmetric positive definite {d} x {d} matrix, or null beside std",
    )


class Tracker(Section):
    """The Gaussian-process tracker."""

    kind: Literal["gp"] = _key("gp", "Estimator of the target's motion.", "gp")
    window: int = _key(20, "N_c, bearings kept (default 12 in space).", "a whole number >= 2", ge=2)
    forecast: int = _key(11, "n, sampling periods predicted ahead.", "a whole number >= 1", ge=1)
    kernel: Literal["se", "matern32", "matern52", "rq"] = _key(
        "se", "Kernel of the process.", "se, matern32, matern52, rq"
    )
    centre: Literal["origin", "vehicle"] = _key("vehicle", "Where the prior mean lies.", "origin, vehicle")
    amplitude: Literal["tuned"] | Positive = _key(
        "tuned", "Prior standard deviation in m, tuned on the window or fixed.", "tuned, or a number > 0"
    )
    length_scale: Literal["tuned"] | Positive = _key(
        "tuned", "Length scale in s, tuned on the window or fixed.", "tuned, or a number > 0"
    )
    nugget: Literal["tuned"] | Positive = _key(
        "tuned",
        "Variance of a measurement relative to the amplitude squared, tuned on the window or fixed.",
        "tuned, or a number > 0",
    )
    prior: Prior | None = _key(
        None, "Prior knowledge of the position.", "null, or a mapping with position and one of std, covariance"
    )
    bound_delta: float = _key(0.05, "δ, probability that the error bound fails.", "a number in (0, 1]", gt=0.0, le=1.0)


class PlannerGuidance(Section):
    """The vehicle follows the planned trajectory."""

    kind: Literal["planner"] = Field(description="Trajectory optimisation.")


class StaticGuidance(Section):
    """The vehicle stays where it is (section 5.3, mode 1)."""

    kind: Literal["static"] = Field(description="No thrust.")


class ConstantForceGuidance(Section):
    """Constant thrust (section 5.3, mode 2)."""

    kind: Literal["constant_force"] = Field(description="Constant body thrust.")
    force: InputNumbers = Field(
        description="Thrust in N on each axis, then the yaw moment in N m (default 500 N, no moment).",
        json_schema_extra={"allowed": "{n} numbers"},
    )


class RandomGuidance(Section):
    """Random thrust within the limits (section 5.3, mode 3)."""

    kind: Literal["random"] = Field(description="Random body thrust.")
    hold_s: float = _key(1.0, "Time each draw is held in s.", "a number > 0", gt=0.0)


class Planner(Section):
    """The trajectory optimisation."""

    pieces: int = _key(
        5, "p, pieces of one sampling period each.", "a whole number from 1 to tracker.forecast (p <= n)", ge=1
    )
    degree: int = _key(2, "Degree of the pieces.", "a whole number from 2 to 5", ge=2, le=5)
    formulation: Literal["penalty", "hard"] = _key(
        "penalty", "Thrust limits as the paper's penalty or as constraints.", "penalty, hard"
    )
    nodes: int = _key(4, "n_c, intervals a piece at which limits are imposed.", "a whole number >= 1", ge=1)
    gamma: float = _key(0.98, "γ, share of the limit that the solver is held to.", "a number in (0, 1]", gt=0.0, le=1.0)
    width: float = _key(0.01, "ϖ, width of the penalty's smoothing, in thrust_units.", "a number > 0", gt=0.0)
    weight: float = _key(1000.0, "w_p, weight of the penalty.", "a number > 0", gt=0.0)
    thrust_units: Literal["normalised", "newton"] = _key(
        "normalised", "Unit of the penalised thrust: the limit, or N and N m.", "normalised, newton"
    )
    kappa: Annotated[float, AfterValidator(_above_minus_d)] = _key(
        1.0, "κ, spread of the sigma points.", "a number > -{d} (κ > -d)"
    )
    range_pull: float = _key(0.2, "Weight of the pull towards the target; 0 in preset paper.", "a number >= 0", ge=0.0)
    range_reference_m: float = _key(1.0, "Range in m below which the pull fades.", "a number > 0", gt=0.0)
    solver: Literal["auto", "compiled", "ipopt"] = _key("auto", "Solver of the NLP.", "auto, compiled, ipopt")
    solver_options: Annotated[dict[str, Any], AfterValidator(_plain_options)] = _key(
        {}, "Options handed to the solver.", "a mapping of option names to finite numbers, strings, booleans or lists"
    )


class DesiredBearing(Section):
    """How the desired bearings turn: one turn in m sampling periods, or in a time."""

    m: int | None = _key(
        None,
        "Desired bearings a turn (default 10, 4 in space).",
        "a whole number >= 1, or null beside period_s",
        ge=1,
    )
    period_s: float | None = _key(None, "Time of a turn in s, instead of m.", "a number > 0, or null beside m", gt=0.0)
    axis: Direction | None = _key(
        None, "Axis of the turn, in space only (default [0, 0, 1]).", "3 numbers that are not all zero"
    )


class VehicleParameters(Section):
    """Coefficients of a Fossen model; sequences over surge, sway, (heave,) yaw."""

    mass: float = Field(description="m in kg.", gt=0.0, json_schema_extra={"allowed": "a number > 0"})
    inertia: float = Field(
        description="I about the vertical in kg m^2.", gt=0.0, json_schema_extra={"allowed": "a number > 0"}
    )
    added_mass: Annotated[InputNumbers, AfterValidator(_inertia_positive)] = Field(
        description="Added mass with Fossen's (negative) sign in kg, kg m^2 in yaw.",
        json_schema_extra={"allowed": "{n} numbers, with mass (inertia in yaw) minus each of them > 0"},
    )
    linear_drag: NotNegativeInputNumbers = Field(
        description="Linear drag in N s/m, N m s in yaw.", json_schema_extra={"allowed": "{n} numbers >= 0"}
    )
    quadratic_drag: NotNegativeInputNumbers = Field(
        description="Quadratic drag in N s^2/m^2, N m s^2 in yaw.", json_schema_extra={"allowed": "{n} numbers >= 0"}
    )


def _own_or_named(value: Any) -> str:
    return "own" if isinstance(value, Mapping | VehicleParameters) else "named"


class Start(Section):
    """Where the vehicle starts, at rest."""

    position_m: PositionNumbers | None = _key(
        None, "Position in m; null draws it uniformly from the box.", "null, or {d} numbers"
    )
    box_m: float = _key(5.0, "Half side of the box around the origin in m.", "a number >= 0", ge=0.0)
    yaw_deg: float = _key(0.0, "Yaw in degrees, counter-clockwise from +x.", "a number")


class FossenVehicle(Section):
    """A Fossen model, 3-DOF in the plane and 4-DOF in space."""

    kind: Literal["fossen"] = Field(description="Fossen's equations.")
    parameters: Annotated[
        Annotated[Literal["falcon"], Tag("named")] | Annotated[VehicleParameters, Tag("own")],
        Discriminator(_own_or_named),
    ] = _key(
        "falcon",
        "Coefficients.",
        "falcon, or a mapping with mass, inertia, added_mass, linear_drag, quadratic_drag",
    )
    thrust_max: PositiveInputNumbers = _key(
        (5000.0, 5000.0, 1500.0),
        "τ_max: N on each axis, then the yaw moment in N m (default 5000 N and 1500 N m).",
        "{n} numbers > 0",
    )
    start: Start = Field(default_factory=Start, description="Initial state.")
    follow: Literal["exact", "dynamics"] = _key(
        "exact", "Follow the flat output exactly, or integrate the model under the planned thrust.", "exact, dynamics"
    )


class ProblemVehicle(Section):
    """The vehicle that the problem module makes."""

    kind: Literal["problem"] = Field(description="The problem module's own vehicle.")
    start: Start = Field(default_factory=Start, description="Initial state.")
    follow: Literal["exact", "dynamics"] = _key(
        "exact", "Follow the flat output exactly, or integrate the model under the planned thrust.", "exact, dynamics"
    )


class Configuration(Section):
    """A checked experiment with every default filled in; made by :func:`gbt_ocp.load_config`."""

    name: str = _key(
        "run", "Name of the run.", "letters, digits, dots, dashes and underscores", pattern=r"^[\w-][\w.-]*$"
    )
    problem: str = _key("case2", "A shipped problem, or a path to a Python file.", "a name, or a path to a .py file")
    preset: Literal["default", "paper"] = _key("default", "Fills what is not written.", "default, paper")
    seed: int = _key(0, "Seed of every random draw.", "a whole number >= 0", ge=0)
    duration_s: float = _key(30.0, "Length of the run in s.", "a number of at least two sampling periods", gt=0.0)
    target: CaseTarget | ManoeuvreTarget | TrackTarget | ProblemTarget = Field(
        discriminator="kind", description="The target's motion (default: the problem's)."
    )
    sensor: Sensor = Field(default_factory=Sensor, description="The bearing sensor.")
    tracker: Tracker = Field(default_factory=Tracker, description="The estimator.")
    guidance: PlannerGuidance | StaticGuidance | ConstantForceGuidance | RandomGuidance = Field(
        default_factory=lambda: PlannerGuidance(kind="planner"),
        discriminator="kind",
        description="How the vehicle moves.",
    )
    planner: Planner = Field(default_factory=Planner, description="How the trajectory is optimised.")
    desired_bearing: DesiredBearing = Field(default_factory=DesiredBearing, description="How desired bearings turn.")
    vehicle: FossenVehicle | ProblemVehicle = Field(
        default_factory=lambda: FossenVehicle(kind="fossen"), discriminator="kind", description="The vehicle."
    )

    @property
    def problem_object(self) -> TrackingProblem:
        """The problem module's ``problem``; looked up when asked for, so that the configuration pickles."""
        return catalogue.load_problem(self.problem)

    @property
    def dimension(self) -> int:
        """d, the dimension of the space."""
        return self.problem_object.dimension

    def to_mapping(self) -> dict[str, Any]:
        """The resolved configuration as plain lists, mappings and numbers: every default written out."""
        return self.model_dump(mode="json")

    def to_yaml(self) -> str:
        """The resolved configuration as a file; loading it again gives an equal configuration."""
        return dialect.dump(self.to_mapping())


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
