"""The trackers that a mixture is made of."""

from __future__ import annotations

import math

from gbt_ocp.experiments.build.priors import range_prior, size_prior, speed_prior
from gbt_ocp.experiments.config import tracker as sections
from gbt_ocp.tracking.filters.binned import BinnedFilter
from gbt_ocp.tracking.filters.ekf import ExtendedKalmanFilter, FirstGuess, ImmExtendedTracker
from gbt_ocp.tracking.filters.imm import InteractingMultipleModel
from gbt_ocp.tracking.held.bank import HeldTurnPrior
from gbt_ocp.tracking.held.held_turn import HeldTurnTracker
from gbt_ocp.tracking.intake import SightingTracker
from gbt_ocp.tracking.noise import BearingNoise
from gbt_ocp.tracking.priors import PositionPrior, RangedPrior
from gbt_ocp.tracking.protocol import Tracker

FILTER_NOISE = {"ekf": (0.2, 0.0), "imm_ekf": (2.0e-4, 0.8)}
"""Densities of the white acceleration and jerk of the filters, with the median speed and the time for which a turn is
held as units. Found best at sea (1 m/s, 20 s), on seeds that no table uses."""

MODE_SHARE, MODE_TURN = 0.5, 2.0
"""Mean time for which a mode of imm_ekf lasts, and its largest turn rate in rad, in those units."""

DRAWN_TURN, SPEED_SHARE = 0.6, 1.5
"""Standard deviation in rad of a turn rate of held_turn, and time scale of the change of its speed, in those units."""


def mixture_member(name: str, section: sections.MixtureSection, prior: PositionPrior, noise: BearingNoise) -> Tracker:
    """A tracker of a mixture, with the same sensor, speed and range as the others."""
    speed, range_ = speed_prior(section), range_prior(section)
    gate = math.inf if section.gate is None else section.gate
    hold, size = section.hold_s, size_prior(section.size)
    if name == "held_turn":
        motion_prior = HeldTurnPrior(
            speed, range_, turn_stds=(DRAWN_TURN / hold,), hold=hold, speed_time=SPEED_SHARE * hold, size=size
        )
        return HeldTurnTracker(
            len(prior.start), noise=noise, prior=motion_prior, bin_width=section.member_bin_s, gate=gate, position=prior
        )
    process, jerk = (
        speed.median**2 * density / hold**power for density, power in zip(FILTER_NOISE[name], (1, 3), strict=True)
    )

    def make(position: RangedPrior) -> SightingTracker:
        guess = FirstGuess(position, range_.log_std * range_.median, speed.median)
        if name == "ekf":
            return ExtendedKalmanFilter(guess, process_noise=process, bearing_std=noise.std, size=size)
        models = InteractingMultipleModel(
            initial_variance=speed.median**2,
            process_noise=process,
            jerk_noise=jerk,
            stay_probability=math.exp(-section.member_bin_s / (MODE_SHARE * hold)),
            turn_rate_max=MODE_TURN / hold,
        )
        return ImmExtendedTracker(guess, models, bearing_std=noise.std, size=size)

    ranged = RangedPrior(prior.start, prior.mean, prior.covariance, range=range_.median)
    return BinnedFilter(make, ranged, noise, bin_width=section.member_bin_s, gate=gate)
