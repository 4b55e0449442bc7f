"""Held turn rates and the mixture in C against numpy: all noises, strays, gaps, lost tracks, wrong bearings."""

import copy
import math
from dataclasses import replace

import numpy as np
import pytest
from test_motion_gp_in_c import SIGMA, bearings, where
from test_polar import sighted

import gbt_ocp as gbt
from gbt_ocp.experiments.build.trackers import build_tracker
from gbt_ocp.experiments.config.faults import ConfigurationError
from gbt_ocp.experiments.config.loading import load_config
from gbt_ocp.models.bearings import rotate_bearing, unit_bearing
from gbt_ocp.models.measurements import Sighting
from gbt_ocp.models.sensors import BearingSensor
from gbt_ocp.ocp.codegen.library import find_compiler
from gbt_ocp.pilot.compiled_bank import CompiledHeldTurnTracker, CompiledMixtureTracker
from gbt_ocp.tracking.held.held_turn import HeldTurnTracker
from gbt_ocp.tracking.intake import take_in
from gbt_ocp.tracking.mixture import MixtureTracker
from gbt_ocp.tracking.polar import ALL_KINDS, WITHOUT_SIZE

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler")

IN_NUMPY = {"held_turn": HeldTurnTracker, "mixture": MixtureTracker}
IN_C = {"held_turn": CompiledHeldTurnTracker, "mixture": CompiledMixtureTracker}


def both_of(d, kind, **keys):
    """The tracker in numpy, and the one in C."""
    problem = "case2" if d == 2 else "case5"
    made = []
    for engine in ("numpy", "compiled"):
        section = {"kind": kind, "engine": engine, "noise": {"std_deg": 1.0}, **keys}
        made.append(build_tracker(load_config({"problem": problem, "tracker": section}).tracker, *AT_START[d]))
    assert type(made[0]) is IN_NUMPY[kind]
    assert type(made[1]) is IN_C[kind]
    return made


AT_START = {d: (where(d, 0.0)[0], BearingSensor(0.1)) for d in (2, 3)}
AHEAD = np.array([-0.83, 0.0, 0.3, 5.0, 11.0, 40.0, 150.0])
"""Behind, on and between the nodes, and beyond all of them; never the mean time of a bin, before and after which other
numbers of components are counted."""


def agree(both, times, within=1e-9):
    """Whether both say the same at times, and of the track."""
    numpy_one, c_one = both
    python, c = (tracker.predict(times) for tracker in both)
    for one in range(len(times)):
        scale = max(1.0, float(np.nanmax(np.abs(python.covariance[one]), initial=0.0)))
        assert np.abs(python.mean[one] - c.mean[one]).max() < within * math.sqrt(scale)
        np.testing.assert_array_equal(np.isnan(c.covariance[one]), np.isnan(python.covariance[one]))
        assert np.nanmax(np.abs(python.covariance[one] - c.covariance[one]), initial=0.0) < within * scale
    assert numpy_one.new_tracks == c_one.new_tracks
    assert numpy_one.restarts == c_one.restarts
    assert numpy_one.range_observable == c_one.range_observable
    if isinstance(numpy_one, MixtureTracker):
        np.testing.assert_allclose(c_one.log_evidence, numpy_one.log_evidence, rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(c_one.weights, numpy_one.weights, atol=1e-10)
        for mine, its in zip(numpy_one.hypotheses_at(times), c_one.hypotheses_at(times), strict=True):
            np.testing.assert_allclose(its, mine, rtol=1e-8, atol=1e-6)


def _long(*values):
    return pytest.param(*values, marks=pytest.mark.long)


VARIANTS = [
    (2, "held_turn", {"range": {"median_m": 60.0}}),
    _long(3, "held_turn", {"noise": {"std_deg": 1.0, "correlated_deg": 0.3, "own_std_m": 0.3}}),
    _long(
        2, "held_turn", {"noise": {"std_deg": 1.5, "estimated": True}, "components": 60, "turn_rate_std": [0.02, 0.06]}
    ),
    _long(3, "held_turn", {"prior": {"position": [2.0, 3.0, -18.0], "std": 6.0}, "gate": None}),
    (2, "mixture", {}),
    _long(3, "mixture", {}),
    _long(2, "mixture", {"members": ["imm_ekf", "held_turn"], "evidence_s": None, "gate": None}),
    _long(
        2, "mixture", {"prior": {"position": [2.0, 3.0], "covariance": [[9.0, 1.0], [1.0, 16.0]]}, "member_bin_s": 0.7}
    ),
    _long(3, "mixture", {"noise": {"std_deg": 1.5, "estimated": True, "correlated_deg": 0.3, "own_std_m": 0.2}}),
]
"""Dimension, kind and keys."""


@pytest.mark.parametrize(("d", "kind", "keys"), VARIANTS)
def test_forecasts_in_c_are_those_of_numpy(d, kind, keys):
    both = both_of(d, kind, **keys)
    agree(both, np.array([-1.0, 0.0, 3.0]))
    known = set()
    for number, (time, bearing, own) in enumerate(bearings(d, np.random.default_rng(d), 14.0)):
        for tracker in both:
            tracker.update(time, bearing, own)
        if number % 9 == 0:
            agree(both, time + AHEAD)
        known.add(both[1].range_observable)
    assert known == {False, True} or "prior" in keys


@pytest.mark.parametrize(("d", "kind"), [(2, "held_turn"), (2, "mixture"), _long(3, "held_turn"), _long(3, "mixture")])
def test_a_gap_begins_a_new_track_and_wrong_bearings_change_nothing(d, kind):
    """A gap of minutes that is bridged, one that is not, times that step back, and numbers that are none."""
    both = both_of(d, kind)
    rng = np.random.default_rng(7)
    wrong = [(math.nan, 0), (0.0, 0), (None, math.nan), (None, 1.1)]
    for number, (time, bearing, own) in enumerate(bearings(d, rng, 12.0)):
        since = time + (100.0 if time > 4.0 else 0.0) + (900.0 if time > 8.0 else 0.0)
        for tracker in both:
            tracker.update(since, bearing, own)
            at, spoilt = wrong[number % 4]
            with pytest.raises(ValueError, match=r"finite|length|increase"):
                tracker.update(since + 0.01 if at is None else at, bearing * spoilt if spoilt else bearing, own)
        if number % 9 == 0:
            agree(both, since + AHEAD)
    assert both[1].new_tracks == 1


@pytest.mark.parametrize("kind", ["held_turn", "mixture"])
def test_a_lost_track_is_begun_again_when_it_is_in_numpy(kind):
    both = both_of(2, kind, noise={"std_deg": 0.3})
    for time, bearing, own in bearings(2, np.random.default_rng(5), 18.0):
        # another target in another direction
        turned = bearing if time < 8.0 else rotate_bearing(bearing, np.array([2.0 * math.sin(3.0 * time)]))
        for tracker in both:
            tracker.update(time, turned, own)
        if time > 8.0:
            agree(both, time + np.array([0.0, 4.0]), 1e-8)
    assert both[1].restarts > 0


def of_all_kinds(d, rng, seconds, sizes=False):
    """Bearings ten times a second that mostly say nothing of their noise, and now and then all else."""
    others = ["range", "position"] + ["elevation", "azimuth", "azimuth_elevation"] * (d == 3) + ["size"] * sizes
    for number, (time, bearing, own) in enumerate(bearings(d, rng, seconds)):
        plain = Sighting.of_bearing(time, bearing, own)
        if number % 5 == 3:
            plain = replace(plain, std=np.full(d - 1, 0.5 * SIGMA) * [1.0, 3.0][: d - 1])
        seen = [plain] if number % 11 else []  # without its bearing a bin may be another's
        if number % 4 == 1:
            kind = others[number // 4 % len(others)]
            std = {"range": 1.0, "position": 2.0, "size": 0.003}.get(kind, 2.0 * SIGMA)
            single = sighted(kind, d, where(d, time)[1], std, time, own, sensor=f"one {number % 3}")
            seen.insert(number % 2, single)
        yield from seen


@pytest.mark.parametrize(
    ("d", "kind", "size"),
    [
        (2, "held_turn", None),
        (2, "held_turn", [3.0, 0.3]),
        _long(2, "mixture", None),
        (2, "mixture", [3.0, 0.3]),
        _long(3, "held_turn", [3.0, 0.3]),
        _long(3, "mixture", [3.0, 0.3]),
    ],
)
def test_measurements_of_all_kinds_in_c_are_those_of_numpy(d, kind, size):
    """With noises of their own, before and after the bearing of their time, and in pauses of the bearings."""
    both = both_of(d, kind, size=size)
    assert both[0].takes == both[1].takes == (WITHOUT_SIZE if size is None else ALL_KINDS)
    for number, one in enumerate(of_all_kinds(d, np.random.default_rng(d), 14.0, sizes=size is not None)):
        if 5.0 < one.time < 7.0 and one.kind.startswith("azimuth"):
            continue
        for tracker in both:
            take_in(tracker, one)
        if number % 9 == 0:
            agree(both, one.time + AHEAD)
    assert both[1].range_observable


@pytest.mark.parametrize("kind", ["held_turn", "mixture"])
def test_both_engines_refuse_the_same_in_the_same_words(kind):
    both = both_of(2, kind)
    taken = list(of_all_kinds(2, np.random.default_rng(1), 2.0))
    wrong = [
        sighted("size", 2, std=0.01, time=3.0),
        sighted("range", 2, time=0.5),
        replace(sighted("range", 2, time=3.0), std=np.array([np.nan])),
        replace(sighted("range", 2, time=3.0), value=np.array([-1.0])),
        replace(sighted("position", 2, time=3.0), value=np.array([np.nan, 0.0])),
    ]
    for tracker in both:
        for one in taken:
            take_in(tracker, one)
    for one in wrong:
        said = []
        for tracker in both:
            with pytest.raises(ValueError, match=r"kind|time|std|value") as caught:
                tracker.take(one)
            said.append(str(caught.value))
        assert said[0] == said[1]
    agree(both, 2.0 + AHEAD)
    with pytest.raises(ValueError, match="platform: found 'second'"):
        take_in(both[1], replace(taken[-1], platform="second", std=np.array([SIGMA]), time=4.0))


def test_a_copy_goes_its_own_way():
    """As for late bearings: what is remembered is put back, and the same bearings give the same numbers."""
    tracker = both_of(2, "mixture")[1]
    samples = list(bearings(2, np.random.default_rng(3), 8.0))
    for sample in samples[:20]:
        tracker.update(*sample)
    state = copy.deepcopy(tracker._c.state)
    latest = tracker._c.latest, tracker._c.taken
    for sample in samples[20:]:
        tracker.update(*sample)
    times = samples[-1][0] + AHEAD
    first = tracker.predict(times)
    tracker._c.state, (tracker._c.latest, tracker._c.taken) = state, latest
    for sample in samples[20:]:
        tracker.update(*sample)
    for mine, again in zip(first, tracker.predict(times), strict=True):
        np.testing.assert_array_equal(mine, again)


def test_the_default_at_sea_is_compiled_and_goes_on_from_what_was_saved(tmp_path):
    """Late bearings set it back; what was saved gives the same numbers as what went on."""
    pilot = gbt.Pilot(gbt.load_config("sea2d", ["guidance.kind=random"]))
    rng = np.random.default_rng(0)

    def step(one, time, value):
        one.navigate(time, [0.1 * time, 0.0, 0.0], [0.1, 0.0, 0.0])
        one.measure(gbt.Measurement(max(time - 0.5 * (round(5 * time) % 3 == 0), 0.0), "azimuth", value))
        return one.command(time).forecast.mean

    assert isinstance(pilot._piloting.parts.tracker, CompiledMixtureTracker)
    values = 0.3 + 0.01 * rng.normal(size=40)
    for number in range(20):
        step(pilot, 0.2 * number, values[number])
    other = gbt.Pilot.load(pilot.save(tmp_path / "pilot"))
    for number in range(20, 40):
        again = step(other, 0.2 * number, values[number])
        assert np.array_equal(step(pilot, 0.2 * number, values[number]), again)


def test_auto_is_numpy_where_there_is_no_c(monkeypatch):
    changes = {"kind": "mixture", "members": ["ekf", "held_turn"]}
    section = load_config({"problem": "case2", "tracker": changes}).tracker
    assert type(build_tracker(section, *AT_START[2])) is MixtureTracker
    monkeypatch.setattr("gbt_ocp.experiments.build.tracker_engine.find_compiler", lambda: None)
    section = load_config({"problem": "case2", "tracker": {"kind": "mixture"}}).tracker
    assert type(build_tracker(section, *AT_START[2])) is MixtureTracker
    with pytest.raises(ConfigurationError, match=r"tracker\.engine: found 'compiled'.*held_turn and imm_ekf"):
        load_config({"problem": "case2", "tracker": {**changes, "engine": "compiled"}})


def test_more_bearings_than_a_bin_can_hold_are_refused():
    tracker = both_of(2, "mixture")[1]
    own, target = where(2, 0.0)
    bearing = rotate_bearing(unit_bearing(target, own), SIGMA * np.ones(1))
    for number in range(256):
        tracker.update(0.001 * number, bearing, own)
    with pytest.raises(ValueError, match="one bearing more than a bin can hold"):
        tracker.update(0.3, bearing, own)
    tracker.update(1.0, bearing, own)
