"""The kinds of trackers, each with its section of the configuration and the function that builds it from there.

The command line and the checks of a configuration read the names and sections. No tracker is imported for that.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeAlias, get_args

from gbt_ocp.experiments.config import tracker as sections
from gbt_ocp.experiments.config.tracker import TrackerSection

if TYPE_CHECKING:
    from gbt_ocp.models.sensors import BearingSensor
    from gbt_ocp.tracking.priors import PositionPrior
    from gbt_ocp.tracking.protocol import PositionTracker, Tracker

BEARINGS_ALONE = ("azimuth", "azimuth_elevation")
ALL = ("azimuth", "azimuth_elevation", "elevation", "range", "size", "position")
"""Kinds of measurements; angular sizes are taken where the key ``size`` says what is known of the true one."""

Builder: TypeAlias = "Callable[[Any, PositionPrior, BearingSensor], Tracker | PositionTracker]"
"""From a section, the prior position and the sensor to an estimator."""


@dataclass(frozen=True)
class TrackerKind:
    """One value of ``tracker.kind``.

    Parameters
    ----------
    section
        The keys: a class below :class:`~gbt_ocp.experiments.config.tracker.TrackerSection` whose ``kind`` is
        ``Literal[NAME]``.
    build
        Called with a section, a :class:`~gbt_ocp.tracking.PositionPrior` (the vehicle's first position, and what the
        key ``prior`` says), and the :class:`~gbt_ocp.models.BearingSensor`; returns the tracker.
    says
        One line for ``gbt-ocp list``.
    family
        A class that ``section`` is or descends from. Where the kind changes to another of the same family in a stronger
        layer of a configuration, the keys of this class keep their values; otherwise those of ``TrackerSection`` do.
    takes
        Kinds of measurements that the tracker takes.

    Raises
    ------
    ValueError
        If the section names no kind, or does not belong to the family.
    """

    section: type[TrackerSection]
    build: Builder
    says: str
    family: type[TrackerSection] = TrackerSection
    takes: tuple[str, ...] = BEARINGS_ALONE

    def __post_init__(self) -> None:
        if len(get_args(self.section.model_fields["kind"].annotation)) != 1:
            raise ValueError(f"section: found {self.section.__name__} without a kind; allowed: a kind: Literal[NAME]")
        if not issubclass(self.section, self.family):
            raise ValueError(f"family: found {self.family.__name__}; allowed: a class above {self.section.__name__}")

    @property
    def name(self) -> str:
        """The value of ``tracker.kind``."""
        return str(get_args(self.section.model_fields["kind"].annotation)[0])


def kept_keys(old: TrackerKind | None, new: TrackerKind | None) -> set[str]:
    """Keys that keep their values when a kind replaces another; ``None`` is a kind that does not exist."""
    same = old is not None and new is not None and old.family is new.family
    family = new.family if same and new is not None else TrackerSection
    return {*family.model_fields} - {"kind"}


def _builder(name: str) -> Builder:
    """The function of a name in :mod:`gbt_ocp.experiments.build.estimators`, which is imported at its first call."""

    def build(section: Any, prior: PositionPrior, sensor: BearingSensor) -> Tracker | PositionTracker:
        from gbt_ocp.experiments.build import estimators

        built: Tracker | PositionTracker = getattr(estimators, name)(section, prior, sensor)
        return built

    return build


TRACKERS = {
    kind.name: kind
    for kind in (
        TrackerKind(
            sections.GaussianProcessSection,
            _builder("gaussian_process"),
            "Gaussian process on a window of pseudo-linear bearings (paper, section 3)",
            sections.ProcessSection,
            ALL,
        ),
        TrackerKind(
            sections.CoregionalizedSection,
            _builder("coregionalized"),
            "Gaussian process whose axes move together: linear model of coregionalization (section 3.3)",
            sections.ProcessSection,
        ),
        TrackerKind(
            sections.MotionSection,
            _builder("motion"),
            "Gaussian process on turn rate and log speed, for noisy bearings and unknown range",
            sections.ShapeSection,
            ALL,
        ),
        TrackerKind(
            sections.MixtureSection,
            _builder("mixture"),
            "held turn rates and interacting models, weighed by how well each foretold the bearings of late",
            sections.ShapeSection,
            ALL,
        ),
        TrackerKind(
            sections.HeldTurnSection,
            _builder("held_turn"),
            "turn rates that are held and drawn again, in log-polar coordinates, for noisy bearings and unknown range",
            takes=ALL,
        ),
        TrackerKind(
            sections.OrthogonalityStaticSection,
            _builder("orthogonality_static"),
            "orthogonality-based estimator of a static target",
        ),
        TrackerKind(
            sections.OrthogonalityVelocitySection,
            _builder("orthogonality_velocity"),
            "orthogonality-based estimator of a target with constant velocity",
        ),
        TrackerKind(sections.PseudoLinearSection, _builder("pseudo_linear"), "pseudo-linear Kalman filter"),
        TrackerKind(
            sections.InteractingPseudoLinearSection,
            _builder("imm_pseudo_linear"),
            "interacting multiple models with pseudo-linear updates",
        ),
        TrackerKind(
            sections.ExtendedKalmanSection,
            _builder("extended"),
            "extended Kalman filter, constant velocity",
            takes=ALL,
        ),
        TrackerKind(
            sections.InteractingExtendedSection,
            _builder("imm_extended"),
            "interacting multiple models with extended updates",
            takes=ALL,
        ),
        TrackerKind(
            sections.InteractingPositionSection,
            _builder("imm_position"),
            "interacting multiple models that see the target's full position",
            takes=("position",),
        ),
        TrackerKind(sections.PolynomialSection, _builder("polynomial"), "polynomial regression on the window"),
    )
}
"""Kinds of trackers by their names; :func:`~gbt_ocp.experiments.config.schema.register_tracker` adds one."""
