"""From the section ``tracker`` to an estimator."""

from __future__ import annotations

import math

import numpy as np

from gbt_ocp.experiments.config import tracker as sections
from gbt_ocp.experiments.config.noise import Noise, NoisyBearings
from gbt_ocp.experiments.config.schema import Configuration
from gbt_ocp.tracking.displacement.hypotheses import MotionPriors
from gbt_ocp.tracking.displacement.tracker import NoisyGaussianProcessTracker
from gbt_ocp.tracking.filters.ekf import ExtendedKalmanFilter, FirstGuess, ImmExtendedTracker
from gbt_ocp.tracking.filters.imm import ImmPositionTracker, ImmPseudoLinearTracker, InteractingMultipleModel
from gbt_ocp.tracking.filters.orthogonality import OrthogonalityTracker
from gbt_ocp.tracking.filters.plkf import PseudoLinearKalmanFilter
from gbt_ocp.tracking.filters.polynomial import PolynomialRegression
from gbt_ocp.tracking.gp.gp import GaussianProcessTracker
from gbt_ocp.tracking.gp.lmc import CoregionalizedTracker
from gbt_ocp.tracking.mixture import MixtureTracker, velocity_scale
from gbt_ocp.tracking.noise import BearingNoise
from gbt_ocp.tracking.priors import LogNormal, PositionPrior
from gbt_ocp.tracking.protocol import PositionTracker, Tracker
from gbt_ocp.tracking.shape.processes import ShapePrior
from gbt_ocp.tracking.shape.tracker import MotionShapeTracker
from gbt_ocp.typing import Array


def build_tracker(configuration: Configuration, start: Array) -> Tracker | PositionTracker:
    """The tracker; ``start`` is the vehicle's first position ``(d,)``."""
    section, dimension = configuration.tracker, configuration.dimension
    position, covariance = prior_of(section, dimension)
    if isinstance(section, sections.BaselineTracker):
        prior = PositionPrior(start, section.initial_range_m, position, covariance)
        return _baseline(section, prior, configuration.sensor.period_s)
    if isinstance(section, sections.CoregionalizedTracker):
        return CoregionalizedTracker(
            dimension,
            window=section.window,
            kernels=section.kernels,
            centre=section.centre,
            length_scale=None if section.length_scale == "tuned" else section.length_scale,
            nugget=None if section.nugget == "tuned" else section.nugget,
            prior_position=position,
            prior_covariance=covariance,
            start=start,
        )
    if isinstance(section, sections.MixtureTracker):
        return _mixture(section, dimension, start, position, covariance)
    if isinstance(section, sections.ShapeTracker):
        return _motion(section, dimension, start, position, covariance)
    noise = noise_of(section, configuration.sensor.noise_deg)
    if noise is not None:
        return _noisy(noise, configuration, position, covariance, start)
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


def _motion(
    section: sections.ShapeTracker, dimension: int, start: Array, position: Array | None, covariance: Array | None
) -> MotionShapeTracker:
    """The Gaussian process on the shape of the motion."""
    prior = ShapePrior(
        speed=LogNormal(section.speed.median, section.speed.log_std),
        range=LogNormal(section.range.median_m, section.range.log_std),
        kernel=section.turn_kernel,
        turn_stds=section.turn_rate_std,
        turn_times=section.turn_time_s,
        speed_stds=section.speed_change_std,
        speed_time=section.speed_time_s,
    )
    return MotionShapeTracker(
        dimension,
        noise=_noise(section.noise),
        prior=prior,
        bin_width=section.bin_s,
        window=section.window_s,
        update=section.update_s,
        starts=section.starts_m,
        hypotheses=section.hypotheses,
        memory=math.inf if section.memory is None else section.memory,
        gate=math.inf if section.gate is None else section.gate,
        known_position=position,
        known_covariance=covariance,
        start=start,
    )


def _mixture(
    section: sections.MixtureTracker, dimension: int, start: Array, position: Array | None, covariance: Array | None
) -> MixtureTracker:
    """Both Gaussian processes, told the same of sensor, speed and range."""
    motion, noise = _motion(section, dimension, start, position, covariance), _noise(section.noise)
    velocity = NoisyGaussianProcessTracker(
        dimension,
        noise=noise,
        bins=motion.bins,
        kernel="velocity_matern32",
        priors=MotionPriors(
            velocity_scale(LogNormal(section.speed.median, section.speed.log_std), dimension),
            LogNormal(section.velocity_time_s, math.log(2.0)),
            LogNormal(section.range.median_m, section.range.log_std),
            2.0 * section.range.median_m,
        ),
        prior_position=position,
        prior_covariance=covariance,
        start=start,
    )
    return MixtureTracker(motion, velocity, noise)


def _noise(section: Noise, std_deg: float | None = None) -> BearingNoise:
    return BearingNoise(
        math.radians(section.std_deg if std_deg is None else std_deg),
        math.radians(section.correlated_deg),
        section.correlation_s,
        section.own_std_m,
        section.estimated,
    )


def noise_of(section: sections.TrackerSection, sensor_deg: float) -> NoisyBearings | None:
    """How the tracker treats noise; ``None`` if it takes bearings for exact."""
    noise = section.noise if isinstance(section, sections.GaussianProcessTracker) else None
    if noise == "sensor":
        return NoisyBearings() if sensor_deg > 0.0 else None
    return noise


def _noisy(
    section: NoisyBearings,
    configuration: Configuration,
    position: Array | None,
    covariance: Array | None,
    start: Array,
) -> NoisyGaussianProcessTracker:
    """The Gaussian process for noisy bearings."""
    std = configuration.sensor.noise_deg if section.std_deg is None else section.std_deg
    return NoisyGaussianProcessTracker(
        configuration.dimension,
        noise=_noise(section, std),
        window=section.window if section.bin_s is None else section.window_s,
        bin_width=section.bin_s,
        kernel=section.kernel,
        priors=MotionPriors(
            LogNormal(section.scale.median, section.scale.log_std),
            LogNormal(section.length_scale.median_s, section.length_scale.log_std),
            LogNormal(section.range.median_m, section.range.log_std),
            section.position_std_m,
        ),
        hyperparameters=section.hyperparameters,
        tails=section.tails,
        linearisations=section.linearisations,
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
    if isinstance(section, sections.FirstGuess):
        guess = FirstGuess(prior, section.initial_range_std_m, section.initial_speed_std)
        deviation = math.radians(section.bearing_std_deg)
        if isinstance(section, sections.InteractingExtendedTracker):
            return ImmExtendedTracker(guess, _models(section), bearing_std=deviation)
        return ExtendedKalmanFilter(guess, process_noise=section.process_noise, bearing_std=deviation)
    assert isinstance(section, sections.InteractingPositionTracker), "all kinds are built above"
    return ImmPositionTracker(prior, _models(section), position_std=section.position_std_m)


def _models(
    section: sections.InteractingModelsTracker | sections.InteractingExtendedTracker,
) -> InteractingMultipleModel:
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
