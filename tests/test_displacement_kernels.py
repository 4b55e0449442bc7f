from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import dblquad, quad

from gbt_ocp.tracking.displacement.kernels import DISPLACEMENT_KERNELS, VELOCITY_KERNELS
from gbt_ocp.tracking.gp.kernels import KERNELS

LENGTH = 2.5


@pytest.mark.parametrize("name", VELOCITY_KERNELS)
@pytest.mark.parametrize(("t", "other"), [(1.0, 3.0), (-2.0, -5.0), (-1.5, 2.0), (4.0, 4.0), (0.02, 30.0)])
def test_displacements_are_the_velocity_integrated_twice(name, t, other):
    kernel = VELOCITY_KERNELS[name]

    def velocity(u, v):
        return float(kernel.velocity(np.array(u - v), np.log(LENGTH)))

    # split at u = v, where the OU kernel has a kink
    def inner(v):
        low, high = min(0.0, t), max(0.0, t)
        parts = sorted({low, high, *([v] if low < v < high else [])})
        return np.sign(t) * sum(quad(velocity, a, b, args=(v,))[0] for a, b in pairwise(parts))

    parts = sorted({0.0, other, *([t] if 0.0 < t / other < 1.0 else [])})
    expected = np.sign(other) * sum(quad(inner, a, b)[0] for a, b in pairwise(parts))
    found = kernel(np.array([t]), np.array([other]), np.log(LENGTH))[0, 0]
    assert found == pytest.approx(expected, rel=1e-6, abs=1e-9)


@pytest.mark.parametrize("name", VELOCITY_KERNELS)
def test_velocities_have_unit_variance(name):
    assert VELOCITY_KERNELS[name].velocity(np.array(0.0), 0.7) == 1.0
    # over a time far below the length scale the velocity is constant: variance t²
    short = VELOCITY_KERNELS[name].variance(np.array([1e-3]), np.log(LENGTH))
    np.testing.assert_allclose(short, 1e-6, rtol=1e-3)


def test_a_plain_double_integral_agrees():
    kernel = VELOCITY_KERNELS["velocity_se"]
    expected = dblquad(lambda u, v: np.exp(-0.5 * ((u - v) / LENGTH) ** 2), 0.0, 3.0, 0.0, 2.0)[0]
    assert kernel(np.array([3.0]), np.array([2.0]), np.log(LENGTH))[0, 0] == pytest.approx(expected, rel=1e-8)


@pytest.mark.parametrize("name", DISPLACEMENT_KERNELS)
def test_covariances_are_positive_semidefinite_and_zero_at_the_reference(name):
    kernel = DISPLACEMENT_KERNELS[name]
    times = np.linspace(-10.0, 5.0, 31)
    matrix = kernel(times, times, np.log(LENGTH))
    np.testing.assert_allclose(matrix, matrix.T, atol=1e-12)
    assert np.linalg.eigvalsh(matrix)[0] > -1e-10
    np.testing.assert_allclose(kernel(np.zeros(1), times, np.log(LENGTH)), 0.0, atol=1e-12)
    np.testing.assert_allclose(kernel.variance(times, np.log(LENGTH)), matrix.diagonal(), atol=1e-12)


@pytest.mark.parametrize("name", ["se", "matern32", "matern52"])
def test_pinned_positions_are_differences_of_a_stationary_process(name):
    times = np.array([0.0, -1.0, 2.0, 3.5])
    k = KERNELS[name](times[:, None] - times[None, :], np.array([np.log(LENGTH)]))
    # D(t) = g(t) - g(0) is linear in g
    difference = np.eye(4) - np.eye(4)[0]
    expected = difference @ k @ difference.T
    np.testing.assert_allclose(DISPLACEMENT_KERNELS[name](times, times, np.log(LENGTH)), expected, atol=1e-12)
