from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import quad

from gbt_ocp.models.targets import MotionTarget, OrbitAngle, TrackTarget, case_target

TRACKS = Path(__file__).resolve().parents[2] / "shared" / "data" / "tracks"
TIMES = np.linspace(0.0, 30.0, 61)


def angle(t):
    """The angle of cases 3 and 6, from its rate alone."""
    return quad(lambda s: 0.3 + 0.2 * np.sin(0.4 * s), 0.0, t, epsabs=1e-12)[0]


# The paper's section 5.2, written out a second time, one point at a time.
PLANE = {
    1: lambda t: (-1.0 + t, -1.0 + t),
    2: lambda t: (
        3.0 * np.cos(np.pi * t / 8) / (1 + np.sin(np.pi * t / 8) ** 2) ** 2,
        1.5 * np.sin(np.pi * t / 4) / (1 + np.sin(np.pi * t / 8) ** 2) ** 2,
    ),
    3: lambda t: (4.0 * np.cos(angle(t)), 4.0 * np.sin(angle(t))),
}
HEIGHT = {4: lambda t: 0.1 * t, 5: lambda t: 3.0 * np.sin(np.pi * t / 8), 6: lambda t: 5.0 * np.sin(0.2 * t) ** 2}


@pytest.mark.parametrize("number", range(1, 7))
def test_case_moves_as_printed(number):
    target = case_target(number)
    assert target.dimension == (2 if number <= 3 else 3)
    for t in TIMES:
        plane = PLANE[number if number <= 3 else number - 3](t)
        expected = plane if number <= 3 else (*plane, HEIGHT[number](t))
        np.testing.assert_allclose(target.position(t), expected, atol=1e-9)
    assert target.position(TIMES).shape == (61, target.dimension)
    np.testing.assert_allclose(target.position(TIMES)[17], target.position(TIMES[17]), atol=1e-12)


def test_abrupt_manoeuvres_are_the_integral_of_the_stepped_turn_rate():
    turn = OrbitAngle(turn_rate_step=0.05, every_s=4.0)
    for t in (0.0, 3.9, 4.0, 5.5, 8.0, 9.0, 12.5, 17.0, 30.0):
        raised = sum(0.05 * max(0.0, min(t, start + 4.0) - start) for start in np.arange(4.0, 30.0, 8.0))
        assert turn(np.array(t)) == pytest.approx(angle(t) + raised, abs=1e-9)
    for number in (3, 6):
        moved = case_target(number, turn_rate_step=0.05, every_s=4.0).position(9.0)[:2]
        np.testing.assert_allclose(moved, 4.0 * np.array([np.cos(angle(9.0) + 0.2), np.sin(angle(9.0) + 0.2)]))


def test_impossible_cases_are_refused():
    with pytest.raises(ValueError, match="1 to 6, found 7"):
        case_target(7)
    with pytest.raises(ValueError, match="cases 3 and 6, found case 2"):
        case_target(2, turn_rate_step=0.1)


def test_a_coordinate_that_stands_still_has_the_shape_of_the_times():
    target = MotionTarget((lambda t: 2.0 * t, lambda t: 5.0))
    np.testing.assert_array_equal(target.position([0.0, 1.0]), [[0.0, 5.0], [2.0, 5.0]])


def recorded():
    t = 100.0 + np.cumsum(np.random.default_rng(0).uniform(0.05, 0.2, 80))
    return t, np.stack([np.sin(0.8 * t), np.cos(0.5 * t), 0.1 * t], axis=-1)


def test_track_runs_through_its_samples_and_smoothly_between():
    t, p = recorded()
    track = TrackTarget(t, p)
    assert track.dimension == 3
    assert track.duration == pytest.approx(t[-1] - t[0])
    np.testing.assert_allclose(track.position(t - t[0]), p, atol=1e-12)
    between = 0.5 * (t[3:-3] + t[4:-2])
    expected = np.stack([np.sin(0.8 * between), np.cos(0.5 * between), 0.1 * between], axis=-1)
    np.testing.assert_allclose(track.position(between - t[0]), expected, atol=1e-4)


def test_scales_start_and_start_time_of_a_track():
    t, p = recorded()
    track = TrackTarget(t, p, length_scale=0.5, time_scale=3.0, start=[1.0, 2.0, 3.0], start_time=2.0)
    plain = TrackTarget(t, p)
    np.testing.assert_allclose(track.position(0.0), [1.0, 2.0, 3.0], atol=1e-12)
    # 1.2 s of the run are 0.4 s of the recording.
    moved = 0.5 * (plain.position(2.4) - plain.position(2.0))
    np.testing.assert_allclose(track.position(1.2) - track.position(0.0), moved, atol=1e-12)
    assert track.duration == pytest.approx(3.0 * (t[-1] - t[0] - 2.0))


def test_a_track_is_not_continued_beyond_its_end():
    track = TrackTarget(*recorded())
    track.position(track.duration)
    with pytest.raises(ValueError, match=r"lasts .* s, asked for"):
        track.position(track.duration + 0.1)
    with pytest.raises(ValueError, match="asked for"):
        track.position(-0.1)


@pytest.mark.parametrize(
    ("times", "positions"),
    [
        ([0.0, 1.0, 2.0], np.zeros((3, 2))),
        ([0.0, 1.0, 2.0, 3.0], np.zeros((3, 2))),
        ([0.0, 1.0, 1.0, 3.0], np.zeros((4, 2))),
        ([0.0, 1.0, 2.0, np.inf], np.zeros((4, 2))),
        ([0.0, 1.0, 2.0, 3.0], np.full((4, 2), np.nan)),
    ],
)
def test_a_faulty_track_is_refused(times, positions):
    with pytest.raises(ValueError, match="track needs"):
        TrackTarget(times, positions)


def test_track_is_read_from_the_columns_it_needs_in_any_order(tmp_path):
    t, p = recorded()
    path = tmp_path / "track.csv"
    np.savetxt(path, np.column_stack([p[:, 1], t, p[:, 0]]), delimiter=",", header="y, t ,x", comments="", fmt="%.17g")
    np.testing.assert_allclose(TrackTarget.from_csv(path, 2).position(t - t[0]), p[:, :2], atol=1e-12)
    with pytest.raises(ValueError, match=r"track\.csv: columns y, t, x; needed are t, x, y, z"):
        TrackTarget.from_csv(path, 3)


@pytest.mark.parametrize("rows", ["0,0,0\n1,one,1\n2,2,2\n3,3,3\n", "0,0,0\n1,1,1\n", "0,0,0\n1,1\n2,2,2\n3,3,3\n"])
def test_a_faulty_file_is_named(tmp_path, rows):
    path = tmp_path / "boat.csv"
    path.write_text("t,x,y\n" + rows, encoding="utf-8")
    with pytest.raises(ValueError, match=r"boat\.csv: "):
        TrackTarget.from_csv(path, 2)


@pytest.mark.parametrize(("row", "count"), [("2,2,2,9", 4), ("2,0,2,5", 4), ("2,2", 2)])
def test_a_row_of_another_width_than_the_header_is_refused_with_its_line(tmp_path, row, count):
    path = tmp_path / "boat.csv"
    path.write_text(f"t,x,y\n0,0,0\n1,1,1\n\n{row}\n3,3,3\n4,4,4\n", encoding="utf-8")
    with pytest.raises(ValueError, match=rf"boat\.csv: line 5: found {count} cells; allowed: 3"):
        TrackTarget.from_csv(path, 2)


def test_a_file_without_rows_is_named(tmp_path):
    path = tmp_path / "boat.csv"
    path.write_text("t,x,y\n", encoding="utf-8")
    with pytest.raises(ValueError, match=r"boat\.csv: no rows below the header"):
        TrackTarget.from_csv(path, 2)


def test_a_start_beyond_the_end_is_refused():
    t, p = recorded()
    with pytest.raises(ValueError, match="start"):
        TrackTarget(t, p, start_time=1000.0, start=[0.0, 0.0, 0.0])


@pytest.mark.parametrize(
    "path", sorted(TRACKS.glob("*.csv")) or [pytest.param(None, marks=pytest.mark.skip(reason="no shared tracks"))]
)
def test_recorded_tracks_can_be_followed_to_their_end(path):
    track = TrackTarget.from_csv(path, 2, length_scale=0.1, start=[3.0, 0.0])
    np.testing.assert_allclose(track.position(0.0), [3.0, 0.0], atol=1e-9)
    samples = track.position(np.arange(0.0, track.duration, 0.1))
    assert np.all(np.isfinite(samples))
    # A tenth of a boat: no spline overshoot between the samples beyond 10 m/s.
    assert np.linalg.norm(np.diff(samples, axis=0), axis=1).max() < 1.0
