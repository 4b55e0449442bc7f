"""From ``planner.objective`` to a term of the trajectory problem, and what it needs beside a forecast."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import cast

from numpy.typing import ArrayLike

from gbt_ocp.experiments.config.schema import Configuration
from gbt_ocp.experiments.config.sensor import SensorSection
from gbt_ocp.guidance.information import Criterion, FisherInformation, NearInformation
from gbt_ocp.guidance.objectives import BearingSimilarity
from gbt_ocp.guidance.past import PastBearings
from gbt_ocp.guidance.path_information import MotionCriterion, MotionInformation, PosteriorVariance, stage_ends
from gbt_ocp.models.contracts import made
from gbt_ocp.ocp import AnyObjective, Objective
from gbt_ocp.tracking.path_belief import PathBelief, PathForecast
from gbt_ocp.tracking.protocol import (
    JointForecast,
    JointlyGaussian,
    KeepsHypotheses,
    PositionTracker,
    Tracker,
    WeighedForecasts,
)

LEAST_NOISE_DEG = 0.1
"""Standard deviation of a bearing in degrees that a plan reckons with where the sensor has none."""


def build_objective(configuration: Configuration) -> AnyObjective:
    """What the plan maximises: the problem's own objective, or the one that is asked for."""
    section, d = configuration.planner, configuration.dimension
    own = configuration.problem_object.objective
    if own is not None:
        return cast(Objective, made("objective", own))
    if section.objective == "similarity":
        return BearingSimilarity(d, section.kappa, section.similarity == "axial")
    if section.objective == "fisher_trace":
        return NearInformation(d, section.range_reference_m)
    if section.objective == "posterior_variance":
        return PosteriorVariance(d, section.pieces)
    if section.objective.startswith("motion_"):
        of_motion = cast(MotionCriterion, section.objective.removeprefix("motion_"))
        return MotionInformation(d, section.pieces, of_motion, min(section.stages, section.pieces))
    criterion = cast(Criterion, section.objective.removeprefix("fisher_"))
    return FisherInformation(d, criterion, section.range_reference_m)


def build_past(configuration: Configuration, objective: AnyObjective) -> PastBearings | None:
    """Where the window's bearings are kept, for an objective that counts them."""
    if not isinstance(objective, FisherInformation):
        return None
    period = configuration.period_s
    span = getattr(configuration.tracker, "window_s", None) or (configuration.tracker.window - 1) * period
    share = period / (configuration.planner.period_s or period)
    return PastBearings(configuration.dimension, span, share, objective.weight)


def build_joint(
    configuration: Configuration, objective: AnyObjective, tracker: Tracker | PositionTracker | None
) -> Callable[[ArrayLike], JointForecast] | None:
    """Where the covariance of several positions comes from, for an objective that needs it.

    Raises
    ------
    ValueError
        If the tracker is not one Gaussian process.
    """
    if not isinstance(objective, PosteriorVariance):
        return None
    if not isinstance(tracker, JointlyGaussian):
        raise ValueError(
            "planner.objective: found posterior_variance; allowed: beside tracker.kind gp or lmc, one Gaussian process "
            f"whose posterior does not depend on what is measured, found {configuration.tracker.kind}"
        )
    return tracker.joint


def build_path(
    configuration: Configuration, objective: AnyObjective, tracker: Tracker | PositionTracker | None
) -> PathForecast | None:
    """Where the covariance of the target's path comes from, for an objective that needs it.

    The bearings of a piece count together, those expected to be missed left out, with the noise that the tracker
    reckons with, and at least :data:`LEAST_NOISE_DEG`.
    """
    if not isinstance(objective, MotionInformation) or tracker is None:
        return None
    noise = getattr(configuration.tracker, "noise", None)
    assumed = (getattr(noise, "std_deg", None), getattr(configuration.tracker, "bearing_std_deg", None))
    deviation = max(LEAST_NOISE_DEG, configuration.bearing_noise_deg, *(found or 0.0 for found in assumed))
    variance = math.radians(deviation) ** 2 / bearings_a_piece(configuration)
    stages = stage_ends(objective.pieces, objective.stages)
    return PathBelief(tracker, variance, configuration.planner.ahead_s, stages)


def bearings_a_piece(configuration: Configuration) -> float:
    """How many bearings are expected over a piece of a plan."""
    sensors = [configuration.sensor] if isinstance(configuration.sensor, SensorSection) else configuration.sensor
    period = configuration.planner.period_s or configuration.period_s
    seen = [
        (1.0 - one.missed_probability) * period / one.period_s
        for one in sensors
        if isinstance(one, SensorSection) or one.gives_bearings
    ]
    return max(sum(seen), 1.0)


def build_hypotheses(
    configuration: Configuration, tracker: Tracker | PositionTracker | None
) -> Callable[[ArrayLike], WeighedForecasts] | None:
    """Where the tracker's hypotheses come from, for a standoff that is kept to each of them.

    Raises
    ------
    ValueError
        If the tracker keeps none.
    """
    range_ = configuration.limits.range
    if range_ is None or range_.hypothesis_probability is None:
        return None
    if not isinstance(tracker, KeepsHypotheses):
        raise ValueError(
            f"limits.range.hypothesis_probability: found {range_.hypothesis_probability:g} beside tracker.kind "
            f"{configuration.tracker.kind}, which keeps no hypotheses; allowed: null, or motion_gp or mixture"
        )
    return tracker.hypotheses_at
