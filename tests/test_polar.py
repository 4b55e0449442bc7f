"""Measurements of all kinds as rows, against finite differences; the filter's update, against brute force."""

from __future__ import annotations

import numpy as np
import pytest

from gbt_ocp.models import Measurement, Mounting
from gbt_ocp.models.bearings import rotate_bearing, tangent_basis, unit_bearing
from gbt_ocp.tracking.filters.ekf import ExtendedKalmanFilter, FirstGuess, ImmExtendedTracker
from gbt_ocp.tracking.filters.imm import InteractingMultipleModel
from gbt_ocp.tracking.intake import take_in, taken_kinds
from gbt_ocp.tracking.polar import polar_rows
from gbt_ocp.tracking.priors import LogNormal, RangedPrior

OWN = {2: np.array([3.0, -2.0]), 3: np.array([3.0, -2.0, 1.0])}
TARGET = {2: np.array([25.0, 14.0]), 3: np.array([25.0, 14.0, -9.0])}
SIZE = 2.5
BELIEVED = LogNormal(3.0, 0.3)


def truth(kind, target, own, size=SIZE):
    """What a perfect sensor says, from the definitions of the kinds."""
    line = target - own
    level, far = np.hypot(line[0], line[1]), np.linalg.norm(line)
    azimuth = np.arctan2(line[1], line[0])
    return {
        "azimuth": azimuth,
        "elevation": np.arctan2(line[-1], level),
        "azimuth_elevation": np.array([azimuth, np.arctan2(line[-1], level)]),
        "range": far,
        "size": 2.0 * np.arctan(size / (2.0 * far)),
        "position": target,
    }[kind]


def sighted(kind, dimension, target=None, std=0.02, time=0.0, own=None, **keys):
    own = OWN[dimension] if own is None else own
    value = truth(kind, TARGET[dimension] if target is None else target, own)
    return Measurement(time, kind, value, std, **keys).placed(np.append(own, 0.0))


KINDS = [
    (kind, dimension)
    for dimension in (2, 3)
    for kind in ("azimuth", "elevation", "azimuth_elevation", "range", "size", "position")
    if dimension == 3 or "elevation" not in kind
]


@pytest.mark.parametrize(("kind", "dimension"), KINDS)
def test_rows_are_the_slopes_of_what_is_measured(kind, dimension):
    """Residuals over deviations change with the position and the size as central differences of the truth do."""
    own, std = OWN[dimension], 0.02
    predicted = TARGET[dimension] + 0.05 * np.arange(1, dimension + 1)
    sighting = sighted(kind, dimension, std=std)
    rows = polar_rows(sighting, predicted, 1.0, np.log(SIZE))
    unit = unit_bearing(predicted, own)
    slopes = rows.across / rows.range + rows.along[:, None] * unit / rows.range

    def value(position, size=SIZE):
        return np.atleast_1d(truth(kind, position, own, size))

    steps = 1e-5 * np.eye(dimension)
    expected = np.stack([(value(predicted + s) - value(predicted - s)) / 2e-5 for s in steps], axis=-1) / std
    found = slopes / rows.stds[:, None]
    # in other axes the rows are other ones, of the same information
    np.testing.assert_allclose(found.T @ found, expected.T @ expected, rtol=0.02, atol=1e-9)
    gradient, wanted = found.T @ (rows.residuals / rows.stds), expected.T @ (sighting.value - value(predicted)) / std
    np.testing.assert_allclose(gradient, wanted, rtol=0.03, atol=0.02 * np.abs(wanted).max())
    growth = (value(predicted, SIZE + 1e-5) - value(predicted, SIZE - 1e-5)) / 2e-5 / std * SIZE
    np.testing.assert_allclose(rows.size / rows.stds, np.linalg.norm(growth), atol=1e-5, rtol=0.02)


def filters(dimension, *, prior_std=8.0, size=BELIEVED, q=1e-4):
    prior = RangedPrior(np.zeros(dimension), TARGET[dimension] + 3.0, prior_std**2 * np.eye(dimension), range=3.0)
    guess = FirstGuess(prior, 1.0, 0.5)
    models = InteractingMultipleModel(
        initial_variance=0.25, process_noise=q, jerk_noise=q, stay_probability=0.99, turn_rate_max=0.1
    )
    return (
        ExtendedKalmanFilter(guess, process_noise=q, bearing_std=0.02, size=size),
        ImmExtendedTracker(guess, models, bearing_std=0.02, size=size),
    )


@pytest.mark.parametrize(("kind", "dimension"), KINDS)
def test_one_measurement_gives_the_posterior_of_weighted_samples(kind, dimension):
    """A narrow prior of position and log size, weighted by the density of the true measurement."""
    std = {"range": 1.0, "position": 1.0, "size": 0.01}.get(kind, 0.03)
    sighting = sighted(kind, dimension, std=std)
    rng = np.random.default_rng(1)
    samples = TARGET[dimension] + 3.0 + 1.5 * rng.standard_normal((400_000, dimension))
    logs = np.log(3.0) + 0.3 * rng.standard_normal(len(samples))
    line = samples - OWN[dimension]
    level, far = np.hypot(line[:, 0], line[:, 1]), np.linalg.norm(line, axis=1)
    values = {
        "azimuth": np.arctan2(line[:, 1], line[:, 0])[:, None],
        "elevation": np.arctan2(line[:, -1], level)[:, None],
        "azimuth_elevation": np.stack([np.arctan2(line[:, 1], line[:, 0]), np.arctan2(line[:, -1], level)], axis=-1),
        "range": far[:, None],
        "size": 2.0 * np.arctan(0.5 * np.exp(logs) / far)[:, None],
        "position": samples,
    }[kind]
    log_weight = -0.5 * np.sum(((sighting.value - values) / std) ** 2, axis=1)
    weight = np.exp(log_weight - log_weight.max())
    weight /= weight.sum()
    mean = weight @ samples
    covariance = (weight[:, None] * (samples - mean)).T @ (samples - mean)
    for tracker in filters(dimension, prior_std=1.5):
        take_in(tracker, sighting)
        forecast = tracker.predict([0.0])
        np.testing.assert_allclose(forecast.mean[0], mean, atol=0.15 * 1.5)
        np.testing.assert_allclose(forecast.covariance[0], covariance, atol=0.12 * 1.5**2)
        assert np.log(tracker.size.median) == pytest.approx(weight @ logs, abs=0.04)
        spread = np.sqrt(weight @ (logs - weight @ logs) ** 2)
        assert tracker.size.log_std == pytest.approx(spread, rel=0.1)


@pytest.mark.parametrize("dimension", [2, 3])
def test_the_size_is_estimated_from_ranges_and_angles(dimension):
    rng = np.random.default_rng(5)
    for tracker in filters(dimension):
        for k in range(60):
            for kind, std in (("azimuth" if dimension == 2 else "azimuth_elevation", 0.01), ("range", 0.3)):
                take_in(tracker, sighted(kind, dimension, std=std, time=0.5 * k))
            value = truth("size", TARGET[dimension], OWN[dimension]) * (1.0 + 0.1 * rng.standard_normal())
            take_in(tracker, Measurement(0.5 * k, "size", value, 0.1 * value).placed(np.append(OWN[dimension], 0.0)))
        assert tracker.size.median == pytest.approx(SIZE, rel=0.05)
        assert tracker.size.log_std == pytest.approx(0.1 / np.sqrt(60), rel=0.2)


def straight_leg(kind, seed, duration=60.0, own_speed=1.75, speed=1.0):
    """Bearings of 1 degree each second from 60 m, a ping every 30 s or sizes of 10 %; the end; the size."""
    rng = np.random.default_rng(seed)
    size = 2.0 * np.exp(0.3 * rng.standard_normal())
    found = []
    for t in np.arange(0.0, duration + 0.5):
        own, target = np.array([own_speed * t, 0.0]), np.array([speed * t, 60.0])
        found.append(sighted("azimuth", 2, target, np.deg2rad(1.0), t, own))
        if kind == "range" and t > 0 and t % 30 == 0:
            found.append(sighted("range", 2, target, 1.0, t, own))
        if kind == "size":
            value = truth("size", target, own, size)
            found.append(Measurement(t, "size", value, 0.1 * value).placed(np.append(own, 0.0)))
    for one in found:
        one.value[:] += one.std * rng.standard_normal(one.value.shape)
    return found, target, size


def bound(kind, duration=60.0):
    """Cramér-Rao bound ``(2, 2)`` of the last position, by finite differences of the measurements."""
    seen, _, _ = straight_leg(kind, 0, duration)
    information = np.zeros((5, 5))
    information[4, 4] = 1.0 / 0.3**2

    def value(state, one):
        target = state[:2] + one.time * state[2:4]
        return truth(one.kind, target, one.position, 2.0 * np.exp(state[4]))

    state = np.array([0.0, 60.0, 1.0, 0.0, 0.0])
    for one in seen:
        steps = 1e-5 * np.eye(5)
        slope = np.array([(value(state + h, one) - value(state - h, one)) / 2e-5 for h in steps])
        std = 0.1 * value(state, one) if one.kind == "size" else one.std[0]
        information += np.outer(slope, slope) / std**2
    last = np.hstack([np.eye(2), duration * np.eye(2), np.zeros((2, 1))])
    return last @ np.linalg.inv(information) @ last.T


@pytest.mark.parametrize(("kind", "most"), [("range", 1.5), ("size", 1.3)])
def test_on_a_straight_leg_the_error_is_near_the_bound_and_inside_what_the_filter_says(kind, most):
    """15 logs; in Cartesian coordinates an extended filter ends at 5 times the bound with pings, half inside."""
    squares, inside = [], []
    for seed in range(15):
        seen, target, _ = straight_leg(kind, seed)
        guess = FirstGuess(RangedPrior(np.zeros(2), range=60.0), 50.0, 1.0)
        size = LogNormal(2.0, 0.3) if kind == "size" else None
        tracker = ExtendedKalmanFilter(guess, process_noise=1e-8, bearing_std=0.02, size=size)
        for one in seen:
            take_in(tracker, one)
        mean, covariance = (values[0] for values in tracker.predict([60.0]))
        squares.append(np.sum((mean - target) ** 2))
        inside.append((mean - target) @ np.linalg.solve(covariance, mean - target) < 5.991)
    assert np.sqrt(np.mean(squares) / np.trace(bound(kind))) < most
    assert np.mean(inside) >= 0.84


def test_two_sensors_at_one_time_are_weighed_by_their_noise():
    """Against the weighted mean of both, with the covariance of independent measurements."""
    tracker, _ = filters(2, size=None)
    sharp, blunt = np.deg2rad(0.5), np.deg2rad(3.0)
    azimuth = truth("azimuth", TARGET[2], OWN[2])
    take_in(tracker, Measurement(0.0, "azimuth", azimuth, sharp, "sharp").placed(np.append(OWN[2], 0.0)))
    take_in(tracker, Measurement(0.0, "azimuth", azimuth + 0.05, blunt, "blunt").placed(np.append(OWN[2], 0.0)))
    mean, covariance = (values[0] for values in tracker.predict([0.0]))
    unit = unit_bearing(mean, OWN[2])
    across = tangent_basis(unit)[:, 0]
    far = np.linalg.norm(mean - OWN[2])
    information = np.array([1.0 / sharp**2, 1.0 / blunt**2, (far / 8.0) ** 2])
    prior = rotate_bearing(unit_bearing(TARGET[2] + 3.0, OWN[2]), np.zeros(1))
    offsets = np.array([0.0, 0.05, np.arctan2(prior[1], prior[0]) - azimuth])
    assert np.arctan2(unit[1], unit[0]) - azimuth == pytest.approx(offsets @ information / information.sum(), abs=1e-4)
    assert across @ covariance @ across / far**2 == pytest.approx(1.0 / information.sum(), rel=0.01)


@pytest.mark.parametrize(
    ("given", "line"),
    [
        ({"kind": "size"}, "kind: found 'size'; ekf takes azimuth, .*needs a prior"),
        ({"kind": "range", "std": None}, "std: found none"),
        ({"kind": "range", "value": -1.0}, "value: found -1.0; allowed: a range above 0"),
        ({"kind": "azimuth", "time": -1.0}, "time: found -1.0 after 0.0"),
        ({"kind": "elevation"}, "kind: found 'elevation' in 2 dimensions"),
    ],
)
def test_what_a_filter_does_not_take_is_refused_by_name_and_leaves_it_unchanged(given, line):
    tracker, _ = filters(2, size=None)
    take_in(tracker, sighted("azimuth", 2))
    before = tracker.predict([1.0])
    mounted = Measurement(**{"time": 1.0, "value": 0.3, "std": 0.1, "mounting": Mounting((1.0, 0.0)), **given})
    with pytest.raises(ValueError, match=line):
        tracker.take(mounted.placed(np.append(OWN[2], 0.0)))
    after = tracker.predict([1.0])
    np.testing.assert_array_equal(before.mean, after.mean)


@pytest.mark.parametrize("which", [0, 1])
def test_a_track_begins_with_a_measurement_that_says_where_the_target_is(which):
    def fresh():
        guess = FirstGuess(RangedPrior(np.zeros(3), range=30.0), 10.0, 1.0)
        if which == 0:
            return ExtendedKalmanFilter(guess, process_noise=1e-4, bearing_std=0.02)
        models = InteractingMultipleModel(
            initial_variance=1.0, process_noise=1e-4, jerk_noise=1e-4, stay_probability=0.99, turn_rate_max=0.1
        )
        return ImmExtendedTracker(guess, models, bearing_std=0.02)

    tracker = fresh()
    with pytest.raises(ValueError, match="'range' before the track has begun"):
        take_in(tracker, sighted("range", 3))
    for kind in ("azimuth", "position", "azimuth_elevation"):
        tracker = fresh()
        take_in(tracker, sighted(kind, 3))
        take_in(tracker, sighted("range", 3))
        take_in(tracker, sighted("elevation", 3))
        np.testing.assert_allclose(tracker.predict([0.0]).mean[0], TARGET[3], atol=0.5)
    assert "range" in taken_kinds(tracker)
