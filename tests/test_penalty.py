import casadi as ca
import numpy as np
import pytest
from scipy.integrate import trapezoid

from gbt_ocp.ocp.solvers.ipopt import continuation
from gbt_ocp.ocp.transcription import smoothed_hinge, trapezoid_weights

every_width = pytest.mark.parametrize("width", [0.01, 1.0, 10.0])


def hinge(x, width):
    return np.array([float(smoothed_hinge(float(v), width)) for v in np.ravel(x)])


@every_width
def test_hinge_is_zero_below_identity_above_and_a_parabola_between(width):
    x = width * np.array([-50.0, -1.5, -1.0, 1.0, 1.5, 50.0])
    np.testing.assert_allclose(hinge(x, width), np.where(x > 0.0, x, 0.0), atol=1e-15 * width)
    assert hinge(0.0, width)[0] == pytest.approx(width / 4.0)
    # The parabola through 0 at -width, width/4 at 0 and width at width.
    np.testing.assert_allclose(hinge([0.5 * width], width), 2.25 * width / 4.0)


@every_width
def test_hinge_is_continuously_differentiable(width):
    x = ca.SX.sym("x")
    slope = ca.Function("slope", [x], [ca.gradient(smoothed_hinge(x, width), x)])
    points = width * np.concatenate([np.linspace(-3.0, 3.0, 601), [-1.0 - 1e-9, -1.0 + 1e-9, 1.0 - 1e-9, 1.0 + 1e-9]])
    values = np.array([float(slope(v)) for v in points])
    np.testing.assert_allclose(values, np.clip((points / width + 1.0) / 2.0, 0.0, 1.0), atol=1e-8)
    inner = width * np.array([-2.0, -0.7, 0.0, 0.4, 3.0])
    step = 1e-6 * width
    numeric = (hinge(inner + step, width) - hinge(inner - step, width)) / (2.0 * step)
    np.testing.assert_allclose([float(slope(v)) for v in inner], numeric, atol=1e-5)


@pytest.mark.parametrize("intervals", [1, 2, 20])
def test_weights_are_those_of_the_trapezoidal_rule(intervals):
    values = np.random.default_rng(0).standard_normal(intervals + 1)
    assert trapezoid_weights(intervals) @ values == pytest.approx(trapezoid(values))


def test_continuation_ends_at_what_was_asked_and_gets_harder():
    stages = continuation(0.01, 1000.0)
    np.testing.assert_allclose(stages, [(0.5, 10.0), (0.1, 100.0), (0.01, 1000.0)])
    assert stages[-1] == (0.01, 1000.0)
