"""Frames: round trips, and each convention against a source outside the package."""

import math
from datetime import UTC, datetime

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gbt_ocp import frames

RNG = np.random.default_rng(5)
CLOSE = 1.0e-9


def same_direction(first, second):
    return np.abs(np.angle(np.exp(1j * (np.asarray(first) - np.asarray(second))))).max()


def test_compass_and_mathematical_angles():
    known = np.deg2rad([[0.0, 90.0], [90.0, 0.0], [180.0, -90.0], [270.0, 180.0], [45.0, 45.0]])
    assert same_direction(frames.compass_to_math(known[:, 0]), known[:, 1]) < CLOSE
    assert same_direction(frames.math_to_compass(known[:, 1]), known[:, 0]) < CLOSE
    angles = RNG.uniform(-20.0, 20.0, 1000)
    assert same_direction(frames.compass_to_math(frames.math_to_compass(angles)), angles) < CLOSE
    compass = frames.math_to_compass(angles)
    assert compass.min() >= 0.0
    assert compass.max() < 2.0 * math.pi
    assert same_direction(frames.wrapped(angles), angles) < CLOSE
    assert np.abs(frames.wrapped(angles)).max() <= math.pi
    assert frames.wrapped(math.pi) == math.pi


def test_angles_from_the_bow():
    # a bow to the north: what lies to starboard lies east
    assert frames.bow_to_earth(-0.5 * math.pi, 0.5 * math.pi) == pytest.approx(0.0)
    angles, yaw = RNG.uniform(-4.0, 4.0, (2, 1000))
    assert np.abs(frames.earth_to_bow(frames.bow_to_earth(angles, yaw), yaw) - angles).max() < CLOSE


@pytest.mark.parametrize("dimension", [2, 3])
def test_axes_north_east_down(dimension):
    north_of_10_east_of_3_down_2 = [10.0, 3.0, 2.0][:dimension]
    assert frames.ned_to_enu(north_of_10_east_of_3_down_2).tolist() == [3.0, 10.0, -2.0][:dimension]
    vectors = RNG.normal(0.0, 1e6, (7, 5, dimension))
    np.testing.assert_array_equal(frames.enu_to_ned(frames.ned_to_enu(vectors)), vectors)
    with pytest.raises(ValueError, match="allowed: "):
        frames.ned_to_enu(np.zeros((3, 4)))


def test_yaw_of_quaternions_is_that_of_scipy():
    turns = Rotation.from_euler("ZYX", RNG.uniform(-1.4, 1.4, (200, 3)))
    assert same_direction(frames.yaw_of_quaternion(turns.as_quat()), turns.as_euler("ZYX")[:, 0]) < CLOSE


def test_utc_and_epochs():
    text = "2026-11-25T12:00:00.250000Z"
    seconds = datetime(2026, 11, 25, 12, 0, 0, 250_000, tzinfo=UTC).timestamp()
    assert frames.seconds_of_utc(text) == seconds
    assert frames.utc_of_seconds(seconds) == text
    for other in ("2026-11-25 12:00:00.25", "2026-11-25T13:30:00.25+01:30", "20261125T120000.250"):
        assert frames.seconds_of_utc(other) == seconds
    for moment in RNG.uniform(-1e9, 4e9, 500):
        assert frames.seconds_of_utc(frames.utc_of_seconds(moment)) == pytest.approx(moment, rel=1e-9, abs=1e-6)
    for wrong in ("12:00:00", "2026-11-25", "25.11.2026 12:00", "now", "", "2026-13-01T00:00:00", "2026-W48-3"):
        with pytest.raises(ValueError, match="allowed: a date and time"):
            frames.seconds_of_utc(wrong)
    with pytest.raises(ValueError, match="allowed: "):
        frames.utc_of_seconds(math.inf)


def test_counts_of_an_epoch_lose_no_more_than_a_number_of_their_size():
    nanoseconds = np.array([1_795_000_000_123_456_789, 250_000_000, -1])
    found = frames.seconds_of_counts(nanoseconds, "ns")
    for number, exact in zip(found, nanoseconds.tolist(), strict=True):
        assert abs(number - exact / 10**9) <= np.spacing(abs(exact / 1e9))
    assert frames.seconds_of_counts([1500.0], "ms")[0] == 1.5
    with pytest.raises(ValueError, match="unit: found 'h'; allowed: s, ms, us, ns"):
        frames.seconds_of_counts([1], "h")


def test_units():
    assert frames.in_si([180.0], "deg")[0] == math.pi
    assert frames.in_si([1_800_000_000], "degE7")[0] == pytest.approx(math.pi, rel=CLOSE)
    assert frames.in_si([18_000], "cdeg")[0] == pytest.approx(math.pi, rel=CLOSE)
    assert frames.in_si([2.0], "km")[0] == 2000.0
    with pytest.raises(ValueError, match="unit: found 'ft'; allowed: rad, deg"):
        frames.in_si([1.0], "ft")


# Geodesy


def places(origin, count=300):
    """Latitudes, longitudes and heights up to some tens of kilometres from an origin in radians."""
    away = RNG.uniform(-0.005, 0.005, (2, count))
    return origin[0] + away[0], origin[1] + away[1] / max(math.cos(origin[0]), 0.1), RNG.uniform(-4000.0, 500.0, count)


ORIGINS = [(1.1066, 0.1815), (0.0, 0.0), (-0.75, 3.1), (1.55, -2.0)]


@pytest.mark.parametrize("origin", ORIGINS)
def test_a_local_plane_there_and_back(origin):
    pytest.importorskip("pymap3d", reason="pymap3d is not installed (extra geodesy)")
    plane = frames.LocalPlane(*origin, -20.0)
    latitude, longitude, height = places(origin)
    positions = plane.to_plane(latitude, longitude, height)
    back = plane.from_plane(positions)
    assert np.abs(back[0] - latitude).max() < CLOSE
    assert same_direction(back[1], longitude) < CLOSE
    assert np.abs(back[2] - height).max() < 1e-8
    assert np.abs(plane.to_plane(*back) - positions).max() < 1e-8
    flat = plane.from_plane(positions[:, :2])
    assert np.abs(plane.to_plane(*flat)[:, 2]).max() < 1e-8


@pytest.mark.parametrize("origin", ORIGINS)
def test_a_local_plane_is_that_of_proj(origin):
    pytest.importorskip("pymap3d", reason="pymap3d is not installed (extra geodesy)")
    pyproj = pytest.importorskip("pyproj", reason="pyproj is not installed")
    pipeline = (
        "+proj=pipeline +step +proj=cart +ellps=WGS84 +step +proj=topocentric +ellps=WGS84 "
        f"+lat_0={math.degrees(origin[0])!r} +lon_0={math.degrees(origin[1])!r} +h_0=-20"
    )
    latitude, longitude, height = places(origin)
    expected = pyproj.Transformer.from_pipeline(pipeline).transform(longitude, latitude, height, radians=True)
    found = frames.LocalPlane(*origin, -20.0).to_plane(latitude, longitude, height)
    assert np.abs(found - np.stack(expected, axis=-1)).max() < 1e-7


def test_north_elsewhere_is_turned_into_the_plane():
    """By a short way to the north and upwards at the other point, as positions in the plane."""
    pytest.importorskip("pymap3d", reason="pymap3d is not installed (extra geodesy)")
    plane = frames.LocalPlane(1.1, 0.2)
    latitude, longitude, _ = places((1.1, 0.2))
    begin = plane.to_plane(latitude, longitude, 0.0)
    for direction, end in (
        ([0.0, 1.0, 0.0], plane.to_plane(latitude + 1e-6, longitude, 0.0)),
        ([0.0, 0.0, 1.0], plane.to_plane(latitude, longitude, 10.0)),
    ):
        step = (end - begin) / np.linalg.norm(end - begin, axis=1, keepdims=True)
        assert np.abs(plane.turned(np.tile(direction, (len(step), 1)), latitude, longitude) - step).max() < 2e-6


def test_a_wrong_origin_is_refused():
    with pytest.raises(ValueError, match=r"latitude: found 63\.4; allowed: a number of radians"):
        frames.LocalPlane(63.4, 10.4)
    with pytest.raises(ValueError, match="allowed: finite numbers"):
        frames.LocalPlane(0.5, math.nan)


def test_without_the_library_the_extra_is_named(monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "pymap3d", None)
    with pytest.raises(ValueError, match=r"latitude and longitude: found no library pymap3d .*gbt_ocp\[geodesy\]"):
        frames.LocalPlane(0.5, 0.1).to_plane(0.5, 0.1)
