import numpy as np
import pytest

from gbt_ocp.models.bearings import unit_bearing
from gbt_ocp.tracking.window import Window

both_dimensions = pytest.mark.parametrize("dimension", [2, 3])


def samples(dimension, count=9, seed=0):
    """Times that are not even, own positions, target positions."""
    rng = np.random.default_rng(seed)
    return (
        np.cumsum(rng.uniform(0.05, 0.3, count)),
        rng.standard_normal((count, dimension)),
        4.0 + rng.standard_normal((count, dimension)),
    )


def filled(dimension, capacity, count=9):
    window = Window(capacity)
    for t, own, target in zip(*samples(dimension, count), strict=True):
        window.append(t, unit_bearing(target, own), own)
    return window


@both_dimensions
def test_keeps_the_latest_samples(dimension):
    window = filled(dimension, 4)
    times, own, target = samples(dimension)
    assert len(window) == 4
    np.testing.assert_array_equal(window.times, times[-4:])
    np.testing.assert_array_equal(window.own_positions, own[-4:])
    np.testing.assert_array_equal(window.bearings, unit_bearing(target, own)[-4:])


@both_dimensions
def test_measurements_are_linear_in_the_true_position(dimension):
    """``y = λ̄ᵀ P_T`` whatever the range, d-1 rows a sample, in the order of the samples (eq9, eq10)."""
    window = filled(dimension, 20)
    times, _, target = samples(dimension)
    data = window.measurements()
    rows = dimension - 1
    assert data.directions.shape == (9 * rows, dimension)
    np.testing.assert_array_equal(data.times, np.repeat(times, rows))
    np.testing.assert_allclose(data.values, np.sum(data.directions * np.repeat(target, rows, axis=0), axis=1))
    np.testing.assert_allclose(np.linalg.norm(data.directions, axis=1), 1.0)
    np.testing.assert_array_equal(data.variances, 0.0)
    # G of the paper: the rows of one sample span the plane across its bearing.
    for k in range(9):
        block = data.directions[k * rows : (k + 1) * rows]
        np.testing.assert_allclose(block @ window.bearings[k], 0.0, atol=1e-14)
        np.testing.assert_allclose(block @ block.T, np.eye(rows), atol=1e-14)


@both_dimensions
def test_values_relative_to_a_centre_are_those_of_a_moved_world(dimension):
    centre = np.arange(1.0, dimension + 1.0)
    moved = Window(20)
    for t, own, target in zip(*samples(dimension), strict=True):
        moved.append(t, unit_bearing(target, own), own - centre)
    found = filled(dimension, 20).measurements().relative_to(centre)
    np.testing.assert_allclose(found, moved.measurements().values, atol=1e-13)


@both_dimensions
def test_bearing_matrix_is_that_of_the_window_alone(dimension):
    window = filled(dimension, 4)
    expected = sum(np.eye(dimension) - np.outer(b, b) for b in window.bearings)
    np.testing.assert_allclose(window.bearing_matrix(), expected, atol=1e-13)


def test_gaps_need_no_special_case():
    window = Window(3)
    for t in (0.0, 0.1, 0.9, 5.0):
        window.append(t, [0.6, 0.8], [t, 0.0])
    np.testing.assert_array_equal(window.times, [0.1, 0.9, 5.0])


@pytest.mark.parametrize(
    ("sample", "says"),
    [
        ((1.0, [1.0, 0.0], [0.0, 0.0]), "time must increase, found 1.0 after 1.0"),
        ((0.5, [1.0, 0.0], [0.0, 0.0]), "time must increase"),
        ((2.0, [1.0, 0.1], [0.0, 0.0]), "length 1, found 1.00499"),
        ((2.0, [1.0, 0.0], [0.0, np.nan]), "finite"),
        ((np.inf, [1.0, 0.0], [0.0, 0.0]), "finite"),
        ((2.0, [np.nan, 0.0], [0.0, 0.0]), "finite"),
        ((2.0, [1.0, 0.0, 0.0], [0.0, 0.0]), r"found \(3,\) and \(2,\)"),
        ((2.0, [1.0], [0.0]), "2 or 3 numbers"),
    ],
)
def test_a_faulty_sample_is_refused_and_leaves_the_window_as_it_was(sample, says):
    window = Window(3)
    window.append(1.0, [0.6, 0.8], [1.0, 2.0])
    with pytest.raises(ValueError, match=says):
        window.append(*sample)
    assert len(window) == 1


def test_a_window_of_one_is_refused():
    with pytest.raises(ValueError, match="at least 2, found 1"):
        Window(1)


def test_the_past_does_not_change_with_the_callers_arrays():
    own, bearing = np.array([1.0, 2.0]), np.array([0.6, 0.8])
    window = Window(3)
    window.append(0.0, bearing, own)
    own += 5.0
    bearing[:] = [1.0, 0.0]
    np.testing.assert_array_equal(window.own_positions, [[1.0, 2.0]])
    np.testing.assert_array_equal(window.bearings, [[0.6, 0.8]])
