"""Gaussian-process trackers with measurements of all kinds: slopes, exact posteriors, bounds, and several sensors."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import block_diag
from test_polar import KINDS, OWN, SIZE, TARGET, bound, sighted, straight_leg, truth

from gbt_ocp.models import Measurement
from gbt_ocp.models.bearings import unit_bearing
from gbt_ocp.models.measurements import Sighting
from gbt_ocp.tracking.bins import BearingBins
from gbt_ocp.tracking.decomposed import parts_of
from gbt_ocp.tracking.displacement.hypotheses import MotionPriors
from gbt_ocp.tracking.displacement.tracker import NoisyGaussianProcessTracker
from gbt_ocp.tracking.intake import take_in
from gbt_ocp.tracking.noise import BearingNoise
from gbt_ocp.tracking.polar import polar_rows
from gbt_ocp.tracking.priors import LogNormal
from gbt_ocp.tracking.shape.fit import Sightings, _View
from gbt_ocp.tracking.shape.further import further_sightings
from gbt_ocp.tracking.shape.motions import MotionShape
from gbt_ocp.tracking.shape.processes import ShapePrior
from gbt_ocp.tracking.shape.tracker import MotionShapeTracker

ONE_DEGREE = float(np.deg2rad(1.0))


@pytest.mark.parametrize("dimension", [2, 3])
def test_slopes_of_all_kinds_by_the_shape_are_those_of_finite_differences(dimension):
    rng = np.random.default_rng(2)
    shape = MotionShape(dimension, ShapePrior(), span=20.0, knot=3.0)
    kinds = [kind for kind, d in KINDS if d == dimension and kind not in ("azimuth_elevation", "position")]
    seen = [
        one
        for k, kind in enumerate(kinds)
        for single in (sighted(kind, dimension, std=0.05, time=-3.0 * k - 1.0),)
        for one in parts_of(single, 0.05).singles or (single,)
        if not (kind == "azimuth" and dimension == 2)
    ]
    further = further_sightings(seen, LogNormal(SIZE, 0.3), 0.0, np.zeros(dimension))
    times = np.array([-12.0, -6.0, 0.0])
    bearings = unit_bearing(TARGET[dimension] + rng.standard_normal((3, dimension)), np.zeros((3, dimension)))
    view = _View(
        shape, Sightings(times, bearings, np.zeros((3, dimension)), np.ones((1, 3)), np.zeros(1), None, further)
    )
    motions = shape.begin(np.array([0]), np.array([28.0]), bearings[-1:], np.array([[1.0, 0.5, 0.1][:dimension]]))
    rows = 3 * (dimension - 1)
    slopes = view.slopes(view.misfit(motions))[0].copy()
    assert slopes.shape[0] == rows + len(seen)
    for one in range(shape.size):
        step = 1e-5 * np.eye(shape.size)[one : one + 1]
        ahead, behind = (view.misfit(shape.moved(motions, sign * step)).rows[0] for sign in (1.0, -1.0))
        # residuals fall as predictions rise
        np.testing.assert_allclose(slopes[:, one], -(ahead - behind) / 2e-5, atol=2e-3 * np.abs(slopes).max())


def trackers(dimension, *, size=None, std=ONE_DEGREE, start=60.0):
    return {
        "gp": NoisyGaussianProcessTracker(
            dimension,
            noise=BearingNoise(std),
            window=60.0,
            bin_width=2.0,
            priors=MotionPriors(LogNormal(1.0, 0.7), LogNormal(60.0, 0.8), LogNormal(start, 1.0)),
            size=size,
        ),
        "motion_gp": MotionShapeTracker(
            dimension, noise=BearingNoise(std), prior=ShapePrior(range=LogNormal(start, 1.0)), size=size
        ),
    }


@pytest.mark.slow
@pytest.mark.parametrize("name", ["gp", "motion_gp"])
@pytest.mark.parametrize(("kind", "most"), [("range", 2.0), ("size", 1.8)])
def test_on_a_straight_leg_pings_and_sizes_tell_the_range(name, kind, most):
    """3 logs. These trackers do not know that the target keeps its course, for which the bound is."""
    squares, inside = [], []
    for seed in range(3):
        seen, target, _ = straight_leg(kind, seed, 61.0)
        tracker = trackers(2, size=LogNormal(2.0, 0.3) if kind == "size" else None)[name]
        for one in seen:
            take_in(tracker, one)
        mean, covariance = (values[0] for values in tracker.predict([61.0]))
        squares.append(np.sum((mean - target) ** 2))
        inside.append((mean - target) @ np.linalg.solve(covariance, mean - target) < 9.21)
    assert np.sqrt(np.mean(squares) / np.trace(bound(kind, 61.0))) < most
    assert np.mean(inside) >= 0.75


@pytest.mark.parametrize("name", ["gp", "motion_gp"])
@pytest.mark.parametrize("dimension", [2, 3])
def test_a_still_target_is_found_by_every_kind(name, dimension):
    """From one place, where bearings alone tell no range."""
    first = "azimuth" if dimension == 2 else "azimuth_elevation"
    for kind in ("range", "size"):
        tracker = trackers(dimension, size=LogNormal(SIZE, 0.01), start=10.0)[name]
        for k in range(6):
            std = 0.002 if kind == "size" else 0.2
            take_in(tracker, sighted(first, dimension, std=0.02, time=float(k)))
            take_in(tracker, sighted(kind, dimension, std=std, time=float(k)))
        found = tracker.predict([5.0]).mean[0]
        np.testing.assert_allclose(found, TARGET[dimension], atol=1.0)


@pytest.mark.parametrize("name", ["gp", "motion_gp"])
def test_a_position_begins_a_track(name):
    tracker = trackers(3, start=10.0)[name]
    for k in range(4):
        take_in(tracker, sighted("position", 3, std=0.5, time=float(k)))
    np.testing.assert_allclose(tracker.predict([3.0]).mean[0], TARGET[3], atol=0.5)


def test_a_tracker_of_bearings_and_positions_is_given_each_its_own_way():
    """One that knows no deviations: ``update`` for a bearing, ``update_position`` for a position."""

    class Both:
        takes, position_std = ("azimuth", "position"), 0.5

        def __init__(self):
            self.given = []

        def update(self, time, bearing, own_position):
            self.given.append(("bearing", time, bearing))

        def update_position(self, time, position):
            self.given.append(("position", time, position))

        def predict(self, times):
            raise NotImplementedError

    tracker, bearing = Both(), np.array([0.6, 0.8])
    take_in(tracker, Sighting.of_bearing(1.0, bearing, OWN[2]))
    take_in(tracker, sighted("position", 2, std=0.5, time=2.0))
    assert [(what, time) for what, time, _ in tracker.given] == [("bearing", 1.0), ("position", 2.0)]
    np.testing.assert_allclose(tracker.given[0][2], bearing, atol=1e-12)
    np.testing.assert_allclose(tracker.given[1][2], TARGET[2])


def test_parts_hold_the_information_of_the_measurement():
    """Of azimuth and elevation with other deviations, and of a position, at the true position."""
    for sighting in (
        Measurement(0.0, "azimuth_elevation", truth("azimuth_elevation", TARGET[3], OWN[3]), (0.05, 0.01)).placed(
            np.append(OWN[3], 0.0)
        ),
        sighted("azimuth_elevation", 3, std=0.02),
        sighted("position", 3, std=0.5),
        sighted("position", 2, std=0.5),
    ):
        d = sighting.position.size
        parts = parts_of(sighting, 1.0)

        def information(one, d=d):
            rows = polar_rows(one, TARGET[d], 1.0)
            unit = unit_bearing(TARGET[d], OWN[d])
            slopes = (rows.across + rows.along[:, None] * unit) / rows.range / rows.stds[:, None]
            return slopes.T @ slopes

        line = TARGET[d] - OWN[d]
        far = np.linalg.norm(line)
        unit = line / far
        bearing = (np.eye(d) - np.outer(unit, unit)) / (far * parts.std) ** 2
        found = bearing + sum(map(information, parts.singles))
        np.testing.assert_allclose(found, information(sighting), rtol=0.1, atol=0.03 * np.abs(found).max())


def test_bearings_in_a_bin_are_weighed():
    """Mean and count of a bin against the weighted mean of the angles."""
    rng = np.random.default_rng(0)
    bins = BearingBins(10.0, 100.0)
    angles, weights = 0.02 * rng.standard_normal(8), rng.uniform(0.5, 4.0, 8)
    for k in range(8):
        direction = np.array([np.cos(angles[k]), np.sin(angles[k])])
        bins.append(0.5 * (k // 2), direction, np.zeros(2), weight=weights[k], same_time=True)
    mean = bins.means()
    assert mean.counts[0] == pytest.approx(weights.sum())
    assert np.arctan2(*mean.bearings[0][::-1]) == pytest.approx(weights @ angles / weights.sum(), abs=1e-5)
    assert mean.times[0] == pytest.approx(weights @ (0.5 * (np.arange(8) // 2)) / weights.sum())


def test_a_window_of_mixed_measurements_is_the_gaussian_posterior():
    """The rows' covariance against brute force: independent noise, and the error of the size that all sizes share."""
    from gbt_ocp.tracking.displacement.rows import row_covariance, rows_with_others
    from gbt_ocp.tracking.displacement.samples import SampleStore

    store = SampleStore(10, None, False)
    size = LogNormal(SIZE, 0.2)
    for k in range(3):
        bearing = sighted("azimuth", 2, time=float(k)).bearing
        store.append(float(k), bearing, OWN[2], weight=4.0, expected=None, suspect=False)
        store.others.extend([sighted("size", 2, std=0.01, time=float(k)), sighted("range", 2, std=0.7, time=float(k))])
    samples = store.everything(store.bearings())
    places = np.tile(TARGET[2], (len(samples), 1))
    rows = rows_with_others(samples, store.others, places, 0.02, size)
    found = row_covariance(rows, samples, BearingNoise(0.02), 0.02**2, np.ones(len(rows.values)))
    np.testing.assert_allclose(rows.directions @ TARGET[2], rows.values, atol=1e-9)
    far = np.linalg.norm(TARGET[2] - OWN[2])
    angle = truth("size", TARGET[2], OWN[2])
    slope = 1e4 * (0.5 * SIZE / np.tan(0.5 * (angle + 5e-5)) - 0.5 * SIZE / np.tan(0.5 * (angle - 5e-5)))
    expected = block_diag((far * 0.01) ** 2 * np.eye(3), np.diag(np.tile([(0.01 * slope) ** 2, 0.7**2], 3)))
    sized = np.array([0, 0, 0, 1, 0, 1, 0, 1, 0])
    expected += np.outer(sized, sized) * (0.2 * far) ** 2
    np.testing.assert_allclose(found, expected, rtol=1e-5, atol=1e-9)
