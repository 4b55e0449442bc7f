"""The functions that build the estimators, one for each kind of tracker.

:data:`gbt_ocp.experiments.build.tracker_kinds.TRACKERS` names them. SciPy comes with them, so they are imported
when the first one is called.
"""

from __future__ import annotations

import math
from typing import Any

from gbt_ocp.experiments.build.mixture_members import mixture_member
from gbt_ocp.experiments.build.noise import bearing_noise, noise_of
from gbt_ocp.experiments.build.priors import range_prior, size_prior, speed_prior
from gbt_ocp.experiments.build.tracker_engine import (
    by_engine,
    extended_in_c,
    gp_in_c,
    held_turn_in_c,
    mixture_in_c,
    motion_in_c,
)
from gbt_ocp.experiments.config import tracker as sections
from gbt_ocp.experiments.config.noise import NoisyBearingsSection, filter_std
from gbt_ocp.models.sensors import BearingSensor
from gbt_ocp.pilot.mixture_source import MEMBERS_IN_C
from gbt_ocp.tracking.displacement.hypotheses import MotionPriors
from gbt_ocp.tracking.displacement.tracker import NoisyGaussianProcessTracker
from gbt_ocp.tracking.filters.ekf import ExtendedKalmanFilter, FirstGuess, ImmExtendedTracker
from gbt_ocp.tracking.filters.imm import ImmPositionTracker, ImmPseudoLinearTracker, InteractingMultipleModel
from gbt_ocp.tracking.filters.orthogonality import OrthogonalityTracker
from gbt_ocp.tracking.filters.plkf import PseudoLinearKalmanFilter
from gbt_ocp.tracking.filters.polynomial import PolynomialRegression
from gbt_ocp.tracking.gp.gp import GaussianProcessTracker
from gbt_ocp.tracking.gp.lmc import CoregionalizedTracker
from gbt_ocp.tracking.held.bank import HeldTurnPrior
from gbt_ocp.tracking.held.held_turn import HeldTurnTracker
from gbt_ocp.tracking.mixture import MixtureTracker
from gbt_ocp.tracking.priors import LogNormal, PositionPrior, RangedPrior
from gbt_ocp.tracking.protocol import Tracker
from gbt_ocp.tracking.shape.processes import ShapePrior
from gbt_ocp.tracking.shape.tracker import MotionShapeTracker

# ---- Gaussian processes on the position -----------------------------------------------------------------------------


def _tuned(value: object) -> float | None:
    """A value to keep, or ``None`` for one that is tuned."""
    return value if isinstance(value, float) else None


def gaussian_process(
    section: sections.GaussianProcessSection, prior: PositionPrior, sensor: BearingSensor
) -> GaussianProcessTracker | NoisyGaussianProcessTracker:
    """Kind ``gp``: for exact bearings, or for noisy ones where ``noise`` says so."""
    noise = noise_of(section, sensor)
    if noise is not None:
        return _noisy(noise, prior, sensor, size_prior(section.size))

    def made(tracker: type[GaussianProcessTracker]) -> GaussianProcessTracker:
        return tracker(
            len(prior.start),
            window=section.window,
            kernel=section.kernel,
            centre=section.centre,
            length_scale=_tuned(section.length_scale),
            amplitude=_tuned(section.amplitude),
            nugget=_tuned(section.nugget),
            prior=prior,
            breaks=section.nugget == "tuned",  # the paper's nugget is fixed, and its window is what it is
        )

    return by_engine(section.engine, GaussianProcessTracker, gp_in_c, made)


def _noisy(
    section: NoisyBearingsSection, prior: PositionPrior, sensor: BearingSensor, size: LogNormal | None
) -> NoisyGaussianProcessTracker:
    """The Gaussian process for noisy bearings."""
    return NoisyGaussianProcessTracker(
        len(prior.start),
        noise=bearing_noise(section, sensor),
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
        prior=prior,
        size=size,
    )


def coregionalized(
    section: sections.CoregionalizedSection, prior: PositionPrior, sensor: BearingSensor
) -> CoregionalizedTracker:
    """Kind ``lmc``."""
    return CoregionalizedTracker(
        len(prior.start),
        window=section.window,
        kernels=section.kernels,
        centre=section.centre,
        length_scale=_tuned(section.length_scale),
        nugget=_tuned(section.nugget),
        prior=prior,
    )


# ---- Gaussian processes on the motion -------------------------------------------------------------------------------


def motion(section: sections.ShapeSection, prior: PositionPrior, sensor: BearingSensor) -> MotionShapeTracker:
    """Kind ``motion_gp``."""
    shape = ShapePrior(
        speed=speed_prior(section),
        range=range_prior(section),
        kernel=section.turn_kernel,
        turn_stds=section.turn_rate_std,
        turn_times=section.turn_time_s,
        speed_stds=section.speed_change_std,
        speed_time=section.speed_time_s,
    )
    engine = section.engine if isinstance(section, sections.MotionSection) else "numpy"
    own: dict[str, Any] = {}
    if engine == "compiled":
        own["horizon"] = section.forecast * (section.forecast_period_s or sensor.period)

    def made(tracker: type[MotionShapeTracker]) -> MotionShapeTracker:
        return tracker(
            len(prior.start),
            noise=bearing_noise(section.noise, sensor),
            prior=shape,
            bin_width=section.bin_s,
            window=section.window_s,
            update=section.update_s,
            starts=section.starts_m,
            hypotheses=section.hypotheses,
            memory=math.inf if section.memory is None else section.memory,
            gate=math.inf if section.gate is None else section.gate,
            position=prior,
            size=size_prior(section.size),
            **own,
        )

    return by_engine(engine, MotionShapeTracker, motion_in_c, made)


def mixture(section: sections.MixtureSection, prior: PositionPrior, sensor: BearingSensor) -> MixtureTracker:
    """Kind ``mixture``: its members, with the same sensor, speed and range."""
    noise = bearing_noise(section.noise, sensor)
    members: dict[str, Tracker] = {
        name: motion(section, prior, sensor) if name == "motion_gp" else mixture_member(name, section, prior, noise)
        for name in section.members
    }

    def made(tracker: type[MixtureTracker]) -> MixtureTracker:
        return tracker(
            len(prior.start),
            members,
            noise,
            bin_width=2.0 * section.member_bin_s,
            gate=math.inf if section.gate is None else section.gate,
            forgetting=section.evidence_s or math.inf,
        )

    if section.engine == "auto" and {*section.members} != {*MEMBERS_IN_C}:
        return made(MixtureTracker)
    return by_engine(section.engine, MixtureTracker, mixture_in_c, made)


def held_turn(section: sections.HeldTurnSection, prior: PositionPrior, sensor: BearingSensor) -> HeldTurnTracker:
    """Kind ``held_turn``."""
    motion_prior = HeldTurnPrior(
        speed=speed_prior(section),
        range=range_prior(section),
        turn_stds=section.turn_rate_std,
        hold=section.hold_s,
        speed_stds=section.speed_change_std,
        speed_time=section.speed_time_s,
        climb_std=section.climb_std,
        size=size_prior(section.size),
    )

    def made(tracker: type[HeldTurnTracker]) -> HeldTurnTracker:
        return tracker(
            len(prior.start),
            noise=bearing_noise(section.noise, sensor),
            prior=motion_prior,
            bin_width=section.bin_s,
            components=section.components,
            gate=math.inf if section.gate is None else section.gate,
            position=prior,
        )

    return by_engine(section.engine, HeldTurnTracker, held_turn_in_c, made)


# ---- filters --------------------------------------------------------------------------------------------------------


def _ranged(section: sections.BaselineSection, prior: PositionPrior) -> RangedPrior:
    return RangedPrior(prior.start, prior.mean, prior.covariance, range=section.initial_range_m)


def orthogonality_static(
    section: sections.OrthogonalityStaticSection, prior: PositionPrior, sensor: BearingSensor
) -> OrthogonalityTracker:
    """Kind ``oe_s``."""
    return OrthogonalityTracker(_ranged(section, prior), position_gain=section.position_gain)


def orthogonality_velocity(
    section: sections.OrthogonalityVelocitySection, prior: PositionPrior, sensor: BearingSensor
) -> OrthogonalityTracker:
    """Kind ``oe_cv``."""
    return OrthogonalityTracker(
        _ranged(section, prior), position_gain=section.position_gain, velocity_gain=section.velocity_gain
    )


def polynomial(
    section: sections.PolynomialSection, prior: PositionPrior, sensor: BearingSensor
) -> PolynomialRegression:
    """Kind ``pr``; the window lasts ``window - 1`` sampling periods."""
    return PolynomialRegression(
        _ranged(section, prior),
        window=section.window,
        span=(section.window - 1) * sensor.period,
        order=section.order,
        ridge=section.ridge,
    )


def pseudo_linear(
    section: sections.PseudoLinearSection, prior: PositionPrior, sensor: BearingSensor
) -> PseudoLinearKalmanFilter:
    """Kind ``plkf``."""
    return PseudoLinearKalmanFilter(
        _ranged(section, prior),
        initial_variance=section.initial_variance,
        process_noise=section.process_noise,
        bearing_std=filter_std(section.bearing_std_deg, sensor.noise),
        bias_compensated=section.bias_compensated,
    )


def imm_pseudo_linear(
    section: sections.InteractingPseudoLinearSection, prior: PositionPrior, sensor: BearingSensor
) -> ImmPseudoLinearTracker:
    """Kind ``imm_plkf``."""
    return ImmPseudoLinearTracker(
        _ranged(section, prior),
        _models(section),
        bearing_std=filter_std(section.bearing_std_deg, sensor.noise),
        initial_variance=section.initial_variance,
    )


def extended(
    section: sections.ExtendedKalmanSection, prior: PositionPrior, sensor: BearingSensor
) -> ExtendedKalmanFilter:
    """Kind ``ekf``."""

    def made(tracker: type[ExtendedKalmanFilter]) -> ExtendedKalmanFilter:
        return tracker(
            _first_guess(section, prior),
            process_noise=section.process_noise,
            bearing_std=filter_std(section.bearing_std_deg, sensor.noise),
            size=size_prior(section.size),
        )

    return by_engine(section.engine, ExtendedKalmanFilter, extended_in_c, made)


def imm_extended(
    section: sections.InteractingExtendedSection, prior: PositionPrior, sensor: BearingSensor
) -> ImmExtendedTracker:
    """Kind ``imm_ekf``."""
    return ImmExtendedTracker(
        _first_guess(section, prior),
        _models(section),
        bearing_std=filter_std(section.bearing_std_deg, sensor.noise),
        size=size_prior(section.size),
    )


def imm_position(
    section: sections.InteractingPositionSection, prior: PositionPrior, sensor: BearingSensor
) -> ImmPositionTracker:
    """Kind ``imm_kf_f``."""
    return ImmPositionTracker(_ranged(section, prior), _models(section), position_std=section.position_std_m)


def _first_guess(section: sections.ExtendedSection, prior: PositionPrior) -> FirstGuess:
    return FirstGuess(_ranged(section, prior), section.initial_range_std_m, section.initial_speed_std)


def _models(
    section: sections.InteractingModelsSection | sections.InteractingExtendedSection,
) -> InteractingMultipleModel:
    return InteractingMultipleModel(
        initial_variance=section.initial_variance,
        process_noise=section.process_noise,
        jerk_noise=section.jerk_noise,
        stay_probability=section.stay_probability,
        turn_rate_max=section.turn_rate_max,
    )
