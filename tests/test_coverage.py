"""What the posterior of pseudo-linear bearings is the posterior of: directions that are given, not directions seen."""

import numpy as np
import pytest

from gbt_ocp.models.bearings import unit_bearing
from gbt_ocp.tracking.gp.kernels import KERNELS
from gbt_ocp.tracking.gp.posterior import Hyperparameters, condition
from gbt_ocp.tracking.window import Window

STD, STAND = 2.0, 8.0


def range_residual(bearing, dimension):
    """Mean and deviation of the range along a bearing taken from ``STAND`` metres in front of the prior mean."""
    own = np.zeros(dimension)
    own[0] = -STAND
    window = Window(2)
    window.append(0.0, bearing, own)
    theta = Hyperparameters(np.log([3.0]), float(np.log(STD)), 1e-12)
    posterior, _ = condition(KERNELS["se"], theta, window.measurements(), np.zeros(dimension))
    mean, covariance = posterior.predict(np.zeros(1))
    return bearing @ (mean[0] - own), np.sqrt(bearing @ covariance[0] @ bearing)


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.long
def test_a_seen_bearing_favours_far_targets_by_the_range_to_the_power_of_d_minus_one(dimension):
    """Conditioned on a direction, the density along the ray is the prior's times r^(d-1); the posterior leaves it out.

    So the standardised range is biased for targets drawn from the prior, and not for those drawn with weights r^(1-d).
    """
    rng = np.random.default_rng(0)
    targets = STD * rng.standard_normal((8000, dimension))
    own = np.zeros(dimension)
    own[0] = -STAND
    ranges = np.linalg.norm(targets - own, axis=1)
    bearings = unit_bearing(targets, own)
    expected, deviation = np.array([range_residual(b, dimension) for b in bearings]).T
    residual = (ranges - expected) / deviation
    weights = ranges ** (1.0 - dimension)
    noise = 4.0 / np.sqrt(len(ranges))
    assert np.average(residual, weights=weights) == pytest.approx(0.0, abs=noise)
    # to first order the bias is (d-1) σ_r/r
    assert residual.mean() == pytest.approx((dimension - 1) * STD / STAND, abs=noise + 0.03)
    assert np.average(residual**2, weights=weights) == pytest.approx(1.0, abs=3.0 * noise)
