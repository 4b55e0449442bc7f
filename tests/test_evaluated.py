"""Expressions evaluated in place, held against CasADi's own evaluation."""

import pickle

import casadi as ca
import numpy as np
import pytest

from gbt_ocp.models.evaluated import Evaluated


@pytest.fixture
def expressions():
    x, y = ca.SX.sym("x", 3), ca.SX.sym("y", 2)
    # the second has a structural zero, and the third nothing at all
    return [x, y], [ca.sin(x) * y[0] + y[1], ca.vertcat(x[0], ca.SX(1, 1), x[2] * y[1]), ca.SX(0, 1)]


def test_one_point_and_many_are_what_casadi_gives(expressions):
    symbols, values = expressions
    plain = ca.Function("plain", symbols, values)
    rng = np.random.default_rng(0)
    x, y = rng.normal(size=(5, 3)), rng.normal(size=(5, 2))
    one, many = Evaluated("one", symbols, values), Evaluated("many", symbols, values, 5)
    found = many.all(x, y)
    for k in range(5):
        expected = [np.asarray(value).ravel() for value in plain(x[k], y[k])]
        for point, grid, wanted in zip(one.all(x[k], y[k]), found, expected, strict=True):
            np.testing.assert_array_equal(point, wanted)
            np.testing.assert_array_equal(grid[k], wanted)


def test_results_stay_what_they_are_and_other_shapes_are_refused(expressions):
    symbols, values = expressions
    function = Evaluated("function", symbols, values)
    first = function([1.0, 2.0, 3.0], [1.0, 0.0])
    kept = first.copy()
    function([4.0, 5.0, 6.0], [1.0, 0.0])
    np.testing.assert_array_equal(first, kept)
    with pytest.raises(ValueError, match="broadcast"):
        function([1.0, 2.0], [1.0, 0.0])
    with pytest.raises(ValueError, match="zip"):
        function([1.0, 2.0, 3.0])


def test_it_pickles_with_memory_of_its_own(expressions):
    symbols, values = expressions
    function = Evaluated("function", symbols, values, 2)
    other = pickle.loads(pickle.dumps(function))
    x, y = np.arange(6.0).reshape(2, 3), np.ones((2, 2))
    np.testing.assert_array_equal(other(x, y), function(x, y))
    before = function(x, y)
    other(x + 1.0, y)
    np.testing.assert_array_equal(function(x, y), before)
