"""The pseudo-linear filter beside Stone Soup's Kalman filters on the same measurements: the linear one, fed with the
pseudo-measurements, is the same filter; the extended one is as good.

A moderate bearings-only scenario: the observer circles at 5 m and 3 m/s, the target passes by at constant velocity,
bearings have 1° of noise every 0.1 s for 40 s, and the start is known to 2 m.
"""

import datetime

import numpy as np
import pytest

from gbt_ocp.models.bearings import rotate_bearing, unit_bearing
from gbt_ocp.tracking.filters.plkf import PseudoLinearKalmanFilter
from gbt_ocp.tracking.priors import RangedPrior

PERIOD, STEPS, NOISE, DENSITY = 0.1, 400, np.radians(1.0), 1e-4
START, VELOCITY = np.array([-2.0, 10.0]), np.array([0.2, -0.1])
KNOWN = np.diag([4.0, 4.0])
TIMES = PERIOD * np.arange(STEPS)
TARGET = START + TIMES[:, None] * VELOCITY
ANGLE = 3.0 / 5.0 * TIMES
OWN = 5.0 * np.stack([np.cos(ANGLE), np.sin(ANGLE)], axis=-1)


def measured(seed):
    """Bearings ``(STEPS, 2)`` and the start that is believed ``(2,)``."""
    rng = np.random.default_rng(seed)
    bearings = rotate_bearing(unit_bearing(TARGET, OWN), NOISE * rng.standard_normal((STEPS, 1)))
    return bearings, START + 2.0 * rng.standard_normal(2)


def pseudo_linear(bearings, start, **keys):
    tracker = PseudoLinearKalmanFilter(
        RangedPrior(np.zeros(2), start, KNOWN, range=3.0),
        initial_variance=0.25,
        process_noise=DENSITY,
        bearing_std=NOISE,
        **keys,
    )
    found = []
    for t, bearing, own in zip(TIMES, bearings, OWN, strict=True):
        tracker.update(t, bearing, own)
        found.append(tracker.predict([t]).mean[0])
    return np.array(found)


def extended(bearings, start):
    """Stone Soup's EKF with the same motion model, noise and prior."""
    pytest.importorskip("stonesoup", reason="Stone Soup comes with the extra bench")
    from stonesoup.models.measurement.nonlinear import Cartesian2DToBearing
    from stonesoup.models.transition.linear import CombinedLinearGaussianTransitionModel, ConstantVelocity
    from stonesoup.predictor.kalman import ExtendedKalmanPredictor
    from stonesoup.types.angle import Bearing
    from stonesoup.types.array import StateVector
    from stonesoup.types.detection import Detection
    from stonesoup.types.hypothesis import SingleHypothesis
    from stonesoup.types.prediction import GaussianStatePrediction
    from stonesoup.types.state import GaussianState
    from stonesoup.updater.kalman import ExtendedKalmanUpdater

    predictor = ExtendedKalmanPredictor(CombinedLinearGaussianTransitionModel([ConstantVelocity(DENSITY)] * 2))
    began = datetime.datetime(2020, 1, 1)
    covariance = np.diag([KNOWN[0, 0], 0.25, KNOWN[1, 1], 0.25])
    state, found = None, []
    for t, bearing, own in zip(TIMES, bearings, OWN, strict=True):
        now = began + datetime.timedelta(seconds=float(t))
        if state is None:
            # the first bearing is taken in as well
            prediction = GaussianStatePrediction([[start[0]], [0.0], [start[1]], [0.0]], covariance, timestamp=now)
        else:
            prediction = predictor.predict(state, timestamp=now)
        model = Cartesian2DToBearing(
            ndim_state=4, mapping=(0, 2), noise_covar=np.array([[NOISE**2]]), translation_offset=own[:, None]
        )
        angle = StateVector([Bearing(np.arctan2(bearing[1], bearing[0]))])
        detection = Detection(angle, timestamp=now, measurement_model=model)
        state = ExtendedKalmanUpdater(model).update(SingleHypothesis(prediction, detection))
        assert isinstance(state, GaussianState)
        found.append(np.asarray(state.state_vector, dtype=float).ravel()[[0, 2]])
    return np.array(found)


def settled(found):
    """Root mean square error of the position over the last half, in metres."""
    return np.sqrt(np.mean(np.sum((found - TARGET)[STEPS // 2 :] ** 2, axis=1)))


@pytest.mark.long
def test_the_errors_are_those_of_an_extended_filter():
    errors = np.array(
        [
            [
                settled(extended(bearings, start)),
                settled(pseudo_linear(bearings, start)),
                settled(pseudo_linear(bearings, start, bias_compensated=True)),
            ]
            for bearings, start in map(measured, range(8))
        ]
    )
    theirs, plain, compensated = errors.mean(axis=0)
    assert theirs < 0.2
    assert plain < 1.3 * theirs
    assert compensated < 1.15 * theirs


def test_the_filter_is_stone_soups_fed_with_pseudo_measurements():
    pytest.importorskip("stonesoup", reason="Stone Soup comes with the extra bench")
    from stonesoup.models.measurement.linear import LinearGaussian
    from stonesoup.models.transition.linear import CombinedLinearGaussianTransitionModel, ConstantVelocity
    from stonesoup.predictor.kalman import KalmanPredictor
    from stonesoup.types.detection import Detection
    from stonesoup.types.hypothesis import SingleHypothesis
    from stonesoup.types.prediction import GaussianStatePrediction
    from stonesoup.updater.kalman import KalmanUpdater

    class Across(LinearGaussian):
        """``Nᵀ p`` for the tangent N of a bearing; the state is x, vx, y, vy."""

        normal = np.zeros(2)

        def matrix(self, **kwargs):
            return np.array([[self.normal[0], 0.0, self.normal[1], 0.0]])

    bearings, start = measured(5)
    found = pseudo_linear(bearings, start)
    predictor = KalmanPredictor(CombinedLinearGaussianTransitionModel([ConstantVelocity(DENSITY)] * 2))
    began = datetime.datetime(2020, 1, 1)
    state = None
    for k, (t, bearing, own) in enumerate(zip(TIMES, bearings, OWN, strict=True)):
        now = began + datetime.timedelta(seconds=float(t))
        if state is None:
            covariance = np.diag([KNOWN[0, 0], 0.25, KNOWN[1, 1], 0.25])
            prediction = GaussianStatePrediction([[start[0]], [0.0], [start[1]], [0.0]], covariance, timestamp=now)
        else:
            prediction = predictor.predict(state, timestamp=now)
        where = np.asarray(prediction.state_vector, dtype=float).ravel()[[0, 2]]
        noise = (np.linalg.norm(where - own) * NOISE) ** 2
        model = Across(ndim_state=4, mapping=(0,), noise_covar=np.array([[noise]]))
        model.normal = np.array([-bearing[1], bearing[0]])
        detection = Detection([[model.normal @ own]], timestamp=now, measurement_model=model)
        state = KalmanUpdater(model).update(SingleHypothesis(prediction, detection))
        theirs = np.asarray(state.state_vector, dtype=float).ravel()[[0, 2]]
        # datetime holds microseconds, and theirs is not Joseph's form
        np.testing.assert_allclose(found[k], theirs, atol=1e-8)
