"""From the section ``tracker`` to an estimator."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from gbt_ocp.experiments import tracker_sections as sections
from gbt_ocp.experiments.configuration import Configuration
from gbt_ocp.tracking.gp import GaussianProcessTracker
from gbt_ocp.tracking.imm import ImmPositionTracker, ImmPseudoLinearTracker, InteractingMultipleModel
from gbt_ocp.tracking.orthogonality import OrthogonalityTracker
from gbt_ocp.tracking.plkf import PseudoLinearKalmanFilter
from gbt_ocp.tracking.polynomial import PolynomialRegression
from gbt_ocp.tracking.prior import PositionPrior
from gbt_ocp.tracking.protocol import PositionTracker, Tracker

Array = NDArray[np.float64]


def build_tracker(configuration: Configuration, start: Array) -> Tracker | PositionTracker:
    """The tracker; ``start`` is the vehicle's first position ``(d,)``."""
    section, dimension = configuration.tracker, configuration.dimension
    position, covariance = prior_of(section, dimension)
    if isinstance(section, sections.BaselineTracker):
        prior = PositionPrior(start, section.initial_range_m, position, covariance)
        return _baseline(section, prior, configuration.sensor.period_s)
    return GaussianProcessTracker(
        dimension,
        window=section.window,
        kernel=section.kernel,
        centre=section.centre,
        length_scale=None if section.length_scale == "tuned" else section.length_scale,
        amplitude=None if section.amplitude == "tuned" else section.amplitude,
        nugget=None if section.nugget == "tuned" else section.nugget,
        prior_position=position,
        prior_covariance=covariance,
        start=start,
    )


def _baseline(section: sections.BaselineTracker, prior: PositionPrior, period: float) -> Tracker | PositionTracker:
    """The methods that the paper compares with."""
    if isinstance(section, sections.OrthogonalityStaticTracker):
        return OrthogonalityTracker(prior, position_gain=section.position_gain)
    if isinstance(section, sections.OrthogonalityVelocityTracker):
        return OrthogonalityTracker(prior, position_gain=section.position_gain, velocity_gain=section.velocity_gain)
    if isinstance(section, sections.PolynomialTracker):
        span = (section.window - 1) * period
        return PolynomialRegression(prior, window=section.window, span=span, order=section.order, ridge=section.ridge)
    if isinstance(section, sections.PseudoLinearKalmanTracker):
        return PseudoLinearKalmanFilter(
            prior,
            initial_variance=section.initial_variance,
            process_noise=section.process_noise,
            bearing_std=math.radians(section.bearing_std_deg),
            bias_compensated=section.bias_compensated,
        )
    if isinstance(section, sections.InteractingPseudoLinearTracker):
        return ImmPseudoLinearTracker(
            prior,
            _models(section),
            bearing_std=math.radians(section.bearing_std_deg),
            initial_variance=section.initial_variance,
        )
    assert isinstance(section, sections.InteractingPositionTracker), "all kinds are built above"
    return ImmPositionTracker(prior, _models(section), position_std=section.position_std_m)


def _models(section: sections.InteractingModelsTracker) -> InteractingMultipleModel:
    return InteractingMultipleModel(
        initial_variance=section.initial_variance,
        process_noise=section.process_noise,
        jerk_noise=section.jerk_noise,
        stay_probability=section.stay_probability,
        turn_rate_max=section.turn_rate_max,
    )


def prior_of(section: sections.TrackerSection, dimension: int) -> tuple[Array | None, Array | None]:
    """Prior position ``(d,)`` in m and its covariance ``(d, d)`` in m², or ``None`` twice."""
    prior = section.prior
    if prior is None:
        return None, None
    if prior.std is not None:
        return np.array(prior.position), prior.std**2 * np.eye(dimension)
    return np.array(prior.position), np.array(prior.covariance)
