"""The vehicle that moves beside its model: lag, dead time, forces, factors, against closed forms and SciPy."""

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import gbt_ocp as gbt
from gbt_ocp.experiments.build.loop import Streams, build_loop
from gbt_ocp.models.fossen import FALCON_2D, FALCON_3D, FossenParameters, FossenVehicle
from gbt_ocp.models.vehicles import PlanarPointMass
from gbt_ocp.ocp import FlatTrajectory
from gbt_ocp.ocp.plan import Plan
from gbt_ocp.simulation.flow import SlowProcess
from gbt_ocp.simulation.mover import Mover
from gbt_ocp.simulation.plant import CORRELATION_S, Motion, Plant, scaled

PERIOD = 0.1
STEPS = 10
PLANAR = FossenVehicle(FALCON_2D, [5000.0, 5000.0, 1500.0])
SPATIAL = FossenVehicle(FALCON_3D, [5000.0, 5000.0, 5000.0, 1500.0])


def long_plan(vehicle, strength=0.15, seed=0, pieces=2):
    """A plan whose pieces last ten sampling periods."""
    rng, n = np.random.default_rng(seed), vehicle.flat_dimension
    start = np.vstack([rng.uniform(-2.0, 2.0, n), 0.3 * rng.standard_normal(n)])
    top = strength * rng.uniform(-1.0, 1.0, (pieces, n)) * vehicle.acceleration_scale / STEPS
    return FlatTrajectory(STEPS * PERIOD, start, top)


def as_plan(trajectory, elapsed=0.0):
    return Plan(trajectory, "solved", 0.0, 0.0, np.zeros(trajectory.pieces), 1, 0.0, elapsed=elapsed)


def followed(mover, vehicle, trajectory):
    """Moves over all sampling periods of a plan, each from where the one before ended."""
    state, moves = vehicle.state(*trajectory.start[:2]), []
    for k in range(trajectory.pieces * STEPS):
        moves.append(mover.follow(state, as_plan(trajectory, k * PERIOD)))
        state = moves[-1].state
    return moves


def honest(model, moving, trajectory):
    """States at the ends of the periods under the model's thrust, by another integrator in one sweep a piece."""
    symbols = [ca.SX.sym(name, model.flat_dimension) for name in ("z", "dz", "ddz")]
    inputs = ca.Function("inputs", symbols, [model.inputs(*symbols)])
    state, states = model.state(*trajectory.start[:2]), []
    for piece in range(trajectory.pieces):
        part = trajectory.segment(piece * trajectory.period, trajectory.period)

        def rates(s, x, part=part):
            thrust = np.asarray(inputs(*(part(s, order) for order in range(3)))).ravel()
            return moving.rates(x, np.clip(thrust, -model.thrust_max, model.thrust_max))

        times = PERIOD * np.arange(1, STEPS + 1)
        found = solve_ivp(rates, (0.0, times[-1]), state, t_eval=times, method="DOP853", rtol=1e-10, atol=1e-12)
        states += list(found.y.T)
        state = found.y[:, -1]
    return states


@pytest.mark.parametrize("vehicle", [PLANAR, SPATIAL], ids=["planar", "spatial"])
def test_plan_integration_and_mover_agree_over_a_plan_without_model_error(vehicle):
    trajectory = long_plan(vehicle)
    exact, dynamic = (followed(Mover(vehicle, PERIOD, how), vehicle, trajectory) for how in ("exact", "dynamics"))
    there = honest(vehicle, vehicle, trajectory)
    for k, (one, other, state) in enumerate(zip(exact, dynamic, there, strict=True)):
        planned = trajectory((k + 1) * PERIOD)
        np.testing.assert_allclose(one.flat[0], planned, atol=1e-12)
        np.testing.assert_allclose(other.flat[0], planned, atol=2e-6)
        np.testing.assert_allclose(other.state, state, atol=2e-6)
        assert one.off_plan == 0.0
        assert other.off_plan < 2e-6
    assert not any(move.clipped for move in dynamic)


def test_with_a_model_error_they_part_and_the_vehicle_is_never_put_back():
    trajectory = long_plan(PLANAR)
    heavier = FossenVehicle(scaled(FALCON_2D, mass=1.2, added_mass=1.2, drag=1.2), PLANAR.thrust_max)
    moves = followed(Mover(PLANAR, PERIOD, "dynamics", Plant(heavier)), PLANAR, trajectory)
    there = honest(PLANAR, heavier, trajectory)
    for move, state in zip(moves, there, strict=True):
        np.testing.assert_allclose(move.state, state, atol=2e-6)
    off = np.array([move.off_plan for move in moves])
    by_hand = [np.linalg.norm(state[:2] - trajectory((k + 1) * PERIOD)[:2]) for k, state in enumerate(there)]
    np.testing.assert_allclose(off, by_hand, atol=2e-6)
    # within a piece the distance grows with the square of time: 100 times from the first period to the tenth
    assert 50.0 < off[STEPS - 1] / off[0] < 200.0
    assert off[-1] > off[STEPS - 1] > 1e-3
    led = followed(Mover(PLANAR, PERIOD, "feedback", Plant(heavier)), PLANAR, trajectory)
    assert led[-1].off_plan < 0.5 * off[-1]


def test_after_a_clipped_period_a_vehicle_that_follows_exactly_is_not_put_back_on_the_plan():
    # drag at 6 m/s is beyond the thrust there is, at the 3 m/s at the end of the piece it is not
    start = np.array([[0.0, 0.0, 0.3], 6.0 * np.array([np.cos(0.3), np.sin(0.3), 0.0])])
    trajectory = FlatTrajectory(STEPS * PERIOD, start, -0.5 * start[1][None])
    moves = followed(Mover(PLANAR, PERIOD, "exact"), PLANAR, trajectory)
    assert moves[0].clipped
    assert not moves[-1].clipped
    assert moves[-1].off_plan > 0.1
    for move, state in zip(moves, honest(PLANAR, PLANAR, trajectory), strict=True):
        np.testing.assert_allclose(move.state, state, atol=1e-4)


def test_a_thruster_lags_by_its_time_constant():
    mass, lag, force = 2.0, 0.3, 5.0
    vehicle = PlanarPointMass(mass, 0.0, (10.0, 10.0))
    motion, state = Motion(Plant(vehicle, thrust=[0.9, 1.0], lag=lag)), np.zeros(4)
    for k in range(1, 21):
        state = motion.advance(state, lambda s: np.array([force, 0.0]), PERIOD)
        t = k * PERIOD
        velocity = 0.9 * force / mass * (t - lag * (1.0 - np.exp(-t / lag)))
        np.testing.assert_allclose(state[2:], [velocity, 0.0], atol=1e-8)


@pytest.mark.parametrize("dead", [0.25, 0.04, 0.1])
def test_a_command_acts_after_the_dead_time_whatever_the_sampling(dead):
    vehicle = PlanarPointMass(1.0, 0.0, (10.0, 10.0))
    motion, state = Motion(Plant(vehicle, dead_time=dead)), np.zeros(4)
    given = [3.0, -1.0, 2.0, 0.5, 0.0, -4.0]
    for force in given:
        state = motion.advance(state, lambda s, force=force: np.array([force + s, 0.0]), PERIOD)
    end = len(given) * PERIOD - dead
    velocity = 0.0
    for k, force in enumerate(given):
        lasts = min(max(end - k * PERIOD, 0.0), PERIOD)
        velocity += force * lasts + 0.5 * lasts**2
    np.testing.assert_allclose(state[2], velocity, atol=1e-9)


def test_a_constant_force_pushes_in_the_earth_frame_whatever_the_yaw():
    motion = Motion(Plant(SPATIAL, force=[30.0, -10.0, 5.0, 2.0]))
    state = SPATIAL.state([0.0, 0.0, 0.0, 1.1], np.zeros(4))

    def rates(s, x):
        c, sn = np.cos(x[3]), np.sin(x[3])
        return SPATIAL.rates(x, [c * 30.0 - sn * 10.0, -sn * 30.0 - c * 10.0, 5.0, 2.0])

    found = solve_ivp(rates, (0.0, 2.0), state, rtol=1e-11, atol=1e-12).y[:, -1]
    for _ in range(20):
        state = motion.advance(state, lambda s: np.zeros(4), PERIOD)
    np.testing.assert_allclose(state, found, atol=1e-7)
    assert state[0] > 0.0 > state[1]


def test_the_factors_make_the_vehicle_that_they_say():
    made = scaled(FALCON_2D, mass=1.1, added_mass=1.3, drag=0.7)
    by_hand = FossenParameters(
        1.1 * 116.0, 1.1 * 13.1, np.multiply(1.3, (-167.6, -477.2, -15.9)),
        np.multiply(0.7, (26.9, 35.8, 3.5)), np.multiply(0.7, (241.3, 503.8, 76.9)),
    )  # fmt: skip
    state, thrust = np.array([0.0, 1.0, 0.3, 1.5, -0.4, 0.6]), np.array([400.0, -100.0, 30.0])
    limits = PLANAR.thrust_max
    found = (FossenVehicle(one, limits).rates(state, thrust) for one in (made, by_hand))
    np.testing.assert_allclose(*found, rtol=1e-14)
    with pytest.raises(ValueError, match="mass minus added mass must be positive"):
        scaled(FossenParameters(10.0, 1.0, (5.0, 5.0, 0.0), (1.0,) * 3, (1.0,) * 3), mass=1.0, added_mass=3.0, drag=1.0)


def test_the_slow_force_is_stationary_and_correlated_as_it_says():
    force = SlowProcess(3.0, 2, np.random.default_rng(5), CORRELATION_S)
    drawn = np.array([force(float(k)) for k in range(40_000)])
    # 40,000 s are 1,000 independent pieces of 2 time constants
    np.testing.assert_allclose(drawn.std(axis=0), 3.0, rtol=0.1)
    np.testing.assert_allclose(drawn.mean(axis=0), 0.0, atol=0.5)
    lagged = np.mean(drawn[:-20] * drawn[20:], axis=0) / np.mean(drawn**2, axis=0)
    np.testing.assert_allclose(lagged, np.exp(-20.0 / CORRELATION_S), atol=0.1)
    np.testing.assert_allclose(force(3.25), 0.75 * drawn[3] + 0.25 * drawn[4])
    again = SlowProcess(3.0, 2, np.random.default_rng(5), CORRELATION_S)
    np.testing.assert_array_equal(again(17.5), force(17.5))  # however often it was asked before


def test_a_plant_that_cannot_be_is_refused():
    with pytest.raises(ValueError, match="rng"):
        Plant(PLANAR, force_std=1.0)
    with pytest.raises(ValueError, match=r"lag: found -0\.1; allowed: a number >= 0"):
        Plant(PLANAR, lag=-0.1)
    with pytest.raises(ValueError, match=r"vehicle\.follow: found exact beside a plant"):
        Mover(PLANAR, PERIOD, "exact", Plant(PLANAR))


def random_run(**plant):
    follow = {"follow": "dynamics"} if plant else {}
    return gbt.run(
        {
            "problem": "case1", "duration_s": 2.0, "seed": 3, "vehicle": follow, "plant": plant,
            "sensor": {"noise_deg": 1.0, "missed_probability": 0.3}, "guidance": {"kind": "random"},
            "tracker": {"kind": "plkf"},
        }
    ).history  # fmt: skip


def test_the_disturbance_has_a_stream_of_its_own():
    without, with_force = random_run(), random_run(force_std=200.0)
    for name in ("detected", "thrust", "target"):
        np.testing.assert_array_equal(getattr(with_force, name), getattr(without, name))
    np.testing.assert_array_equal(with_force.vehicle_pose[0], without.vehicle_pose[0])
    assert np.abs(with_force.vehicle_pose[-1] - without.vehicle_pose[-1]).max() > 0.01
    # the measurement's error is the same draw about another line of sight
    angles = []
    for history in (without, with_force):
        line = history.target - history.vehicle_pose[:, :2]
        turned = history.bearing[:, 0] * line[:, 1] - history.bearing[:, 1] * line[:, 0]
        angles.append(np.arcsin(turned / np.linalg.norm(line, axis=1))[history.detected])
    np.testing.assert_allclose(angles[0], angles[1], atol=1e-9)
    first = [stream.random() for stream in vars(Streams.of(3)).values()]
    assert first[:4] == [np.random.default_rng(child).random() for child in np.random.SeedSequence(3).spawn(4)]


def test_the_section_makes_the_plant():
    section = {"mass": 1.2, "thrust": [0.9, 1.0, 0.8], "lag_s": 0.3, "dead_time_s": 0.05, "force": [1.0, 2.0]}
    still = {"problem": "case2", "guidance": {"kind": "static"}}
    given = {**still, "plant": section, "vehicle": {"follow": "feedback", "follow_bandwidth": 3.0}}
    loop, _ = build_loop(gbt.load_config(given))
    plant = loop.plant
    assert loop.follow_bandwidth == 3.0
    assert plant.vehicle.parameters.mass == pytest.approx(1.2 * 116.0)
    assert plant.vehicle.parameters.added_mass == pytest.approx(FALCON_2D.added_mass)
    np.testing.assert_array_equal(plant.thrust, [0.9, 1.0, 0.8])
    assert (plant.lag, plant.dead_time) == (0.3, 0.05)
    np.testing.assert_array_equal(plant.force, [1.0, 2.0, 0.0])
    nothing = {"mass": 1.0, "thrust": [1.0, 1.0, 1.0], "force": [0, 0, 0]}
    loop, _ = build_loop(gbt.load_config({**still, "plant": nothing}))
    assert loop.plant is None


LED = {"vehicle": {"follow": "feedback"}}
FAULTS = [
    ({"plant": {"mass": 1.2}}, "vehicle.follow: found exact; allowed: dynamics or feedback beside a plant"),
    ({"plant": {"mass": 0}}, r"plant.mass: found 0; allowed: a number in [0.01, 100]"),
    (
        {"plant": {"thrust": [0.9, 0.9]}, **LED},
        "plant.thrust: found [0.9, 0.9]; allowed: a number in [0.01, 100], or one",
    ),
    ({"plant": {"thrust": -1}}, "plant.thrust: found -1"),
    ({"plant": {"lag_s": 1e-5}}, "plant.lag_s: found 1e-05; allowed: 0, or a number >= 0.001"),
    ({"plant": {"force": [1.0]}, **LED}, "plant.force: found [1.0]; allowed: null, or 2 numbers, or one more"),
    ({"plant": {"weight": 1.2}}, "plant.weight: found an unknown key"),
    ({"vehicle": {"follow_bandwidth": 2.0}}, "vehicle.follow_bandwidth: found 2.0; allowed: null without"),
    (
        {"plant": {"mass": 1.2}, "vehicle": {"follow": "dynamics"}, "guidance": {"kind": "fim_placement"}},
        'plant: found {"mass": 1.2}; allowed: nothing beside guidance.kind = fim_placement',
    ),
]


@pytest.mark.parametrize(("section", "line"), FAULTS, ids=range(len(FAULTS)))
def test_what_contradicts_itself_is_refused_in_one_line(section, line):
    with pytest.raises(gbt.ConfigurationError) as fault:
        gbt.load_config({"problem": "case2", **section})
    assert len(fault.value.faults) == 1
    assert line in str(fault.value)


def test_factors_that_leave_no_mass_are_refused():
    own = {
        "mass": 10.0, "inertia": 5.0, "added_mass": [5.0, 5.0, 1.0], "linear_drag": [1.0] * 3,
        "quadratic_drag": [1.0] * 3,
    }  # fmt: skip
    vehicle = {"kind": "fossen", "parameters": own, "follow": "dynamics"}
    given = {"problem": "case2", "vehicle": vehicle, "plant": {"added_mass": 3.0}, "guidance": {"kind": "static"}}
    with pytest.raises(gbt.ConfigurationError, match="plant: mass minus added mass must be positive"):
        gbt.run({**given, "duration_s": 1.0})
