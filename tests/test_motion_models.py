"""Transition and noise of the filters' motion models against matrix exponentials and Van Loan's integral."""

import numpy as np
import pytest
from scipy.linalg import expm

from gbt_ocp.tracking.filters.motion_models import constant_acceleration, constant_velocity, coordinated_turn, turn_rate

MODELS = {2: constant_velocity, 3: constant_acceleration}


def integrated(drift, diffusion, step):
    """Transition and covariance of dx = drift x dt + white noise, by Van Loan's block exponential."""
    n = len(drift)
    block = expm(np.block([[-drift, diffusion], [np.zeros((n, n)), drift.T]]) * step)
    transition = block[n:, n:].T
    return transition, transition @ block[:n, n:]


@pytest.mark.parametrize("order", [2, 3])
@pytest.mark.parametrize("dimension", [2, 3])
def test_chains_of_integrators_driven_by_white_noise(order, dimension):
    drift = np.kron(np.eye(order, k=1), np.eye(dimension))
    diffusion = np.kron(np.diag([0.0] * (order - 1) + [1.0]), np.eye(dimension))
    steps = np.array([0.02, 0.1, 1.3])
    transitions, noises = MODELS[order](steps, dimension)
    assert transitions.shape == noises.shape == (3, order * dimension, order * dimension)
    for step, transition, noise in zip(steps, transitions, noises, strict=True):
        wanted = integrated(drift, diffusion, step)
        np.testing.assert_allclose(transition, wanted[0], atol=1e-12)
        np.testing.assert_allclose(noise, wanted[1], atol=1e-12)
        assert np.all(np.linalg.eigvalsh(noise) > 0.0)
    np.testing.assert_array_equal(MODELS[order](0.1, dimension)[0], transitions[1])


@pytest.mark.parametrize("rate", [0.0, 1e-6, 1e-3, 0.3, 2.0, -2.0])
def test_a_turn_in_the_plane_is_the_textbook_matrix(rate):
    # F_CT on (x, y, vx, vy), and the acceleration it implies
    step = 0.7
    s, c = np.sin(rate * step), np.cos(rate * step)
    along = s / rate if rate else step
    across = (1.0 - c) / rate if rate else 0.0
    turning = np.array([[0.0, -rate], [rate, 0.0]])
    wanted = np.eye(6)
    wanted[4:, 4:] = 0.0
    wanted[:2, 2:4] = [[along, -across], [across, along]]
    wanted[2:4, 2:4] = [[c, -s], [s, c]]
    wanted[4:, 2:4] = turning @ [[c, -s], [s, c]]
    np.testing.assert_allclose(coordinated_turn(step, turning), wanted, atol=2e-10)


@pytest.mark.parametrize("dimension", [2, 3])
def test_a_turn_is_the_exponential_of_its_rate_matrix(dimension):
    rng = np.random.default_rng(dimension)
    velocity, acceleration = rng.standard_normal((2, dimension))
    turn = turn_rate(velocity, acceleration, np.inf)
    steps = np.array([0.05, 0.4, 2.0])
    d, zero = dimension, np.zeros((dimension, dimension))
    drift = np.block([[zero, np.eye(d)], [zero, turn]])
    for step, found in zip(steps, coordinated_turn(steps, turn), strict=True):
        np.testing.assert_allclose(found[: 2 * d, : 2 * d], expm(drift * step), atol=1e-12)
        np.testing.assert_allclose(found[2 * d :, d : 2 * d], turn @ expm(turn * step), atol=1e-12)
        np.testing.assert_array_equal(found[:, 2 * d :], 0.0)


def test_the_turn_rate_is_that_of_a_circle_and_is_limited():
    phase, rate, radius = 0.4, 0.7, 3.0
    velocity = radius * rate * np.array([-np.sin(phase), np.cos(phase)])
    acceleration = -radius * rate**2 * np.array([np.cos(phase), np.sin(phase)])
    np.testing.assert_allclose(turn_rate(velocity, acceleration, 1.0), [[0.0, -rate], [rate, 0.0]], atol=1e-14)
    np.testing.assert_allclose(turn_rate(velocity, -acceleration, 0.5), [[0.0, 0.5], [-0.5, 0.0]], atol=1e-14)
    np.testing.assert_array_equal(turn_rate(np.zeros(3), np.ones(3), 1.0), 0.0)
    # in space: ω × v = W v with ω = v × a / ‖v‖²
    v, a = np.random.default_rng(0).standard_normal((2, 3))
    turn = turn_rate(v, a, np.inf)
    np.testing.assert_allclose(turn @ v, np.cross(np.cross(v, a) / (v @ v), v), atol=1e-13)
    np.testing.assert_allclose(np.linalg.norm(turn) / np.sqrt(2.0), np.linalg.norm(np.cross(v, a)) / (v @ v))
