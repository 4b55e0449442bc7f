"""What a configuration file may hold: the sections together, checked by pydantic.

A section stands in a module of its name. The models are strict (a boolean or a string is not a number) and frozen. They
carry for every key its meaning with units and what is allowed, from which faults, the table in docs/configuration.md
and the JSON schema are written. Sizes that depend on the dimension d of the problem are checked against the validation
context ``{"d": d, "n": n}``: load a configuration with :func:`gbt_ocp.experiments.config.loading.load_config`, which
knows the problem.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from typing import TYPE_CHECKING, Annotated, Any, Literal, Union

from pydantic import BeforeValidator, Field
from pydantic.fields import FieldInfo

from gbt_ocp.experiments.build.tracker_kinds import TRACKERS, TrackerKind
from gbt_ocp.experiments.config import catalogue
from gbt_ocp.experiments.config import yaml_dialect as dialect
from gbt_ocp.experiments.config.allowed import holds_texts
from gbt_ocp.experiments.config.desired_bearing import DesiredBearingSection
from gbt_ocp.experiments.config.guidance import AnyGuidance, PlannerGuidanceSection
from gbt_ocp.experiments.config.keys import Section, as_tuples, key, kinds_in, sections_in
from gbt_ocp.experiments.config.limits import LimitsSection, RangeLimitSection
from gbt_ocp.experiments.config.pilot import PilotSection
from gbt_ocp.experiments.config.planner import PlannerSection
from gbt_ocp.experiments.config.plant import PlantSection
from gbt_ocp.experiments.config.replay import ReplaySection
from gbt_ocp.experiments.config.sensor import SENSOR_ALLOWED, AnySensor, SensorSection
from gbt_ocp.experiments.config.target import AnyTarget
from gbt_ocp.experiments.config.team import LinkSection, TeamVehicleSection
from gbt_ocp.experiments.config.tracker import GaussianProcessSection, TrackerSection
from gbt_ocp.experiments.config.tracking_problem import TrackingProblem
from gbt_ocp.experiments.config.vehicle import AnyVehicle, FossenVehicleSection


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
    preset: Literal["default", "paper"] = key("default", "Fills what is not written.")
    seed: int = key(0, "Seed of every random draw.", ge=0)
    duration_s: float = key(30.0, "Length of the run in s.", "a number of at least two sampling periods", gt=0.0)
    target: AnyTarget = Field(description="The target's motion (default: the problem's).")
    sensor: AnySensor = Field(
        default_factory=SensorSection,
        description="The bearing sensor, or a list of sensors.",
        json_schema_extra={"allowed": SENSOR_ALLOWED},
    )
    tracker: AnyTracker = Field(
        default_factory=lambda: GaussianProcessSection(kind="gp"),
        discriminator="kind",
        description="How the target's motion is estimated.",
    )
    guidance: AnyGuidance = Field(
        default_factory=lambda: PlannerGuidanceSection(kind="planner"), description="How the vehicle moves."
    )
    planner: PlannerSection = Field(
        default_factory=PlannerSection, description="How the trajectory is optimised, for guidance.kind: planner."
    )
    limits: LimitsSection = Field(
        default_factory=LimitsSection, description="Limits besides thrust, which plans keep (guidance.kind: planner)."
    )
    desired_bearing: DesiredBearingSection = Field(
        default_factory=DesiredBearingSection, description="How desired bearings turn."
    )
    vehicle: AnyVehicle = Field(default_factory=lambda: FossenVehicleSection(kind="fossen"), description="The vehicle.")
    vehicles: Annotated[tuple[TeamVehicleSection, ...], BeforeValidator(as_tuples)] = key(
        (),
        "Several vehicles with the same target, the first of which a run is about; none is one alone.",
        "a list of mappings with a name each, at least two of them, or none",
    )
    link: LinkSection = Field(default_factory=LinkSection, description="How several vehicles talk.")
    command: Literal["thrust", "setpoint"] = key(
        "thrust",
        "What the vehicle is given: thrust, or setpoints for an autopilot of its own (velocity, heading, depth), of "
        "which plant.autopilot_s is the model.",
    )
    plant: PlantSection = Field(
        default_factory=PlantSection, description="How the vehicle that moves differs from its model."
    )
    pilot: PilotSection = Field(
        default_factory=PilotSection, description="What a pilot does with inputs that come late, or not at all."
    )
    replay: ReplaySection = Field(default_factory=ReplaySection, description="How gbt-ocp replay reads a log.")

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle as a mapping: the class of a registered tracker's section need not be importable where it is read."""
        return _unpickled, (self.model_dump(),)

    @property
    def problem_object(self) -> TrackingProblem:
        """The problem module's ``problem``; looked up at each access, so that the configuration can be pickled."""
        return catalogue.load_problem(self.problem)

    @property
    def setpoint_lead(self) -> float | None:
        """How far ahead on the plan setpoints are taken, in s; ``None`` for a sampling period."""
        return self.pilot.lead_s or (self.plant.autopilot_s if self.command == "setpoint" else None)

    @property
    def dimension(self) -> int:
        """d, the dimension of the space."""
        return self.problem_object.dimension

    @property
    def steps_a_piece(self) -> int:
        """Sampling periods that a piece of the plan lasts."""
        return round((self.planner.period_s or self.period_s) / self.period_s)

    @property
    def period_s(self) -> float:
        """T, the sampling period of the loop in s: the sensor's, or the shortest of several."""
        if isinstance(self.sensor, SensorSection):
            return self.sensor.period_s
        return min(one.period_s for one in self.sensor)

    @property
    def bearing_noise_deg(self) -> float:
        """Standard deviation of bearings in degrees: the sensor's, or the largest of several; 0 without bearings."""
        if isinstance(self.sensor, SensorSection):
            return self.sensor.noise_deg
        return max((one.noise_deg or 0.0 for one in self.sensor if one.gives_bearings), default=0.0)

    @property
    def standoff(self) -> float | None:
        """Least range to the target in m, ``None`` without one."""
        limit: RangeLimitSection | None = self.limits.range
        return None if limit is None else limit.nearest_m

    @property
    def forecast_period(self) -> float:
        """Time between two predicted positions in s."""
        return self.tracker.forecast_period_s or self.period_s

    @property
    def forecasts_a_piece(self) -> int:
        """Predicted positions that a piece of the plan lasts."""
        return round((self.planner.period_s or self.period_s) / self.forecast_period)

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


def kinds(section: str) -> list[str]:
    """Values of ``kind`` between which a section of the configuration chooses, sorted."""
    return kinds_in(Configuration.model_fields[section].annotation)


def is_text(path: Sequence[str]) -> bool:
    """Whether the key at a path holds a text or a list of texts, in every section that may stand there."""
    sections: list[type[Section]] = [Configuration]
    fields: list[FieldInfo] = []
    for name in path:
        fields = [section.model_fields[name] for section in sections if name in section.model_fields]
        sections = [inner for field in fields for inner in sections_in(field.annotation)]
    return bool(fields) and all(map(holds_texts, fields))
