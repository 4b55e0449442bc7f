"""The tracker by the shape of the motion in C against the one in numpy: all kinds, gaps, lost tracks."""

import math

import numpy as np
import pytest

import gbt_ocp as gbt
from gbt_ocp.models.bearings import rotate_bearing, unit_bearing
from gbt_ocp.models.measurements import Sighting
from gbt_ocp.ocp.codegen.library import find_compiler
from gbt_ocp.pilot.compiled_motion import CompiledMotionTracker
from gbt_ocp.tracking.intake import take_in
from gbt_ocp.tracking.noise import BearingNoise
from gbt_ocp.tracking.priors import LogNormal, PositionPrior
from gbt_ocp.tracking.shape.processes import ShapePrior
from gbt_ocp.tracking.shape.tracker import MotionShapeTracker

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler")

SIGMA = math.radians(1.0)

SMALL = {"turn_stds": (0.02, 0.08), "turn_times": (10.0,), "speed_stds": (0.05, 0.2)}
"""A grid of four points, which numpy fits in a reasonable time."""


def both_of(d, noise=None, prior=None, **keys):
    """The tracker in numpy, and the one in C."""
    settings = {"bin_width": 1.0, "window": 12.0, "memory": 3.0, "gate": 4.0, "reach": 12.0} | keys
    shape = ShapePrior(**(SMALL | (prior or {})))
    noise = BearingNoise(SIGMA) if noise is None else noise
    return [made(d, noise=noise, prior=shape, **settings) for made in (MotionShapeTracker, CompiledMotionTracker)]


def where(d, time):
    """Own position and target, which turns."""
    own = np.array([30.0 * math.cos(0.15 * time), 30.0 * math.sin(0.15 * time), -3.0])[:d]
    return own, np.array([0.9 * time, 6.0 * math.sin(0.06 * time), -20.0 + 2.0 * math.sin(0.1 * time)])[:d]


def bearings(d, rng, seconds, rate=5.0):
    """Noisy bearings, now and then a stray one, every twentieth missed."""
    for number in range(int(seconds * rate)):
        time = number / rate
        own, target = where(d, time)
        noise = SIGMA * rng.normal(size=d - 1) + (0.5 if rng.random() < 0.03 else 0.0)
        if rng.random() > 0.05:
            yield time, rotate_bearing(unit_bearing(target, own), noise), own


def agree(both, times, within=1e-8):
    """Whether both say the same at times, and of the track."""
    python, c = (tracker.predict(times) for tracker in both)
    scale = max(1.0, float(np.abs(python.covariance).max()))
    assert np.abs(python.mean - c.mean).max() < within * math.sqrt(scale)
    assert np.abs(python.covariance - c.covariance).max() < within * scale
    numpy_one, c_one = both
    assert numpy_one.new_tracks == c_one.new_tracks
    assert numpy_one.restarts == c_one.restarts
    assert numpy_one.range_observable == c_one.range_observable
    assert len(numpy_one.hypotheses) == len(c_one.hypotheses)
    for mine, its in zip(numpy_one.hypotheses, c_one.hypotheses, strict=True):
        assert its == pytest.approx(mine, rel=1e-6, abs=1e-9)
    assert c_one.log_evidence == pytest.approx(numpy_one.log_evidence, rel=1e-8, abs=1e-6)


VARIANTS = [
    (2, {}, {}, {}),
    pytest.param(3, {}, {}, {}, marks=pytest.mark.long),
    (2, {"correlated_std": 0.01, "correlation_time": 3.0}, {"kernel": "ou"}, {}),
    pytest.param(3, {"correlated_std": 0.01, "own_std": 0.3}, {}, {}, marks=pytest.mark.long),
    pytest.param(2, {"estimated": True}, {}, {"memory": math.inf, "hypotheses": 1}, marks=pytest.mark.long),
    pytest.param(2, {"own_std": 0.5}, {}, {"gate": math.inf, "window": 10.4, "knot": 1.5}, marks=pytest.mark.long),
]
"""Dimension, and what differs of the noise, the prior and the tracker."""


@pytest.mark.parametrize(("d", "noise", "prior", "keys"), VARIANTS)
def test_forecasts_in_c_are_those_of_numpy(d, noise, prior, keys):
    both = both_of(d, BearingNoise(SIGMA, **noise), prior, **keys)
    worst = 0
    for number, (time, bearing, own) in enumerate(bearings(d, np.random.default_rng(d), 16.0)):
        for tracker in both:
            tracker.update(time, bearing, own)
        if number % 5 == 0:
            behind = [-0.4] if number else []
            agree(both, time + np.array([*behind, 0.0, 0.3, 5.0, 11.0, 40.0]))
            worst = max(worst, len(both[0].hypotheses))
    assert worst > 1 or keys.get("hypotheses") == 1 or d == 3, "near and far motions fit the first bearings"
    assert both[1].range_observable
    times = time + np.array([0.0, 4.0])
    python, c = (tracker.hypotheses_at(times) for tracker in both)
    for mine, its in zip(python, c, strict=True):
        assert its == pytest.approx(mine, rel=1e-6, abs=1e-8)
    assert both[1].motion_at(time) == pytest.approx(both[0].motion_at(time), rel=1e-6, abs=1e-8)


def sightings(d, rng, count):
    """Of all kinds and several sensors, some at one time, some out of order, with a gap of many windows."""
    time = 0.0
    for number in range(count):
        time += rng.choice([0.0, 0.1, 0.25, 0.4]) + (500.0 if number == 2 * count // 3 else 0.0)
        own, target = where(d, time)
        line = target - own
        far, std = float(np.linalg.norm(line)), [math.nan, 0.03][rng.integers(2)]
        azimuth, elevation = math.atan2(line[1], line[0]) + SIGMA * rng.normal(), 0.0
        both = [azimuth]
        if d == 3:
            elevation = math.asin(line[2] / far) + SIGMA * rng.normal()
            both = [azimuth, elevation]
        choices = [
            ("azimuth" if d == 2 else "azimuth_elevation", both, [std] * len(both), "camera", 0.0),
            ("azimuth" if d == 2 else "azimuth_elevation", both, [0.01, 0.05][: len(both)], "other", 0.0),
            ("azimuth", [azimuth], [std], "array", 0.0),
            ("elevation", [elevation], [std], "array", 0.0),
            ("range", [far * (1.0 + 0.05 * rng.normal())], [0.05 * far], "sonar", 0.0),
            ("range", [far], [math.nan], "sonar", 0.0),
            ("size", [2.0 * math.atan(2.5 / far)], [0.01], "eye", 0.0),
            ("position", target + rng.normal(size=d), [1.0, 2.0, 1.5][:d], "radio", 0.0),
            ("azimuth" if d == 2 else "azimuth_elevation", both, [0.02] * len(both), "late", -0.3),
        ]
        kind, value, deviation, sensor, late = choices[
            rng.choice(9, p=[0.4, 0.1, 0.1, 0.05, 0.1, 0.05, 0.1, 0.05, 0.05])
        ]
        yield Sighting(time + late, kind, np.array(value), np.array(deviation), own, sensor)


def taken(tracker, sighting):
    try:
        take_in(tracker, sighting)
    except ValueError:
        return False
    return True


@pytest.mark.parametrize(
    ("d", "size", "known"), [(2, False, True), *(pytest.param(d, True, d == 3, marks=pytest.mark.long) for d in (2, 3))]
)
def test_all_kinds_are_taken_and_refused_as_in_numpy(d, size, known):
    there = where(d, 0.0)[1] + 1.0
    position = PositionPrior(np.zeros(d), there, 9.0 * np.eye(d) + 0.5) if known else None
    both = both_of(d, size=LogNormal(5.0, 0.3) if size else None, position=position)
    refused = 0
    for number, sighting in enumerate(sightings(d, np.random.default_rng([d, size]), 130)):
        answers = [taken(tracker, sighting) for tracker in both]
        # numpy refuses in take_in what is no later than the last bearing; in C an equal time is another sensor's
        assert answers[0] == answers[1], sighting
        refused += not answers[0]
        if number % 7 == 0:
            agree(both, sighting.time + np.array([0.0, 1.0, 8.0]), 1e-7)
    assert 5 < refused < 60
    assert both[1].new_tracks == 1


@pytest.mark.long
def test_a_lost_track_is_begun_again_when_it_is_in_numpy():
    both = both_of(2, memory=math.inf, gate=math.inf)
    rng = np.random.default_rng(5)
    for time, bearing, own in bearings(2, rng, 30.0):
        # another target in another direction
        turned = bearing if time < 12.0 else rotate_bearing(bearing, np.array([2.0 * math.sin(3.0 * time)]))
        for tracker in both:
            tracker.update(time, turned, own)
    agree(both, time + np.array([0.0, 5.0]), 1e-6)
    assert both[1].restarts > 0


def test_the_pilot_goes_on_from_what_was_saved(tmp_path):
    pilot = gbt.Pilot(
        gbt.load_config("sea2d", ["tracker.kind=motion_gp", "tracker.engine=compiled", "guidance.kind=random"])
    )
    rng = np.random.default_rng(0)

    def step(one, time, value):
        one.navigate(time, [0.1 * time, 0.0, 0.0], [0.1, 0.0, 0.0])
        one.measure(gbt.Measurement(time, "azimuth", value))
        return one.command(time).forecast.mean

    values = 0.3 + 0.01 * rng.normal(size=40)
    for number in range(20):
        step(pilot, 0.2 * number, values[number])
    other = gbt.Pilot.load(pilot.save(tmp_path / "pilot"))
    for number in range(20, 40):
        again = step(other, 0.2 * number, values[number])
        assert np.array_equal(step(pilot, 0.2 * number, values[number]), again)
