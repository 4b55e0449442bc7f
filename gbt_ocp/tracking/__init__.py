"""Trackers: bearings in, forecasts of the target's position out, behind one protocol."""

from gbt_ocp.tracking.displacement.hypotheses import MotionPriors
from gbt_ocp.tracking.displacement.tracker import NoisyGaussianProcessTracker
from gbt_ocp.tracking.filters.ekf import ExtendedKalmanFilter, ImmExtendedTracker
from gbt_ocp.tracking.filters.imm import ImmPositionTracker, ImmPseudoLinearTracker
from gbt_ocp.tracking.filters.orthogonality import OrthogonalityTracker
from gbt_ocp.tracking.filters.plkf import PseudoLinearKalmanFilter
from gbt_ocp.tracking.filters.polynomial import PolynomialRegression
from gbt_ocp.tracking.gp.gp import GaussianProcessTracker
from gbt_ocp.tracking.gp.lmc import CoregionalizedTracker
from gbt_ocp.tracking.held.bank import HeldTurnPrior
from gbt_ocp.tracking.held.held_turn import HeldTurnTracker
from gbt_ocp.tracking.intake import SightingTracker, take_in, taken_kinds
from gbt_ocp.tracking.mixture import MixtureTracker
from gbt_ocp.tracking.noise import BearingNoise
from gbt_ocp.tracking.priors import LogNormal, PositionPrior, RangedPrior
from gbt_ocp.tracking.protocol import (
    Forecast,
    GaussianProcess,
    JointForecast,
    JointlyGaussian,
    KeepsHypotheses,
    PositionTracker,
    Tracker,
    WeighedForecasts,
)
from gbt_ocp.tracking.shape.processes import ShapePrior
from gbt_ocp.tracking.shape.tracker import MotionShapeTracker

__all__ = [
    "BearingNoise",
    "CoregionalizedTracker",
    "ExtendedKalmanFilter",
    "Forecast",
    "GaussianProcess",
    "GaussianProcessTracker",
    "HeldTurnPrior",
    "HeldTurnTracker",
    "ImmExtendedTracker",
    "ImmPositionTracker",
    "ImmPseudoLinearTracker",
    "JointForecast",
    "JointlyGaussian",
    "KeepsHypotheses",
    "LogNormal",
    "MixtureTracker",
    "MotionPriors",
    "MotionShapeTracker",
    "NoisyGaussianProcessTracker",
    "OrthogonalityTracker",
    "PolynomialRegression",
    "PositionPrior",
    "PositionTracker",
    "PseudoLinearKalmanFilter",
    "RangedPrior",
    "ShapePrior",
    "SightingTracker",
    "Tracker",
    "WeighedForecasts",
    "take_in",
    "taken_kinds",
]
