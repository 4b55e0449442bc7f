"""The stated optimal bearings (``eq22``) reach what no set of bearings can better."""

import numpy as np
import pytest
from scipy.optimize import minimize

from gbt_ocp.models.bearings import DesiredBearing, condition_number, cumulative_bearing_matrix


def stated(dimension, m, axis=(0.0, 0.0, 1.0)):
    return DesiredBearing(dimension, 2.0 * np.pi / m, axis)(np.arange(m))


@pytest.mark.parametrize("dimension", [2, 3])
def test_every_stated_set_of_more_than_d_bearings_has_condition_number_one(dimension):
    rng = np.random.default_rng(0)
    for m in range(dimension + 1, 101):
        matrix = cumulative_bearing_matrix(stated(dimension, m, tuple(rng.standard_normal(3))))
        # all eigenvalues are m (d-1)/d: the trace does not depend on the bearings
        np.testing.assert_allclose(matrix, m * (dimension - 1) / dimension * np.eye(dimension), atol=1e-11)
        assert condition_number(matrix) == pytest.approx(1.0, abs=1e-12)


@pytest.mark.parametrize("dimension", [2, 3])
def test_whole_turns_in_a_window_keep_it_and_a_part_of_a_turn_does_not(dimension):
    m = 10
    turn = DesiredBearing(dimension, 2.0 * np.pi / m)
    for first in range(m):
        assert condition_number(cumulative_bearing_matrix(turn(first + np.arange(2 * m)))) == pytest.approx(1.0)
        assert condition_number(cumulative_bearing_matrix(turn(first + np.arange(2 * m - 3)))) > 1.02


def test_half_a_turn_is_enough_in_the_plane_only():
    """A bearing counts the same as its opposite; in space the opposites lie on another circle."""
    half = np.arange(10)
    assert condition_number(cumulative_bearing_matrix(DesiredBearing(2, np.pi / 10)(half))) == pytest.approx(1.0)
    assert condition_number(cumulative_bearing_matrix(DesiredBearing(3, np.pi / 10)(half))) > 2.0


@pytest.mark.parametrize("limit", [(2, 2), (3, 2)])
def test_with_fewer_bearings_than_stated_the_set_is_not_optimal(limit):
    dimension, m = limit
    assert condition_number(cumulative_bearing_matrix(stated(dimension, m))) > 1.9


@pytest.mark.parametrize(("dimension", "m"), [(2, 3), (2, 7), (3, 4)])
def test_an_optimiser_comes_as_far_and_no_further(dimension, m):
    rng = np.random.default_rng(m)

    def log_condition(x):
        bearings = x.reshape(m, dimension)
        bearings = bearings / np.linalg.norm(bearings, axis=1, keepdims=True)
        return np.log(condition_number(cumulative_bearing_matrix(bearings)))

    options = {"maxfev": 20_000, "fatol": 1e-12, "xatol": 1e-9, "adaptive": True}
    found = [
        minimize(log_condition, rng.standard_normal(m * dimension), method="Nelder-Mead", options=options).fun
        for _ in range(2)
    ]
    assert min(found) == pytest.approx(0.0, abs=1e-6)
