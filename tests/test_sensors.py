import numpy as np
import pytest
from scipy import stats

from gbt_ocp.models.bearings import rotate_bearing, tangent_basis, unit_bearing
from gbt_ocp.models.sensors import BearingSensor

OWN = {2: np.array([0.5, -1.0]), 3: np.array([0.5, -1.0, 2.0])}
TARGET = {2: np.array([3.0, 1.0]), 3: np.array([3.0, 1.0, -1.0])}
both_dimensions = pytest.mark.parametrize("dimension", [2, 3])


def measure(sensor, dimension, count, seed=0):
    rng = np.random.default_rng(seed)
    return [sensor.measure(k, TARGET[dimension], OWN[dimension], rng) for k in range(count)]


def in_tangent_plane(bearings, dimension):
    """Rotation that each bearing went through, along the columns of the tangent basis."""
    true = unit_bearing(TARGET[dimension], OWN[dimension])
    along = np.array(bearings) @ tangent_basis(true)
    sine = np.linalg.norm(along, axis=1, keepdims=True)
    return along * np.arcsin(sine) / np.where(sine > 0.0, sine, 1.0)


@both_dimensions
def test_an_ideal_sensor_measures_the_bearing(dimension):
    for bearing in measure(BearingSensor(0.1), dimension, 5):
        np.testing.assert_array_equal(bearing, unit_bearing(TARGET[dimension], OWN[dimension]))


@both_dimensions
def test_noise_is_normal_with_its_deviation_in_each_direction(dimension):
    noise = in_tangent_plane(measure(BearingSensor(0.1, noise=0.02), dimension, 4000), dimension)
    for direction in noise.T:
        # A fixed seed: the test does not flicker, and a wrong deviation by 5 % fails it.
        assert stats.kstest(direction / 0.02, "norm").pvalue > 0.05
        assert direction.std() == pytest.approx(0.02, rel=0.03)
    if dimension == 3:
        assert abs(np.corrcoef(noise.T)[0, 1]) < 0.05


@both_dimensions
def test_bearings_are_missed_as_often_as_said(dimension):
    found = measure(BearingSensor(0.1, missed_probability=0.3), dimension, 4000)
    missed = sum(bearing is None for bearing in found)
    assert stats.binomtest(missed, 4000, 0.3).pvalue > 0.01


@both_dimensions
def test_outliers_come_when_and_as_large_as_said(dimension):
    found = measure(BearingSensor(0.1, outlier=0.5, outlier_every=1.0), dimension, 200)
    size = np.linalg.norm(in_tangent_plane(found, dimension), axis=1)
    hit = np.flatnonzero(size > 1e-9)
    np.testing.assert_array_equal(hit, np.arange(10, 200, 10))
    np.testing.assert_allclose(size[hit], 0.5, atol=1e-9)
    if dimension == 2:
        signs = np.sign(in_tangent_plane(found, dimension)[hit, 0])
        assert {-1.0, 1.0} == set(signs)


@both_dimensions
def test_disturbances_do_not_change_each_others_draws(dimension):
    noisy = measure(BearingSensor(0.1, noise=0.02), dimension, 60)
    everything = measure(
        BearingSensor(0.1, noise=0.02, missed_probability=0.3, outlier=0.4, outlier_every=1.0), dimension, 60
    )
    missed_only = measure(BearingSensor(0.1, missed_probability=0.3), dimension, 60)
    for k in range(60):
        assert (everything[k] is None) == (missed_only[k] is None)
        if everything[k] is not None and (k == 0 or k % 10):
            np.testing.assert_array_equal(everything[k], noisy[k])


def test_same_seed_same_measurements():
    sensor = BearingSensor(0.1, noise=0.02, missed_probability=0.2)
    for first, second in zip(measure(sensor, 3, 50, seed=9), measure(sensor, 3, 50, seed=9), strict=True):
        assert (first is None and second is None) or np.array_equal(first, second)


def test_a_target_at_the_vehicle_is_not_measured_and_draws_as_ever():
    first, second = np.random.default_rng(1), np.random.default_rng(1)
    sensor = BearingSensor(0.1, noise=0.02)
    assert sensor.measure(0, OWN[2], OWN[2], first) is None
    sensor.measure(0, TARGET[2], OWN[2], second)
    assert first.random() == second.random()


def test_noise_is_a_rotation_and_keeps_unit_length():
    for bearing in measure(BearingSensor(0.1, noise=2.0), 3, 100):
        assert np.linalg.norm(bearing) == pytest.approx(1.0, abs=1e-14)
    true = unit_bearing(TARGET[3], OWN[3])
    rng = np.random.default_rng(0)
    np.testing.assert_allclose(
        measure(BearingSensor(0.1, noise=0.3), 3, 1)[0], rotate_bearing(true, 0.3 * rng.standard_normal(2)), atol=1e-14
    )
