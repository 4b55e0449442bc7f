"""At sea: random turns, a turn of the bearing that the vehicle can follow, the first moves, and the standoff kept."""

import warnings
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import gbt_ocp as gbt
from gbt_ocp.experiments.build.desired import orbit_range, reachable_speed, unreachable_bearings
from gbt_ocp.experiments.build.loop import build_loop, build_planner, build_problem, build_vehicle
from gbt_ocp.experiments.config.faults import ConfigurationError
from gbt_ocp.experiments.config.loading import load_config
from gbt_ocp.experiments.recorded_steps import recorded_steps
from gbt_ocp.guidance.pacing import circling_speed, horizontal_radius, turn_period
from gbt_ocp.guidance.startup import CrossFirst, Crossing
from gbt_ocp.guidance.target_limits import RangeLimits
from gbt_ocp.models.bearings import DesiredBearing
from gbt_ocp.models.fossen import FALCON_2D, FALCON_3D, FossenVehicle
from gbt_ocp.models.turning import TurningTarget
from gbt_ocp.models.vehicles import PlanarPointMass
from gbt_ocp.ocp.solvers.base import options_for
from gbt_ocp.simulation.loop import simulate
from gbt_ocp.tracking.protocol import Forecast

FALCON = FossenVehicle(FALCON_2D, (5000.0, 5000.0, 1500.0))
both_dimensions = pytest.mark.parametrize("dimension", [2, 3])


def turning(seed=0, dimension=2, **settings):
    given = {"duration": 300.0, "start": np.zeros(dimension)}
    return TurningTarget(dimension, np.random.default_rng(seed), **(given | settings))


def rates(target, step=0.5):
    """Times, speeds and turn rates by central differences of the position."""
    t = np.arange(step, target.duration - step, step)
    fine = 0.05
    velocity = (target.position(t + fine) - target.position(t - fine)) / (2.0 * fine)
    later = (target.position(t + 3 * fine) - target.position(t + fine)) / (2.0 * fine)
    turned = np.arctan2(
        velocity[:, 0] * later[:, 1] - velocity[:, 1] * later[:, 0], np.sum(velocity[:, :2] * later[:, :2], axis=1)
    )
    return t, np.linalg.norm(velocity[:, :2], axis=1), turned / (2.0 * fine)


def test_the_boat_keeps_its_speed_and_holds_turn_rates_within_bounds():
    drawn, lasting = [], []
    for seed in range(20):
        t, speed, turn = rates(turning(seed))
        np.testing.assert_allclose(speed, 1.0, atol=1e-4)
        assert np.max(np.abs(turn)) < 0.05 + 1e-6
        held = np.flatnonzero(np.abs(np.diff(turn)) < 1e-6)
        changes = t[np.setdiff1d(np.arange(len(t) - 1), held)]
        apart = np.diff(changes)
        lasting += apart[apart > 2.0].tolist()  # a change is seen in one or two differences
        drawn += turn[held].tolist()
    assert min(lasting) > 19.0
    assert max(lasting) < 41.0
    # uniform within the bounds: mean zero, deviation 0.05/√3
    assert abs(np.mean(drawn)) < 0.006
    assert np.std(drawn) == pytest.approx(0.05 / np.sqrt(3.0), rel=0.1)


def test_a_varying_speed_has_the_deviation_and_correlation_it_is_given():
    logs = np.array([np.log(rates(turning(seed, speed_std=0.2, duration=400.0))[1]) for seed in range(60)])
    assert np.mean(logs) == pytest.approx(0.0, abs=0.03)
    assert np.std(logs) == pytest.approx(0.2, rel=0.12)
    lag = 80  # 40 s
    assert np.mean(logs[:, lag:] * logs[:, :-lag]) / np.mean(logs**2) == pytest.approx(np.exp(-1.0), abs=0.12)


def test_the_motion_repeats_and_a_longer_one_continues_it():
    t = np.linspace(0.0, 300.0, 700)
    np.testing.assert_array_equal(turning(3).position(t), turning(3).position(t))
    longer = turning(3, duration=500.0, speed_std=0.2)
    np.testing.assert_allclose(longer.position(t), turning(3, speed_std=0.2).position(t), atol=1e-9)
    assert np.linalg.norm(turning(4).position(100.0) - turning(3).position(100.0)) > 1.0
    with pytest.raises(ValueError, match="the motion lasts from 0 to 300 s"):
        turning(3).position(300.5)


def test_in_space_the_boat_climbs_within_its_bounds():
    target = turning(1, dimension=3, start=[0.0, 0.0, -60.0], climb_rate_max=0.1)
    height = target.position(np.arange(0.0, 300.0, 0.1))[:, 2]
    assert height[0] == -60.0
    assert 0.005 < np.max(np.abs(np.diff(height))) / 0.1 < 0.1 + 1e-9


@pytest.mark.parametrize("vehicle", [FALCON, FossenVehicle(FALCON_3D, (5000.0, 5000.0, 5000.0, 1500.0))])
def test_the_vehicle_keeps_the_circle_it_is_said_to_reach(vehicle):
    """The forward dynamics, which the choice does not use: constant thrust at the limits holds speed and circle."""
    radius, d = 30.0, vehicle.position_dimension
    speed = circling_speed(vehicle, radius)
    n = vehicle.flat_dimension
    z, dz = np.zeros(n), np.zeros(n)
    z[0], dz[1], z[d], dz[d] = radius, speed, np.pi / 2.0, speed / radius
    state = vehicle.state(z, dz)
    # the thrust that keeps body velocities: what the rates lack without any, times the mass
    idle = vehicle.rates(state, np.zeros(n))[n:]
    thrust = -idle * vehicle.parameters.inertia_diagonal
    assert np.max(np.abs(thrust) / vehicle.thrust_max) == pytest.approx(1.0, abs=1e-6)
    turn = turn_period(radius, speed)
    found = solve_ivp(lambda _, x: vehicle.rates(x, thrust), (0.0, turn), state, rtol=1e-10, atol=1e-10)
    np.testing.assert_allclose(np.linalg.norm(found.y[:2], axis=0), radius, atol=1e-5)
    np.testing.assert_allclose(found.y[:2, -1], [radius, 0.0], atol=1e-4)


def test_the_speed_of_a_point_mass_is_that_of_its_drag():
    # across the path the force is m v²/R, along it c v: the larger of the two is the limit
    assert circling_speed(PlanarPointMass(2.0, 4.0, (8.0, 8.0)), 1e6) == pytest.approx(2.0)
    assert circling_speed(PlanarPointMass(2.0, 0.1, (8.0, 8.0)), 1.0) == pytest.approx(2.0)


@both_dimensions
def test_the_turn_is_chosen_from_standoff_and_speed_unless_given(dimension):
    configuration = load_config(f"sea{dimension}d")
    vehicle = build_vehicle(configuration)
    speed = reachable_speed(configuration, vehicle)
    assert speed == pytest.approx(3.4)  # limits.speed; the thrust allows more
    by_clock = ["planner.pieces=2", "tracker.kind=plkf", "desired_bearing.speed_mps=sensor"]
    loop, _ = build_loop(load_config(f"sea{dimension}d", by_clock))
    period = 2.0 * np.pi / loop.desired.rate
    radius = horizontal_radius(dimension, orbit_range(configuration))
    assert period == pytest.approx(2.0 * np.pi * radius / 2.4)
    # the path of a vehicle at that range from a resting target, taken from the desired bearing itself
    t = np.linspace(0.0, period, 4001)
    path = -orbit_range(configuration) * loop.desired(t)
    assert np.max(np.linalg.norm(np.diff(path, axis=0), axis=1)) / t[1] == pytest.approx(2.4, rel=1e-4)
    given = load_config("sea2d", ["desired_bearing.speed_mps=sensor", "desired_bearing.period_s=50"])
    assert given.desired_bearing.period_s == 50.0


def test_a_standoff_alone_asks_for_a_turn_that_fits_it():
    near = load_config({"problem": "case2"})
    far = load_config({"problem": "case2", "limits": {"range": {"nearest_m": 20.0}}})
    given = load_config({"problem": "case2", "limits": {"range": {"nearest_m": 20.0}}, "desired_bearing": {"m": 600}})
    assert (near.desired_bearing.m, near.desired_bearing.period_s) == (10, None)
    assert (far.desired_bearing.m, far.desired_bearing.period_s) == (None, "auto")
    assert (given.desired_bearing.m, given.desired_bearing.period_s) == (600, None)


def test_a_turn_that_cannot_be_followed_is_reported_with_numbers():
    by_clock = "desired_bearing.speed_mps=sensor"
    configuration = load_config("sea2d", [by_clock, "desired_bearing.period_s=30"])
    (line,) = unreachable_bearings(configuration, build_vehicle(configuration))
    assert "needs 8.96 m/s, the vehicle reaches 3.4 m/s" in line
    assert "period_s >= 99.5, or auto" in line
    for reachable in ("desired_bearing.period_s=99.5", "desired_bearing.period_s=auto"):
        assert unreachable_bearings(load_config("sea2d", [by_clock, reachable]), build_vehicle(configuration)) == []
    with pytest.raises(ValueError, match=r"desired_bearing.target_speed: found 4; allowed: a number < 3.4 m/s"):
        build_loop(load_config("sea2d", [by_clock, "desired_bearing.target_speed=4.0"]))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            "tracker.forecast_period_s=0.3",
            "tracker.forecast_period_s: found 0.3; allowed: null, or a piece divided by a whole number",
        ),
        ("tracker.forecast=19", "planner.pieces: found 20; allowed: a whole number from 1 to tracker.forecast = 19"),
        ("target.hold_s=[40, 20]", "target.hold_s: found"),
        ("vehicle.start.range_m=0.0", "vehicle.start.range_m: found 0.0; allowed: null, or a number > 0"),
        ("desired_bearing.period_s=often", "desired_bearing.period_s: found"),
    ],
)
def test_faults_of_a_configuration_at_sea(change, message):
    with pytest.raises(ConfigurationError) as fault:
        load_config("sea2d", [change])
    assert message in str(fault.value)


@both_dimensions
@pytest.mark.parametrize("distance", [10.0, 30.0, 100.0])
def test_the_vehicle_starts_at_the_distance_it_is_told(dimension, distance):
    places = []
    for seed in range(3):
        over = [f"vehicle.start.range_m={distance}", "guidance={kind: static}", "tracker.kind=plkf"]
        loop, start = build_loop(load_config(f"sea{dimension}d", over, seed=seed))
        places.append(start[0, :dimension] - loop.target.position(0.0))
        assert np.linalg.norm(places[-1]) == pytest.approx(distance)
    assert np.linalg.norm(places[0] - places[1]) > 0.01 * distance


class Scripted:
    """The truth with an error that wanders within the covariance it states; the range is unknown at first."""

    def __init__(self, target, seed, deviation=0.03):
        self.target, self.rng = target, np.random.default_rng(seed)
        self.deviation, self.now, self.own = deviation, 0.0, None
        self.error = self.rng.standard_normal(target.dimension)

    def update(self, time, bearing, own_position):
        keep = np.exp(-(time - self.now) / 8.0)
        draw = self.rng.standard_normal(len(self.error))
        self.error = keep * self.error + np.sqrt(1.0 - keep**2) * draw
        self.now, self.own = time, np.asarray(own_position)

    def predict(self, times):
        t = np.asarray(times, dtype=float)
        truth, present = self.target.position(t), self.target.position(self.now)
        line = present - (self.own if self.own is not None else present + 1.0)
        distance, d = np.linalg.norm(line), len(line)
        sight = line / distance
        share = self.deviation + 0.5 * np.exp(-self.now / 5.0)
        covariance = (0.005 * distance) ** 2 * np.eye(d) + (share * distance) ** 2 * np.outer(sight, sight)
        ahead = (0.1 * (t - self.now)) ** 2
        spread = covariance + ahead[:, None, None] * np.eye(d)
        roots = np.linalg.cholesky(spread)
        return Forecast(truth + roots @ self.error, spread)


def sailed(dimension=2, seed=0, duration=70.0, **changes):
    over = [f"duration_s={duration}", "tracker.kind=plkf", *(f"{key}={value}" for key, value in changes.items())]
    loop, start = build_loop(load_config(f"sea{dimension}d", over, seed=seed))
    loop = replace(loop, tracker=Scripted(loop.target, seed))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return simulate(loop, start, duration).arrays


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.long
def test_the_standoff_is_kept_in_closed_loop(dimension):
    run = sailed(dimension, seed=1)
    distance = np.linalg.norm(run["target"] - run["vehicle_pose"][:, :dimension], axis=1)
    assert np.mean(distance < 30.0) < 0.01  # one in a thousand, but errors last for seconds
    assert distance.min() > 29.0
    assert np.median(distance[400:]) < 40.0  # near it, not far away
    yaw = np.unwrap(run["vehicle_pose"][300:, dimension])  # crossing keeps the limits of thrust only
    assert np.max(np.abs(np.diff(yaw))) / 0.1 < np.deg2rad(40.0) * 1.02
    speed = np.linalg.norm(np.diff(run["vehicle_pose"][:, :dimension], axis=0), axis=1) / 0.1
    assert speed.max() < 3.4 * 1.02
    # the bearing turns as it should: both ways, and not much slower than it was asked to
    sight = (run["target"] - run["vehicle_pose"][:, :dimension])[400:, :2]
    turned = np.unwrap(np.arctan2(sight[:, 1], sight[:, 0]))
    steps = np.diff(turned[::10])
    assert np.abs(steps).sum() > 0.4 * 2.0 * np.pi / 80.0 * 30.0  # the forecast jumps; on a quiet one it is 0.9
    assert min(np.sum(steps > 0.0), np.sum(steps < 0.0)) > 0.2 * len(steps)
    if dimension == 3:
        assert run["vehicle_pose"][:, 2].max() < -2.0


@pytest.mark.parametrize("distance", [10.0, 30.0, 100.0])
def test_the_first_moves_cross_the_line_of_sight_and_do_not_come_nearer(distance):
    run = sailed(
        2,
        seed=1,
        duration=12.0,
        guidance="{kind: planner, startup_deviation: 0.05}",
        **{"vehicle.start.range_m": distance},
    )
    first = np.flatnonzero(run["solver_status"] != "")
    until = int(first[0]) if len(first) else len(run["t"])
    assert until > 20  # nothing is planned while the range is a guess
    line = (run["target"] - run["vehicle_pose"][:, :2])[:until]
    distances = np.linalg.norm(line, axis=1)
    assert distances.min() > distance - 0.5  # half a second to get going
    own = np.diff(run["vehicle_pose"][10:until, :2], axis=0) / 0.1
    along = np.sum(own * line[10 : until - 1], axis=1) / distances[10 : until - 1]
    assert np.mean(along < 0.0) > 0.95
    speed = np.linalg.norm(own, axis=1)
    assert np.mean(np.abs(speed - 3.0) < 0.1) > 0.9  # but for the reversal
    across = own[:, 1] * line[10 : until - 1, 0] - own[:, 0] * line[10 : until - 1, 1]
    assert np.all(across[: min(until, 79) - 10] < 0.0)  # in the sense of the desired bearing, for a first leg of 8 s
    assert until <= 81 or np.all(across[95:] > 0.0)


def test_crossing_begins_again_when_the_range_is_lost():
    class Planned:
        desired = DesiredBearing(2, 0.1)
        restarts = 0

        def restart(self):
            self.restarts += 1

        def remember(self, time, flat, forecast):
            pass

        def decide(self, time, flat, forecast):
            return "plan"

    planned = Planned()
    law = CrossFirst(planned, FALCON, 0.1, deviation=0.25, speed=3.0, opening=1.0, leg=8.0)
    answers = []
    for share in (0.5, 0.24, 0.2, 0.26, 0.3, 0.2):
        covariance = np.diag([(share * 40.0) ** 2, 400.0])[None]  # only the spread along the line of sight counts
        answers.append(law.decide(0.0, np.zeros((2, 3)), Forecast(np.array([[40.0, 0.0]]), covariance)))
    assert [isinstance(answer, str) for answer in answers] == [False, True, True, False, False, True]
    assert planned.restarts == 2
    # bearing along x turns counter-clockwise: the vehicle goes to -y, and away
    assert answers[0][1] < 0.0
    assert answers[0][0] < 0.0
    with pytest.raises(ValueError, match=r"guidance.startup_opening: found 3.0; allowed: a number < startup_speed"):
        CrossFirst(planned, FALCON, 0.1, deviation=0.25, speed=3.0, opening=3.0, leg=8.0)


@pytest.mark.long
def test_no_vehicle_flees_without_an_end_from_a_range_that_it_does_not_know():
    """Of seeds 100 to 169, 104 fled along the line of sight to 390 m, its range known to 0.2 to 0.3, for 100 s."""
    found = gbt.run("sea2d", overrides=["duration_s=120"], seed=104)
    distances = np.linalg.norm(found.history.target - found.history.vehicle_pose[:, :2], axis=1)
    assert distances.max() < 150.0
    assert found.summary["relative_error"] < 0.1


def test_crossing_leads_away_from_a_target_that_is_believed_too_near():
    crossing = Crossing(np.array([0.0, 0.0, 1.0]), 0.05, 3.0, 0.2, 8.0, nearest=30.0)

    def away(distance, spread):
        velocity = crossing.step(0.0, np.zeros(2), np.array([distance, 0.0]), np.diag([spread**2, 400.0]))
        assert np.linalg.norm(velocity) == pytest.approx(3.0), "all of the speed is used"
        return -velocity[0]

    assert away(50.0, 30.0) == 0.2, "a range that is not known says nothing"
    assert away(50.0, 5.0) == 0.2, "far enough"
    assert away(36.0, 5.0) == pytest.approx(0.4), "4 m within 10 s"
    assert away(31.0, 4.0) == pytest.approx(0.7)
    assert away(10.0, 2.0) == pytest.approx(2.4), "never without a part across"


def test_a_turn_that_reverses_is_flown_and_recorded_for_the_generated_code():
    changes = ["desired_bearing={reverse_s: 6, period_s: 90, speed_mps: sensor}", "guidance.startup_deviation=0"]
    changes += ["limits.range.margin_m=0", "planner.pieces=10", "vehicle.start.range_m=40", "duration_s=32"]
    changes += [
        "target.speed=0.2",
        "limits.range.confidence=0.5",
        "limits.range.target_speed_max=null",
    ]  # it does not jump
    tracker = "{kind: ekf, initial_range_m: 40, initial_range_std_m: 1, initial_speed_std: 0.3, bearing_std_deg: 1"
    tracker += ", forecast_period_s: 1}"
    configuration = load_config("sea2d", [*changes, f"tracker={tracker}"])
    planner = build_planner(configuration, build_vehicle(configuration))
    steps = recorded_steps(configuration, planner, 30)
    rate = 2.0 * np.pi / 90.0
    senses = []
    for number, step in enumerate(steps):
        line = step["present"].mean - step["state"][0, :2]
        angle = np.unwrap(np.arctan2(*np.vstack([line, step["desired"]]).T[::-1]))
        turned = np.diff(angle) / rate
        # the endpoints are 1 s apart, and so are the plans: legs of six of them
        assert np.all(np.abs(np.abs(turned) - 1.0) < 1e-9)
        senses.append(np.sign(turned[0]))
        assert np.sign(turned[6]) == -senses[-1]
        if number % 6 < 4:
            assert np.sign(turned[1]) == senses[-1]
    assert np.all(np.reshape(senses, (5, 6)) == senses[0] * np.array([1.0, -1.0, 1.0, -1.0, 1.0])[:, None])
    # the vehicle follows: near the middle of each leg but the first it goes round the target in the sense of the leg
    lines = np.array([step["present"].mean - step["state"][0, :2] for step in steps])
    sight = np.unwrap(np.arctan2(lines[:, 1], lines[:, 0]))
    middle = np.arange(9, 30, 6)
    assert np.all(np.sign(sight[middle + 1] - sight[middle - 1]) == np.array(senses)[middle])


@pytest.mark.long
def test_options_of_the_compiled_solver_stay_with_it():
    # the wide tolerances of the sea are of no meaning to IPOPT, which plans the same turn with its own
    far = {"vehicle.start.range_m": 80.0, "planner.solver": "ipopt"}
    run = sailed(2, duration=3.0, guidance="{kind: planner, startup_deviation: 0.0}", **far)
    planned = run["solver_status"] != ""
    assert np.sum(planned) >= 3
    # the first belief may be too wide for the standoff, which then gives
    assert set(run["fallback"][planned]) == {""}


@pytest.mark.parametrize(
    ("solver", "options", "common", "wanted"),
    [
        ("compiled", {"compiled": {"gap": 1.0, "deadline": 9}, "gap": 2.0}, True, {"gap": 2.0, "deadline": 9}),
        ("ipopt", {"compiled": {"gap": 1.0}, "ipopt": {"tol": 1.0}, "max_iter": 5}, True, {"tol": 1.0, "max_iter": 5}),
        ("ipopt", {"compiled": {"gap": 1.0}, "gap": 1.0}, False, {}),
    ],
)
def test_options_belong_to_the_solver_they_are_written_under(solver, options, common, wanted):
    assert options_for(solver, options, common=common) == wanted


def test_options_under_a_solvers_name_are_a_mapping():
    with pytest.raises(ValueError, match=r"solver_options\.ipopt: found 3; allowed: a mapping of option names"):
        options_for("compiled", {"ipopt": 3})


def test_plans_keep_a_margin_that_the_run_is_not_judged_by():
    written = {"problem": "case2", "limits": {"range": {"nearest_m": 20.0, "farthest_m": 50.0, "margin_m": 1.5}}}
    configuration = load_config(written)
    vehicle = build_vehicle(configuration)
    problem = build_problem(configuration, vehicle)
    (limit,) = [one.constraint for one in problem.penalties if isinstance(one.constraint, RangeLimits)]
    assert (limit.nearest, limit.farthest) == (21.5, 48.5)
    assert configuration.standoff == 20.0
