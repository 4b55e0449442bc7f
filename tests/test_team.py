"""Several vehicles with one target: packets, what trackers and plans make of them, and runs."""

import math
from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

from gbt_ocp.guidance.information import FisherInformation
from gbt_ocp.guidance.others import OtherVehicles, SaidPath
from gbt_ocp.guidance.path_information import MotionInformation
from gbt_ocp.models.bearings import unit_bearing
from gbt_ocp.models.measurements import Sighting
from gbt_ocp.ocp.trajectory import FlatPoint
from gbt_ocp.pilot.late_measurements import OrderedIntake
from gbt_ocp.pilot.online_loop import OnlineLoop
from gbt_ocp.pilot.packets import Packet, SaidBearing, bearings_in, packet_size
from gbt_ocp.pilot.teamwork import Exchange
from gbt_ocp.simulation.channel import Channel
from gbt_ocp.tracking.bins import BearingBins
from gbt_ocp.tracking.noise import BearingNoise
from gbt_ocp.tracking.protocol import Forecast, JointForecast
from gbt_ocp.tracking.shape.tracker import MotionShapeTracker

EAST = np.array([[1.0, 0.0]])


@pytest.fixture
def rng():
    return np.random.default_rng(7)


def random_packet(rng, dimension, bearings, time=123.45):
    place = rng.uniform(-500.0, 500.0, dimension)
    places = place + np.cumsum(rng.uniform(-10.0, 10.0, (5, dimension)), axis=0)
    places[0] = place
    said = []
    for _ in range(bearings):
        line = rng.standard_normal(dimension)
        unit, std = line / np.linalg.norm(line), float(np.exp(rng.uniform(-7.0, -2.0)))
        said.append(SaidBearing(time - rng.uniform(0.0, 20.0), unit, place + rng.uniform(-80.0, 80.0, dimension), std))
    return Packet(3, SaidPath(time, 5.0, places), tuple(said))


@pytest.mark.parametrize(("dimension", "head", "each"), [(2, 31, 9), (3, 43, 13)])
def test_a_packet_has_the_bytes_that_are_stated_and_loses_no_more_than_its_resolution(rng, dimension, head, each):
    packet = random_packet(rng, dimension, 3)
    data = packet.encoded()
    assert len(data) == packet_size(dimension, 3) == head + 3 * each
    assert bearings_in(dimension, 64) == (64 - head) // each
    found = Packet.decoded(data, dimension)
    assert found.sender == 3
    assert found.path.time == pytest.approx(123.45, abs=5e-4)
    assert found.path.step == pytest.approx(5.0)
    assert np.abs(found.path.places[0] - packet.path.places[0]).max() <= 0.0051
    assert np.abs(found.path.places - packet.path.places).max() <= 0.0551
    for one, sent in zip(found.bearings, packet.bearings, strict=True):
        assert one.time == pytest.approx(sent.time, abs=0.0051)
        assert np.abs(one.position - sent.position).max() <= 0.0101
        assert math.acos(min(1.0, float(one.bearing @ sent.bearing))) <= 1.2e-4
        assert abs(math.log(one.std / sent.std)) <= 0.0251


def test_the_bytes_of_a_packet_are_those_of_its_table():
    """Read by hand, without the package's layout."""
    unit = np.array([math.cos(2.0), math.sin(2.0)])
    path = SaidPath(10.0, 4.0, np.array([[1.0, -2.0], [2.0, -2.0], [3.0, -2.0], [4.0, -2.0], [5.0, 8.0]]))
    data = Packet(7, path, (SaidBearing(8.5, unit, np.array([0.5, -1.0]), 0.01),)).encoded()

    def number(first, count, signed=True):
        return int.from_bytes(data[first : first + count], "little", signed=signed)

    assert data[0] == 7
    assert number(1, 4, signed=False) == 10_000
    assert (number(5, 4), number(9, 4)) == (100, -200)
    assert number(13, 2, signed=False) == 1600
    assert [number(15 + 2 * k, 2) for k in range(8)] == [10, 0, 20, 0, 30, 0, 40, 100]
    assert number(31, 2, signed=False) == 150
    assert (number(33, 2), number(35, 2)) == (-50, 100)
    assert number(37, 2) == round(2.0 * 65536 / (2.0 * math.pi))
    assert data[39] == round(math.log(0.01 / 1e-5) / 0.05)


@pytest.mark.parametrize("size", [0, 30, 32, 41])
def test_what_is_no_packet_is_refused(size):
    with pytest.raises(ValueError, match=f"found {size} bytes; allowed: 31 and 9 for each bearing"):
        Packet.decoded(bytes(size), 2)


def test_a_said_path_follows_a_circle_and_then_goes_on_with_the_mean():
    turn, radius = 0.1, 40.0
    times = 5.0 * np.arange(5)

    def circle(t):
        return np.stack([radius * np.cos(turn * t) + 0.5 * t, radius * np.sin(turn * t)], axis=-1)

    path = SaidPath(100.0, 5.0, circle(times))
    inner = np.linspace(0.0, 20.0, 41)
    assert np.linalg.norm(path.at(100.0 + inner) - circle(inner), axis=1).max() < 0.1
    mean = (circle(20.0) - circle(0.0)) / 20.0
    assert path.at([126.0]) == pytest.approx(circle(20.0)[None] + 6.0 * mean)
    assert path.at([90.0]) == pytest.approx(circle(0.0)[None])


def exchange(number=0, size=64, period=10.0, average=2.0, others=None):
    return Exchange(
        number,
        ("one", "two"),
        2,
        packet_bytes=size,
        period=period,
        average=average,
        bearing_std=0.02,
        others=OtherVehicles(EAST) if others is None else others,
    )


def test_a_packet_has_means_of_the_bearings_since_the_last_and_repeats_the_newest_before(rng):
    mine, heard = exchange(), exchange(1)
    target, flat = np.array([30.0, 10.0]), np.zeros((2, 3))
    rows = []
    new = []
    for k in range(301):
        time, own = round(0.1 * k, 10), np.array([0.1 * k, 0.0])
        unit = unit_bearing(target + rng.normal(0.0, 0.2, 2), own)
        rows.append((time, unit, own))
        mine.note(Sighting.of_bearing(time, unit, own))
        mine.note(replace(Sighting.of_bearing(time, -unit, own), platform="two"))
        if k % 100 == 0:
            data = mine.compose(time, flat, None)
            assert len(data) <= 64
            new.append(heard.hear([data, data]))
    # three have room: two new ones and the newest of before, which the other one knows
    assert [len(found) for found in new] == [1, 2, 2, 2]
    assert all(one.platform == "one" for found in new for one in found)
    last = [row for row in rows if 28.0 < row[0] <= 30.0]
    mean = np.mean([row[1] for row in last], axis=0)
    found = new[-1][-1]
    assert found.time == pytest.approx(np.mean([row[0] for row in last]), abs=0.011)
    assert found.bearing @ mean / np.linalg.norm(mean) == pytest.approx(1.0, abs=1e-8)
    assert found.position == pytest.approx(np.mean([row[2] for row in last], axis=0), abs=0.011)
    assert found.std[0] == pytest.approx(0.02 / math.sqrt(len(last)), rel=0.026)


def test_what_a_lost_packet_had_comes_with_the_next_one(rng):
    mine, heard = exchange(period=1.0, average=1.0), exchange(1, period=1.0, average=1.0)
    times = []
    for k in range(41):
        mine.note(Sighting.of_bearing(0.1 * k, np.array([1.0, 0.0]), np.zeros(2)))
        if k % 10 == 0:
            data = mine.compose(0.1 * k, np.zeros((2, 3)), None)
            if k != 20:
                times += [one.time for one in heard.hear([data])]
    # one mean of each second, in the three packets after it
    assert times == sorted(set(times))
    assert len(times) == 5
    assert any(1.0 < time <= 2.0 for time in times)


def test_a_vehicle_hears_where_the_other_will_be_and_refuses_its_own_voice():
    others = OtherVehicles(EAST)
    listener, speaker = exchange(0, others=others), exchange(1)
    flat = np.array([[5.0, 6.0, 0.0], [1.0, -2.0, 0.0]])
    assert np.isnan(others.places(0.0, [1.0])).all()
    listener.hear([speaker.compose(0.0, flat, None)])
    assert others.places(0.0, [4.0])[0, 0] == pytest.approx([9.0, -2.0], abs=0.1)
    with pytest.raises(ValueError, match="found sender 0; allowed: another one of 2 vehicles"):
        listener.hear([listener.compose(0.0, flat, None)])
    with pytest.raises(ValueError, match="packet_bytes: found 39; allowed: at least 40"):
        exchange(size=39)


def test_bearings_of_two_vehicles_never_share_a_bin(rng):
    both, alone = BearingBins(2.0, 20.0), BearingBins(2.0, 20.0)
    for k in range(100):
        row = (0.1 * k, unit_bearing([30.0, 0.0], [0.0, 0.1 * k]), np.array([0.0, 0.1 * k]))
        both.append(*row)
        alone.append(*row)
        if k % 10 == 5:
            both.append(0.1 * k, unit_bearing([30.0, 0.0], [60.0, 1.0]), [60.0, 1.0], same_time=True, platform="two")
    means, known = both.means(), alone.means()
    assert len(means) == 2 * len(known)
    for name in ("times", "bearings", "own_positions", "counts"):
        assert getattr(means.own, name) == pytest.approx(getattr(known, name))
    theirs = means.platforms == 1
    assert means.own_positions[theirs] == pytest.approx(np.tile([60.0, 1.0], (5, 1)))
    # what lasts in the error of one sensor has nothing to do with that of another
    noise = BearingNoise(0.01, correlated_std=0.02)
    covariance = noise.covariance(means, np.ones(len(means)))
    assert np.all(covariance[np.ix_(theirs, ~theirs)] == 0.0)
    assert np.all(covariance[np.ix_(theirs, theirs)] > 0.0)


def seen(time, target, own, rng, std, platform=""):
    unit = unit_bearing(target, own)
    angle = math.atan2(unit[1], unit[0]) + std * rng.standard_normal()
    direction = np.array([math.cos(angle), math.sin(angle)])
    deviation = np.full(1, std)
    return Sighting(time, "azimuth", np.array([angle]), deviation, np.asarray(own), "sonar", direction, platform)


def test_bearings_from_two_places_tell_the_range_at_once(rng):
    """As they cross, by least squares; one vehicle alone does not know it."""
    std = 0.01
    alone, pair = (MotionShapeTracker(2, noise=BearingNoise(std), bin_width=2.0, window=40.0) for _ in range(2))
    far = np.array([0.0, 60.0])
    rows, values, weights = [], [], []
    for k in range(30):
        time = 0.1 * k
        target = np.array([50.0 + 0.5 * time, 20.0])
        own = seen(time, target, [0.0, 0.0], rng, std)
        alone.take(own)
        pair.take(own)
        found = [own]
        if k % 10 == 0:
            found.append(seen(time, target, far, rng, 0.3 * std, "two"))
            pair.take(found[-1])
        for one in found:
            normal = np.array([-one.bearing[1], one.bearing[0]])
            rows.append([*normal, *(normal * (time - 2.9))])
            values.append(normal @ one.position)
            weights.append(1.0 / (one.std[0] * np.linalg.norm(target - one.position)))
    rows, values, weights = map(np.array, (rows, values, weights))
    crossing = np.linalg.lstsq(weights[:, None] * rows, weights * values, rcond=None)[0][:2]
    now = pair.predict([2.9])
    assert np.linalg.norm(now.mean[0] - crossing) < 1.0
    assert np.linalg.norm(now.mean[0] - target) < 1.5
    assert pair.range_observable
    assert not alone.range_observable


class Still:
    """A guidance that stays."""

    def decide(self, time, flat, forecast):
        return np.zeros(3)


@pytest.mark.parametrize("shared", [4, 0])
def test_late_bearings_count_as_if_they_had_been_in_time(rng, shared):
    """Set back and given again, from states that are kept more often than a bearing can be late; also where two
    bearings have the time at which one is kept."""
    trackers = [MotionShapeTracker(2, noise=BearingNoise(0.01), bin_width=2.0, window=40.0) for _ in range(2)]
    kept = [OrderedIntake(OnlineLoop(one, Still(), forecast=1, forecast_period=1.0), 5.0, 1.0) for one in trackers]
    underway = []
    for k in range(60):
        time = 0.1 * k
        own = seen(time, [40.0, time], [0.1 * k, 0.0], rng, 0.01)
        other = seen(time, [40.0, time], [0.0, 50.0], rng, 0.003, "two") if k % 10 == shared else None
        assert kept[0].settle([own] if other is None else [own, other]) == []
        assert kept[1].settle([own]) == []
        underway += [] if other is None else [other]
        if k % 30 == 29:
            assert kept[1].settle(underway) == []
            underway = []
    first, second = (one.predict([6.0, 10.0]) for one in trackers)
    assert np.array_equal(first.mean, second.mean)
    assert np.array_equal(first.covariance, second.covariance)


def sums_at(objective, data, own):
    """The sums of an objective for a vehicle at these places, and its value."""
    bound = objective.bind(len(own), data)
    total = 0.0
    for number, place in enumerate(own):
        parameters = {name: ca.DM(values[number]) for name, values in bound.items()}
        total += objective.accumulated(FlatPoint(ca.DM([*place, 0.0]), ca.DM(3), ca.DM(3)), parameters)
    return np.array(total, dtype=float).ravel()


@pytest.mark.parametrize("kind", ["fisher", "motion"])
def test_a_plan_counts_the_bearings_that_another_vehicle_will_take(rng, kind):
    """Like those of its own from the same places; one that is not heard counts nothing."""
    p = 4
    mean = rng.normal(0.0, 3.0, (p, 2))
    own, other = rng.normal(0.0, 40.0, (p, 2)), rng.normal(0.0, 40.0, (p + 1, 2))
    root = rng.normal(0.0, 1.0, (12, 12))
    path = JointForecast((root @ root.T + np.eye(12)).reshape(6, 2, 6, 2), 0.0, 1e-4)
    data = {"forecast": Forecast(mean, np.tile(np.eye(2), (p, 1, 1))), "past": np.eye(2), "path": path}
    objective = FisherInformation(2, "logdet", 38.0) if kind == "fisher" else MotionInformation(2, p, "trace", 2)
    alone = sums_at(objective, data, own)
    elsewhere = sums_at(objective, data, other[1:])
    nowhere = sums_at(objective, data, np.full((p, 2), 1e9))
    together = sums_at(objective, {**data, "others": other[None]}, own)
    gained = together - alone
    if kind == "fisher":  # the last sum counts the plan's own bearings
        assert gained[-1] == 0.0
        gained, elsewhere, nowhere = gained[:-1], elsewhere[:-1], nowhere[:-1]
    assert gained == pytest.approx(elsewhere - nowhere, rel=1e-6, abs=1e-9)
    assert np.abs(gained).max() > 1e-3
    unheard = np.full((1, p + 1, 2), np.nan)
    assert np.array_equal(sums_at(objective, {**data, "others": unheard}, own), alone)


def test_a_channel_loses_the_share_that_it_is_asked_to_and_is_late_by_its_latency():
    channel = Channel(1.0, 0.5, 0.3, np.random.default_rng(1))
    heard = 0
    for k in range(4000):
        time = 0.25 * k
        if channel.due(time):
            channel.send(time, 0, b"abc", 3)
        for receiver in (1, 2):
            found = channel.arrived(time, receiver)
            heard += len(found)
            assert not found or k % 4 == 2  # 0.3 s is first passed after half a second
    assert channel.sent == 2000
    assert heard == channel.sent - channel.lost
    assert abs(channel.lost - 1000) < 4.0 * math.sqrt(500.0)
    assert channel.largest == 3
    with pytest.raises(ValueError, match=r"loss: found 1\.5"):
        Channel(1.0, 1.5, 0.0, np.random.default_rng(1))
