"""The pilot: inputs in any order, late, twice, wrong; saved, loaded, recorded and repeated."""

import json
import math
from functools import cache

import numpy as np
import pytest
from scipy.interpolate import CubicHermiteSpline

import gbt_ocp as gbt
from gbt_ocp.cli.main import main
from gbt_ocp.experiments.build.pilot import build_pilot
from gbt_ocp.experiments.pilot_record import command_as_json
from gbt_ocp.models import Mounting, case_target
from gbt_ocp.pilot.own_track import OwnState, OwnTrack, earth_rates
from gbt_ocp.pilot.skeleton import Skeleton

LIGHT = ("guidance.kind=random", "tracker.kind=ekf")
"""A configuration whose pilot costs little."""

PERIOD = 0.1


@cache
def loaded(name, overrides):
    return gbt.load_config(name, list(overrides))


def made(*overrides, name="case2", **more):
    return gbt.Pilot(loaded(name, (*LIGHT, *overrides)), **more)


def pose_at(t):
    """A vehicle that circles at 1 m/s on a radius of 4 m, bow along the path."""
    a = 0.25 * t
    return np.array([4.0 * math.cos(a), 4.0 * math.sin(a), a + 0.5 * math.pi]), np.array([1.0, 0.0, 0.25])


def target_at(t):
    return np.array([12.0 + 0.5 * t, 3.0 - 0.2 * t])


def seen_at(t, sensor="mast", std=None):
    x, y = target_at(t) - pose_at(t)[0][:2]
    return gbt.Measurement(t, "azimuth", math.atan2(y, x), std, sensor)


def flown(pilot, times, measured=True):
    """Commands of a pilot whose inputs come in the order of time."""
    commands = []
    for t in times:
        pilot.navigate(t, *pose_at(t))
        if measured:
            pilot.measure(seen_at(t))
        commands.append(pilot.command(t))
    return commands


def tracked(pilot, t):
    return pilot.command(t).forecast


# ---- the own track ------------------------------------------------------------------------------------------------


def test_between_navigations_the_pose_is_the_cubic_of_scipy():
    rng = np.random.default_rng(0)
    times, poses, rates = np.cumsum(rng.uniform(0.1, 0.9, 5)), rng.normal(size=(5, 4)), rng.normal(size=(5, 4))
    track = OwnTrack(late=10.0, gap=1.0, dimension=2)
    for t, pose, rate in zip(times, poses, rates, strict=True):
        assert track.add(OwnState(t, pose, rate), -math.inf) == "taken"
    spline = CubicHermiteSpline(times, poses, rates)
    for t in rng.uniform(times[0], times[-1], 40):
        found = track.at(t)
        assert found.pose == pytest.approx(spline(t), abs=1e-12)
        assert found.rates == pytest.approx(spline(t, 1), abs=1e-11)
    assert track.at(times[2]).pose is track.at(times[2]).pose  # what was navigated, to the last bit
    assert track.at(times[-1] + 0.5).pose == pytest.approx(poses[-1] + 0.5 * rates[-1])
    assert track.at(times[-1] + 30.0).pose == pytest.approx(poses[-1] + 1.0 * rates[-1])  # no longer than a gap
    assert track.at(times[0] - 0.1) is None


def test_the_yaw_goes_the_short_way_round():
    track = OwnTrack(late=10.0, gap=1.0, dimension=2)
    for t, yaw in ((0.0, 3.1), (1.0, -3.1)):
        track.add(OwnState(t, np.array([0.0, 0.0, yaw]), np.array([0.0, 0.0, 0.0832])), -math.inf)
    assert math.cos(track.at(0.5).pose[2]) == pytest.approx(-1.0, abs=1e-3)


def test_rates_in_the_earth_frame_are_those_of_finite_differences():
    h = 1e-6
    numeric = (pose_at(1.0 + h)[0] - pose_at(1.0 - h)[0]) / (2.0 * h)
    assert earth_rates(*pose_at(1.0), 2) == pytest.approx(numeric, abs=1e-8)


# ---- order, lateness, doubles, gaps, steps, numbers that are none ---------------------------------------------------


@pytest.mark.parametrize("kind", ["ekf", "imm_ekf", "gp", "motion_gp", "plkf"])
def test_measurements_in_any_order_give_the_track_of_those_in_order(kind):
    """Late by up to a second; at the end the tracker knows what one knows that has had them in order."""
    times = PERIOD * np.arange(1, 61)
    config = loaded("sea2d" if kind == "motion_gp" else "case2", ("guidance.kind=random", f"tracker.kind={kind}"))
    pilots = [gbt.Pilot(config) for _ in range(2)]
    rng = np.random.default_rng(1)
    arrival = times + np.where(rng.random(60) < 0.3, rng.uniform(0.0, 1.0, 60), 0.0)
    arrival[-15:] = times[-15:]
    forecasts, answers = [], set()
    for pilot, due in zip(pilots, (times, arrival), strict=True):
        pilot.navigate(0.0, *pose_at(0.0))
        for t in times:
            pilot.navigate(t, *pose_at(t))
            for k in np.flatnonzero((due > t - PERIOD + 1e-9) & (due <= t + 1e-9)):
                answers.add(pilot.measure(seen_at(times[k])))
            pilot.command(t)
        forecasts.append(tracked(pilot, times[-1]))
    assert answers == {"taken", "late"}
    assert pilots[0]._piloting._intake.latest == pilots[1]._piloting._intake.latest
    # trackers that tune or iterate start from their last estimate, which is another one after another order
    exact = kind in ("ekf", "imm_ekf", "plkf")
    assert forecasts[1].mean == pytest.approx(forecasts[0].mean, rel=1e-12 if exact else 2e-2)
    assert forecasts[1].covariance == pytest.approx(forecasts[0].covariance, rel=1e-12 if exact else 0.3, abs=1e-4)


def test_a_late_measurement_changes_the_track_and_one_that_is_too_old_does_not():
    answers, means = [], []
    for late in (None, 2.95, 0.5):
        pilot = made()
        flown(pilot, PERIOD * np.arange(40))
        answers.append(None if late is None else pilot.measure(seen_at(late, "other")))
        means.append(flown(pilot, [4.0])[0].forecast.mean)
    assert answers == [None, "late", "too old"]
    assert np.array_equal(means[0], means[2])
    assert not np.array_equal(means[0], means[1])


def test_without_lateness_what_is_late_is_refused():
    pilot = made("pilot.late_s=0")
    flown(pilot, PERIOD * np.arange(5))
    assert pilot.measure(seen_at(0.35, "other")) == "too old"


def test_what_is_there_twice_counts_once():
    once, twice = made(), made()
    flown(once, PERIOD * np.arange(30))
    for t in PERIOD * np.arange(30):
        assert [twice.navigate(t, *pose_at(t)), twice.navigate(t, *pose_at(t))] == ["taken", "duplicate"]
        assert [twice.measure(seen_at(t)), twice.measure(seen_at(t))] == ["taken", "duplicate"]
        assert twice.command(t) is twice.command(t)
    assert np.array_equal(once.command(3.0).forecast.mean, twice.command(3.0).forecast.mean)
    assert twice.command(3.0).health.received == {"duplicate": 60}


def test_a_bearing_waits_for_its_navigation_and_is_placed_between_two():
    pilot, exact = made(), made()
    flown(pilot, [0.0, 0.5, 1.0])
    flown(exact, [0.0, 0.5, 1.0])
    assert pilot.measure(seen_at(1.25, "other")) == "waiting"
    assert pilot.command(1.3).health.waiting == 1
    for one in (pilot, exact):
        one.navigate(1.5, *pose_at(1.5))
    before = exact.command(1.6).forecast
    after = pilot.command(1.6)
    assert after.health.waiting == 0
    assert after.health.bearing_age == pytest.approx(0.35)
    assert not np.array_equal(before.mean, after.forecast.mean)
    placed = pilot._piloting._own.at(1.25).pose
    assert placed == pytest.approx(pose_at(1.25)[0], abs=2e-5)  # h⁴/384 |p''''|


def test_in_a_gap_of_navigation_nothing_is_placed():
    pilot = made()
    flown(pilot, [0.0, 0.1])
    assert pilot.navigate(1.6, *pose_at(1.6)) == "ahead"  # until another one confirms the step
    assert pilot.navigate(1.7, *pose_at(1.7)) == "taken"
    assert pilot.measure(seen_at(0.9)) == "no navigation"
    assert pilot.measure(seen_at(1.65)) == "taken"


def test_a_clock_that_steps_forward_for_one_message_changes_nothing():
    steady, stepped = made(), made()
    wanted = flown(steady, PERIOD * np.arange(20))
    first = flown(stepped, PERIOD * np.arange(10))
    assert stepped.navigate(1e6, *pose_at(0.0)) == "ahead"
    assert stepped.measure(seen_at(1e6)) == "ahead"
    found = [*first, *flown(stepped, PERIOD * np.arange(10, 20))]
    assert all(np.array_equal(a.thrust, b.thrust) for a, b in zip(wanted, found, strict=True))


def test_a_clock_that_stays_ahead_goes_on_there():
    pilot = made()
    flown(pilot, PERIOD * np.arange(10))
    assert [pilot.navigate(100.0 + t, *pose_at(t)) for t in (0.0, 0.1, 0.2)] == ["ahead", "taken", "taken"]
    assert pilot.measure(seen_at(100.1)) == "taken"
    assert pilot.command(100.2).health.bearing_age == pytest.approx(0.1)


def test_a_clock_that_steps_back_is_refused_and_said():
    pilot = made()
    last = flown(pilot, 100.0 + PERIOD * np.arange(10))[-1]
    assert pilot.navigate(50.0, *pose_at(50.0)) == "too old"
    assert pilot.measure(seen_at(50.0)) == "too old"
    command = pilot.command(50.0)
    assert command.health.notes[0] == "time stepped back"
    assert np.array_equal(command.thrust, last.thrust)
    assert command.health.received == {}  # of the last command, which is given again
    assert pilot.command(101.0).health.received == {"too old": 2}


def test_numbers_that_are_none_are_refused():
    pilot = made()
    flown(pilot, PERIOD * np.arange(5))
    pose, velocity = pose_at(0.5)
    assert pilot.navigate(math.nan, pose, velocity) == "not finite"
    assert pilot.navigate(0.5, [math.nan, 0.0, 0.0], velocity) == "not finite"
    assert pilot.navigate(0.5, pose, [0.0, math.inf, 0.0]) == "not finite"
    assert pilot.navigate(0.5, pose, velocity, -np.eye(3)) == "not finite"
    assert pilot.navigate(0.5, pose, [1e300, 0.0, 0.0]) == "not finite", "whose drag is no number"
    with pytest.raises(ValueError, match="time: found nan; allowed: a finite number"):
        pilot.command(math.nan)
    with pytest.raises(ValueError, match=r"pose: found .*; allowed: numbers of shape \(3,\)"):
        pilot.navigate(0.5, [0.0, 0.0], velocity)
    with pytest.raises(ValueError, match="value"):
        gbt.Measurement(0.5, "azimuth", math.nan)
    assert pilot.command(0.5).health.received == {"not finite": 5}


def test_what_the_tracker_does_not_take_is_counted():
    pilot = made()
    flown(pilot, PERIOD * np.arange(5))
    assert pilot.measure(gbt.Measurement(0.35, "position", [1.0, 2.0], sensor="fix")) == "late"
    assert pilot.command(0.5).health.received == {"late": 1, "refused": 1}


def test_angles_from_the_bow_give_the_track_of_angles_from_the_earth():
    """The same sensor, whose angles are counted in two ways; an interpolated yaw counts as well."""
    forecasts = []
    for frame in ("earth", "bow"):
        pilot = made()
        pilot.navigate(-0.05, *pose_at(-0.05))
        for t in PERIOD * np.arange(40):
            pilot.navigate(t + 0.05, *pose_at(t + 0.05), 0.01 * np.eye(3))
            pose, _ = pose_at(t)
            x, y = target_at(t) - pose[:2] - 1.5 * np.array([math.cos(pose[2]), math.sin(pose[2])])
            angle = math.atan2(y, x) - pose[2] * (frame == "bow")
            assert (
                pilot.measure(gbt.Measurement(t, "azimuth", angle, None, "eye", frame, Mounting((1.5, 0.0)))) == "taken"
            )
            command = pilot.command(t + 0.05)
        forecasts.append(command.forecast.mean)
    assert forecasts[1] == pytest.approx(forecasts[0], abs=1e-4)


# ---- commands -------------------------------------------------------------------------------------------------------


def test_before_the_first_navigation_there_is_no_thrust_and_a_note():
    command = made().command(0.0)
    assert not np.any(command.thrust)
    assert (command.forecast, command.plan, command.setpoint) == (None, None, None)
    assert command.health.notes == ("no navigation", "no bearing")


def test_between_decisions_the_plan_is_followed_on():
    """At five times the rate the guidance decides as often, and the setpoint runs along the plan."""
    pilot = gbt.Pilot("case2")
    times, commands = 0.02 * np.arange(31), []
    pose, velocity = np.array([3.0, -4.0, 0.0]), np.zeros(3)
    for t in times:
        pilot.navigate(t, pose, velocity)
        pilot.measure(gbt.Measurement.of_direction(t, case_target(2).position(t) - pose[:2]))
        commands.append(pilot.command(t))
        plan, since = commands[-1].plan, t + 0.02 - commands[-1].decided.time
        z, dz = plan(since), plan(since, 1)
        pose, velocity = z, earth_rates(-z, dz, 2)
    decided = [command.decided.time for command in commands]
    assert sorted(set(decided)) == pytest.approx(0.1 * np.arange(7))
    for command in commands:
        ahead = command.plan(command.time - command.decided.time + 0.1)
        assert command.setpoint.time == pytest.approx(command.time + 0.1)
        assert command.setpoint.pose == pytest.approx(ahead, abs=1e-9)
        assert np.all(np.abs(command.thrust) <= [5000.0, 5000.0, 1500.0])
        assert command.health.planner == "solved"


def test_where_the_vehicle_is_off_its_plan_the_thrust_leads_back():
    pilots = [gbt.Pilot("case2") for _ in range(2)]
    for pilot in pilots:
        pilot.navigate(0.0, [3.0, -4.0, 0.0], np.zeros(3))
        pilot.measure(gbt.Measurement.of_direction(0.0, [-1.0, 1.0]))
        start = pilot.command(0.0)
        pilot.command(0.02)
    z, dz = start.plan(0.04), start.plan(0.04, 1)
    thrusts = []
    for pilot, off in zip(pilots, (0.0, 0.2), strict=True):
        pilot.navigate(0.04, z + np.array([off, 0.0, 0.0]), earth_rates(-z, dz, 2))
        thrusts.append(pilot.command(0.04).thrust)
    assert thrusts[1][0] < thrusts[0][0]


def test_a_lost_track_is_said():
    pilot = made()
    flown(pilot, PERIOD * np.arange(40))
    assert not pilot.command(3.9).health.track_lost
    for t in PERIOD * np.arange(40, 70):
        pilot.navigate(t, *pose_at(t))
        x, y = pose_at(t)[0][:2] - target_at(t)  # from behind
        pilot.measure(gbt.Measurement(t, "azimuth", math.atan2(y, x) + 0.3 * math.sin(7.0 * t)))
        command = pilot.command(t)
    assert "track lost" in command.health.notes


@pytest.mark.parametrize("name", ["case2", "sea2d"])
def test_in_an_ordinary_run_there_are_no_notes_after_the_start(name):
    pilot = gbt.Pilot(name, overrides=["vehicle.start.position_m=[3, -4]"])
    pose, velocity, target = np.array([3.0, -4.0, 0.0]), np.zeros(3), case_target(2)
    notes = set()
    for t in PERIOD * np.arange(60):
        pilot.navigate(t, pose, velocity)
        pilot.measure(gbt.Measurement.of_direction(t, 20.0 * (name == "sea2d") + target.position(t) - pose[:2]))
        command = pilot.command(t)
        if command.setpoint is not None:
            pose, velocity = command.setpoint.pose, command.setpoint.velocity
        notes.update(command.health.notes)
    assert notes <= {"fallback"}


# ---- saved, loaded, recorded ----------------------------------------------------------------------------------------

KINDS = [
    ("case2", ()),
    ("case2", ("planner.solver=ipopt", "planner.formulation=hard")),
    ("sea2d", ("vehicle.follow=dynamics", "vehicle.current=unknown")),
    ("case5", ("tracker.kind=lmc", "guidance.kind=helical")),
    ("case2", ("guidance.kind=random", "tracker.kind=imm_ekf")),
    ("case2", ("guidance.kind=circumnavigation", "tracker.kind=pr")),
]


def driven(pilot, first, count):
    """A simple world, which depends on what the pilot commands: its outputs, as a record has them."""
    found, d = [], pilot.configuration.dimension
    for k in range(first, first + count):
        t = PERIOD * k
        pose = np.array([0.3 * math.cos(t), 0.3 * t, 0.2, 0.1 * t])[[0, 1, *([2] if d == 3 else []), 3]]
        if found and found[-1]["thrust"] is not None:
            pose[0] += 1e-5 * found[-1]["thrust"][0]
        pilot.navigate(t, pose, 0.1 * np.ones(d + 1))
        line = np.array([30.0 + t, 5.0 * math.sin(t), 3.0])[:d] - pose[:d]
        late = 0.07 * (k % 5 == 4)
        pilot.measure(gbt.Measurement.of_direction(t - late, line))
        found.append(command_as_json(pilot.command(t)))
    return found


@pytest.mark.long
@pytest.mark.parametrize(("name", "overrides"), KINDS)
def test_a_pilot_that_was_saved_goes_on_bit_by_bit(name, overrides, tmp_path):
    pilot = gbt.Pilot(loaded(name, overrides))
    driven(pilot, 0, 14)
    again = gbt.Pilot.load(pilot.save(tmp_path / "pilot.zip"))
    assert json.dumps(driven(pilot, 14, 14)) == json.dumps(driven(again, 14, 14))


def test_a_pilot_of_parts_goes_on_with_parts(tmp_path):
    pilots = [gbt.Pilot(build_pilot(loaded("case2", LIGHT)))]
    flown(pilots[0], PERIOD * np.arange(20))
    pilots[0].save(tmp_path / "pilot.zip")
    pilots.append(gbt.Pilot.load(tmp_path / "pilot.zip", build_pilot(loaded("case2", LIGHT))))
    thrusts = [[c.thrust.tolist() for c in flown(one, PERIOD * np.arange(20, 30))] for one in pilots]
    assert thrusts[0] == thrusts[1]
    with pytest.raises(ValueError, match="allowed: parts, for it was made from parts"):
        gbt.Pilot.load(tmp_path / "pilot.zip")


def test_what_is_no_saved_pilot_is_refused(tmp_path):
    (tmp_path / "text").write_text("nothing")
    with pytest.raises(ValueError, match="text: found no saved pilot"):
        gbt.Pilot.load(tmp_path / "text")
    pilot = made()
    pilot.save(tmp_path / "empty.zip")  # before anything came in
    assert gbt.Pilot.load(tmp_path / "empty.zip").command(0.0).health.notes == ("no navigation", "no bearing")
    with pytest.raises(ValueError, match="allowed: none, for it has a configuration"):
        gbt.Pilot.load(tmp_path / "empty.zip", build_pilot(loaded("case2", LIGHT)))


def test_a_record_gives_the_same_again(tmp_path, capsys):
    path = tmp_path / "record.jsonl"
    pilot = gbt.Pilot(loaded("case2", ("duration_s=5",)), record=path)
    driven(pilot, 0, 12)
    pilot.navigate(math.nan, [0.0, math.inf, 0.0], [0.0, 0.0, 0.0], np.eye(3))
    pilot.close()
    assert main(["replay", str(path), "--quiet", "--out", str(tmp_path / "again")]) == 0
    assert "13 navigations, 12 measurements, 12 commands: 37 of 37 answers the same" in capsys.readouterr().out
    assert (tmp_path / "again" / "record.jsonl").read_text() == path.read_text()
    lines = path.read_text().splitlines()
    changed = json.loads(lines[9])
    changed["gives"]["thrust"][0] += 1e-9
    path.write_text("\n".join([*lines[:9], json.dumps(changed), *lines[10:], '{"cut o']))
    assert main(["replay", str(path), "--quiet"]) == 3
    assert "36 of 37 answers the same\nline 10: thrust: found" in capsys.readouterr().out


def test_a_record_of_a_loaded_pilot_begins_where_it_was_saved(tmp_path, capsys):
    pilot = made()
    driven(pilot, 0, 10)
    pilot.save(tmp_path / "pilot.zip")
    again = gbt.Pilot.load(tmp_path / "pilot.zip", record=tmp_path / "record.jsonl")
    driven(again, 10, 10)
    again.close()
    assert main(["replay", str(tmp_path / "record.jsonl"), "--quiet"]) == 0
    pilot.save(tmp_path / "pilot.zip")
    driven(pilot, 10, 1)
    pilot.save(tmp_path / "pilot.zip")
    assert main(["replay", str(tmp_path / "record.jsonl"), "--quiet"]) == 2
    assert "found another" in capsys.readouterr().err


def test_wrong_records_are_one_line_each(tmp_path, capsys):
    path = tmp_path / "record.jsonl"
    made(record=path).close()
    with pytest.raises(FileExistsError):
        made(record=path)
    header = path.read_text()
    for line in ('{"fly": 1}', '{"command": "soon", "gives": {}}', "[]", '{"measure": {"time": 0.0}, "answer": ""}'):
        path.write_text(header + line + "\n")
        assert main(["replay", str(path), "--quiet"]) == 2
        assert capsys.readouterr().err.count("\n") == 1
    assert main(["replay", str(path), "--quiet", "--bearing-from", "x"]) == 2
    assert "--bearing-from: found beside the record of a pilot" in capsys.readouterr().err


# ---- what objects remember ------------------------------------------------------------------------------------------


class Slotted:
    __slots__ = ("numbers",)

    def __init__(self):
        self.numbers = [0.0]


class Whole:
    def __init__(self):
        self.rng, self.parts, self.table = np.random.default_rng(0), [Slotted(), Slotted()], np.zeros(3)
        self.first = self.parts[0]
        self.by_closure = lambda: self.parts[0].numbers

    def live(self):
        self.table += self.rng.random(3)
        self.first.numbers.append(float(self.table.sum()))


@pytest.mark.parametrize("written", [True, False])
def test_what_objects_remember_comes_back_in_place(written):
    one, other = Whole(), Whole()
    skeletons = [Skeleton(), Skeleton()]
    for skeleton, root in zip(skeletons, (one, other), strict=True):
        skeleton.explore(root)
    one.live()
    if written:
        memory = skeletons[0].taken()
        one.live()
        wanted = one.first.numbers
        skeletons[1].put_back(memory)
        other.live()
        assert other.by_closure() == other.first.numbers == wanted
    else:
        memory = skeletons[0].remembered()
        runs = []
        for _ in range(3):  # a state is good for any number of times
            one.live()
            runs.append(list(one.by_closure()))
            skeletons[0].remember(memory)
        assert runs[0] == runs[1] == runs[2] != one.first.numbers
    assert one.parts[0] is one.first


def test_memory_of_other_parts_is_refused():
    one, other = Skeleton(), Skeleton()
    one.explore(Whole())
    other.explore(Slotted())
    with pytest.raises(ValueError, match="memory: found"):
        other.put_back(one.taken())


def test_a_step_on_time_may_end_in_the_next_piece_of_the_plan():
    """A period after a decision that was made shortly before the end of a piece, the vehicle exactly on its plan."""
    pilot = gbt.Pilot("sea2d", overrides=["guidance.startup_deviation=0", "tracker.kind=motion_gp"])
    pilot.navigate(0.0, np.zeros(3), np.zeros(3))
    plan = pilot.command(0.0).plan
    for time in (0.95, 1.05):
        z, dz = plan.trajectory(time), plan.trajectory(time, 1)
        pilot.navigate(time, z, earth_rates(-z, dz, 2))
        command = pilot.command(time)
    assert command.health.planner
    np.testing.assert_allclose(plan.trajectory.after(0.95, 0.1), [plan.trajectory(1.05, k) for k in (0, 1)], atol=1e-12)
    np.testing.assert_allclose(plan.trajectory.after(0.5, 0.1), [plan.trajectory(0.6, k) for k in (0, 1)], atol=1e-12)
