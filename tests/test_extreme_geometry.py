"""Bearings and trackers where geometry ends: on the vehicle, far away, overhead, at ±π, at repeated and odd times."""

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from gbt_ocp.experiments.build.loop import build_sensor
from gbt_ocp.experiments.build.trackers import build_tracker
from gbt_ocp.experiments.config.loading import load_config
from gbt_ocp.models.bearings import (
    condition_number,
    cumulative_bearing_matrix,
    rotate_bearing,
    tangent_basis,
    unit_bearing,
)
from gbt_ocp.tracking.protocol import PositionTracker

FEW = settings(max_examples=60, deadline=None, database=None, derandomize=True, suppress_health_check=list(HealthCheck))
REACHES = [1e-9, 1e-3, 1.0, 50.0, 1e6]
ANGLES = [0.0, np.pi, -np.pi, np.nextafter(np.pi, 0.0), 0.5 * np.pi, -0.5 * np.pi, 1e-12, 1.0]
KINDS = [
    "gp",
    "lmc",
    "motion_gp",
    "mixture",
    "held_turn",
    "oe_s",
    "oe_cv",
    "plkf",
    "imm_plkf",
    "ekf",
    "imm_ekf",
    "imm_kf_f",
    "pr",
]
TRACKERS = {
    **{kind: [f"tracker.kind={kind}"] for kind in KINDS},
    "noisy gp": ["sensor.noise_deg=1.0"],
    "bias-compensated plkf": ["tracker={kind: plkf, bias_compensated: true}"],
}


def directions(dimension):
    azimuth = st.sampled_from(ANGLES) | st.floats(-np.pi, np.pi)
    elevation = st.sampled_from([0.0, 0.5 * np.pi, -0.5 * np.pi, 1.5]) | st.floats(-0.5 * np.pi, 0.5 * np.pi)

    def vector(angles):
        level = np.cos(angles[1]) if dimension == 3 else 1.0
        return np.array([level * np.cos(angles[0]), level * np.sin(angles[0]), np.sin(angles[1])])[:dimension]

    return st.tuples(azimuth, elevation).map(vector)


@pytest.mark.parametrize("dimension", [2, 3])
def test_bearings_keep_length_one_and_their_basis(dimension):
    @FEW
    @given(directions(dimension), st.sampled_from(REACHES), st.floats(-4.0, 4.0))
    def once(direction, reach, angle):
        bearing = unit_bearing(reach * direction, np.zeros(dimension))
        basis = tangent_basis(bearing)
        assert np.linalg.norm(bearing) == pytest.approx(1.0, abs=1e-15)
        np.testing.assert_allclose(basis.T @ basis, np.eye(dimension - 1), atol=1e-14)
        np.testing.assert_allclose(basis.T @ bearing, 0.0, atol=1e-14)
        turned = rotate_bearing(bearing, np.full(dimension - 1, angle) / np.sqrt(dimension - 1))
        assert np.dot(turned, bearing) == pytest.approx(np.cos(angle), abs=1e-12)
        matrix = cumulative_bearing_matrix([bearing, turned])
        assert np.linalg.eigvalsh(matrix)[0] > -1e-15
        assert condition_number(matrix) >= 1.0

    once()


@st.composite
def stories(draw, dimension):
    """Up to eight samples: target seen from the vehicle, own position, and time since the last."""
    steps = st.tuples(
        directions(dimension),
        st.sampled_from(REACHES),
        st.sampled_from([0.1, 0.1, 0.1, 1e-9, 1e3, 0.0, -1.0]),
        st.lists(st.sampled_from([0.0, 0.0, 1.0, -3.0, 1e4]), min_size=dimension, max_size=dimension),
    )
    found = draw(st.lists(steps, min_size=1, max_size=8))
    return found if draw(st.booleans()) else [found[0]] * len(found)  # the same bearing again and again


SLOW = {("motion_gp", 2), ("mixture", 3)}
"""The mixture contains the tracker motion_gp: one of them in each dimension is enough every time."""


@pytest.mark.parametrize(
    ("name", "dimension"),
    [pytest.param(name, d, marks=[pytest.mark.slow] if (name, d) in SLOW else []) for name in TRACKERS for d in (2, 3)],
)
@pytest.mark.long
def test_trackers_stay_finite_with_a_covariance(name, dimension):
    configuration = load_config("case2" if dimension == 2 else "case5", TRACKERS[name])

    @settings(FEW, max_examples=5 if name in ("motion_gp", "mixture", "noisy gp") else 15)  # these take a while
    @given(stories(dimension))
    def once(story):
        tracker, time, latest = (
            build_tracker(configuration.tracker, np.zeros(dimension), build_sensor(configuration)),
            0.0,
            -np.inf,
        )
        for direction, reach, step, own in story:
            own = np.array(own)
            time += step
            bearing = unit_bearing(reach * direction, np.zeros(dimension))
            if time <= latest:
                with pytest.raises(ValueError, match="time must increase, found"):
                    give(tracker, time, bearing, own, reach * direction)
            else:
                give(tracker, time, bearing, own, reach * direction)
                latest = time
            judge(tracker.predict([latest, latest + 0.1, latest + 1.1]))

    once()


def give(tracker, time, bearing, own, line):
    if isinstance(tracker, PositionTracker):
        tracker.update_position(time, own + line)
    else:
        tracker.update(time, bearing, own)


def judge(forecast):
    """Finite means; a covariance that is symmetric and has no negative eigenvalue but round-off, or none at all."""
    mean, covariance = forecast
    assert np.all(np.isfinite(mean))
    if np.all(np.isnan(covariance)):
        return
    assert np.all(np.isfinite(covariance))
    np.testing.assert_allclose(covariance, np.swapaxes(covariance, 1, 2), rtol=1e-9, atol=1e-12)
    size = np.abs(covariance).max(axis=(1, 2))
    assert np.all(np.linalg.eigvalsh(covariance)[:, 0] >= -1e-9 * size - 1e-12)
