"""Vehicles with one target keep apart: on their sides of it, or clear of wherever the others can be."""

import math
from functools import lru_cache

import casadi as ca
import numpy as np
import pytest

import gbt_ocp as gbt
from gbt_ocp.guidance.apart import Apart, KeepApart, OwnSide, sides_of
from gbt_ocp.guidance.others import OtherVehicles, SaidPath
from gbt_ocp.guidance.startup import Crossing
from gbt_ocp.ocp.trajectory import FlatPoint
from gbt_ocp.tracking.protocol import Forecast


@pytest.fixture
def rng():
    return np.random.default_rng(11)


def direction(angle):
    return np.stack([np.cos(angle), np.sin(angle)], axis=-1)


@pytest.mark.parametrize("count", [2, 3, 5, 8])
def test_sides_cut_the_water_round_the_target_into_equal_parts(rng, count):
    starts = rng.normal(0.0, 40.0, (count, 2))
    sides = sides_of(starts)
    assert sides.shape == (count, count - 1, 2)
    assert np.linalg.norm(sides, axis=2) == pytest.approx(np.ones((count, count - 1)))
    for one in range(count):
        for other in range(one):
            assert sides[one, other] == pytest.approx(-sides[other, one - 1])
    around = direction(np.linspace(0.0, 2.0 * math.pi, 3601)[:-1] + 1e-4)
    owners = np.array([np.all(around @ own.T > 0.0, axis=1) for own in sides])
    assert np.all(owners.sum(axis=0) == 1)
    assert owners.sum(axis=1) == pytest.approx(np.full(count, 3600 / count), abs=2)
    deep = np.hstack([starts, rng.normal(0.0, 40.0, (count, 1))])
    assert sides_of(deep)[..., :2] == pytest.approx(sides)
    assert np.all(sides_of(deep)[..., 2] == 0.0)


def test_two_vehicles_have_the_sides_on_which_they_start():
    first, second = np.array([10.0, 5.0]), np.array([-20.0, 45.0])
    line = (first - second) / np.linalg.norm(first - second)
    assert sides_of([first, second]) == pytest.approx(np.array([[line], [-line]]))


@lru_cache
def compiled(limit):
    z = ca.SX.sym("z", 3)
    numbers = {name: ca.SX.sym(name, *shape) for name, shape in limit.shapes.items()}
    return ca.Function("limit", [z, *numbers.values()], [limit.value(FlatPoint(z, z, z), numbers)])


def value_of(limit, place, bound, knot=0):
    return np.array(compiled(limit)([*place, 0.0], *(bound[name][knot] for name in limit.shapes))).ravel()


def test_who_keeps_the_limit_is_apart_from_who_keeps_it_too(rng):
    """Of places drawn at random, with balls that hold the other vehicle: no two that keep it are too near."""
    limit, kept, by_side, by_ball = KeepApart(2, 10.0, nearest=30.0), 0, 0, 0
    for _ in range(400):
        target, angle = rng.normal(0.0, 100.0, 2), rng.uniform(0.0, 2.0 * math.pi)
        places = target + rng.uniform(30.0, 45.0, (2, 1)) * direction(angle + rng.uniform(0.0, 1.2, 2))
        side = direction(rng.uniform(0.0, 2.0 * math.pi))
        radii = rng.uniform(0.0, 25.0, 2)
        centres = places[::-1] + radii[:, None] * rng.uniform(0.0, 1.0) * direction(rng.uniform(0.0, 6.3, 2))
        forecast = Forecast(np.tile(target, (1, 1)), np.zeros((1, 2, 2)))
        values = []
        for own, sign in ((0, 1.0), (1, -1.0)):
            apart = Apart(sign * side[None], centres[own][None], np.full((1, 2), radii[own]))
            data = {"apart": apart, "present": Forecast(target, np.zeros((2, 2))), "forecast": forecast}
            values.append(value_of(limit, places[own], limit.bind(1, data))[0])
            clear = np.linalg.norm(places[own] - centres[own]) >= radii[own] + 10.0
            line = places[own] - target
            sided = sign * side @ line / np.linalg.norm(line) >= 10.0 / 60.0
            # it is rounded off where both hold by about as much
            assert values[-1] < 1.0 or clear or sided
            by_ball, by_side = by_ball + (values[-1] >= 1.0 and not sided), by_side + (values[-1] >= 1.0 and not clear)
        if min(values) >= 1.0:
            kept += 1
            assert np.linalg.norm(places[0] - places[1]) >= 10.0 - 1e-9
    assert min(kept, by_side, by_ball) > 15


def test_a_side_is_kept_with_the_spread_of_the_direction_and_not_of_the_range():
    limit = KeepApart(2, 10.0, nearest=30.0, confidence=0.99)
    apart = Apart(np.array([[0.0, 1.0]]), np.full((1, 2), np.nan), np.full((1, 2), np.inf))
    forecast = Forecast(np.zeros((1, 2)), np.zeros((1, 2, 2)))

    def value(place, covariance):
        data = {"apart": apart, "present": Forecast(np.zeros(2), covariance), "forecast": forecast}
        return value_of(limit, place, limit.bind(1, data))[0]

    # 40 m away along the border: what is along the line of sight counts nothing, what is across it in full
    asked = 40.0 * 10.0 / 60.0
    assert value([40.0, 0.0], np.diag([900.0, 0.0])) == pytest.approx(0.0, abs=0.03)
    assert value([40.0, 0.0], np.diag([0.0, 4.0])) == pytest.approx(-2.326 * 2.0 / asked, abs=0.03)
    assert value([0.0, 40.0], np.diag([1.0, 900.0])) == pytest.approx(40.0 / asked, abs=0.03)


def test_the_ball_of_another_vehicle_grows_with_the_age_of_what_was_heard():
    others = OtherVehicles(np.array([[1.0, 0.0], [0.0, 1.0]]), speed=4.0)
    assert np.all(np.isinf(others.apart(0.0, [0.0, 1.0]).radii))
    others.hear(1, SaidPath(3.0, 5.0, np.array([[7.0, 8.0]] * 5)))
    centres, radii = others.apart(5.0, [5.0, 6.0, 25.0])[1:]
    assert np.isnan(centres[0]).all()
    assert np.array_equal(centres[1], [7.0, 8.0])
    assert np.array_equal(radii, [[np.inf] * 3, [8.0, 12.0, 88.0]])
    others.speed = None
    assert np.all(np.isinf(others.apart(5.0, [5.0]).radii))
    bound = KeepApart(2, 10.0, count=2).bind(
        1, {"apart": others.apart(5.0, [5.0, 6.0]), "present": Forecast(np.zeros(2), np.eye(2)),
            "forecast": Forecast(np.zeros((1, 2)), np.eye(2)[None])},
    )  # fmt: skip
    assert all(np.all(np.isfinite(values)) for values in bound.values())
    with pytest.raises(ValueError, match="distance: found 0"):
        KeepApart(2, 0.0)
    with pytest.raises(ValueError, match=r"confidence: found 1; allowed: a number in \[0\.5, 1\)"):
        KeepApart(2, 1.0, confidence=1)


def crossed(angles, seconds, sine=10.0 / 60.0):
    """Directions from the target of two vehicles that cross, in steps of a tenth of a second ``(K, 2)``."""
    target, places = np.zeros(2), 40.0 * direction(np.array(angles))
    own_sides = [OwnSide(side, sine) for side in sides_of(places)]
    legs = [Crossing(np.array([0.0, 0.0, 1.0]), 0.25, 3.0, 1.2, 8.0) for _ in places]
    found = []
    for k in range(round(10 * seconds)):
        for n, (side, leg) in enumerate(zip(own_sides, legs, strict=True)):
            begins = not leg.crossing
            velocity = leg.step(0.1 * k, places[n], target, 900.0 * np.eye(2))
            if side.asks_back(places[n], velocity, target, begins):
                leg.turn_back(0.1 * k)
                velocity = leg.step(0.1 * k, places[n], target, 900.0 * np.eye(2))
            places[n] = places[n] + 0.1 * velocity
        found.append(np.arctan2(places[:, 1], places[:, 0]))
    return np.array(found)


@pytest.mark.parametrize("apart", [3.1415, 3.0, 2.2, 0.9, 0.4])
def test_vehicles_that_cross_turn_towards_right_angles_to_each_other(apart):
    turned = crossed([0.3, 0.3 + apart], 5.0)
    angle = np.arccos(np.clip(np.cos(turned[:, 0] - turned[:, 1]), -1.0, 1.0))
    assert abs(angle[-1] - 0.5 * math.pi) < abs(apart - 0.5 * math.pi) - 0.2


def test_a_vehicle_that_crosses_turns_back_before_it_leaves_its_side():
    angles = [0.9, 0.9 + 0.5]
    turned, sides = crossed(angles, 60.0), sides_of(40.0 * direction(np.array(angles)))
    shares = np.stack([direction(turned[:, n]) @ sides[n, 0] for n in range(2)])
    assert shares[:, 0] == pytest.approx(np.full(2, math.sin(0.25)), abs=0.02)
    assert shares.min() > 10.0 / 60.0 - 1e-3


@pytest.mark.long
def test_vehicles_that_never_hear_each_other_stay_apart():
    """Before there were sides these two met within 0.2 m, on the same circle in opposite senses."""
    result = gbt.run("sea2d_two", overrides=["duration_s=30", "link.loss=1.0"], seed=13)
    assert result.summary["team"]["steps_below_separation"] == 0
