"""The follower and the first moves: closed forms of the error, and the same in C."""

import ctypes
import math
from dataclasses import replace

import numpy as np
import pytest
from test_codegen import fossen

from gbt_ocp.guidance.inverse_dynamics import InverseDynamics
from gbt_ocp.guidance.startup import Crossing
from gbt_ocp.models.fossen import FALCON_2D, FALCON_3D, FossenVehicle
from gbt_ocp.models.vehicles import PlanarPointMass
from gbt_ocp.ocp import FlatTrajectory
from gbt_ocp.ocp.codegen.library import build_library, find_compiler, kernel_files
from gbt_ocp.ocp.codegen.problem_source import generate_problem
from gbt_ocp.ocp.follower import Follower, samples, turn_bandwidth
from gbt_ocp.ocp.trajectory import FlatPoint
from gbt_ocp.simulation.plant import Motion, Plant, scaled

PLANAR = FossenVehicle(FALCON_2D, [5000.0, 5000.0, 1500.0])
SPATIAL = FossenVehicle(FALCON_3D, [5000.0, 5000.0, 5000.0, 1500.0])


def point(trajectory, time):
    return FlatPoint(*(trajectory(time, order) for order in range(3)))


@pytest.mark.parametrize(
    "vehicle", [PLANAR, SPATIAL, PlanarPointMass(2.0, 0.5, (50.0, 50.0))], ids=["planar", "spatial", "point mass"]
)
def test_without_model_error_each_error_decays_as_a_critically_damped_one(vehicle):
    bandwidth, step, n, d = 1.0, 0.01, vehicle.flat_dimension, vehicle.position_dimension
    each = np.where(np.arange(n) < d, bandwidth, turn_bandwidth(bandwidth))
    assert not n > d or each[-1] == 4.0 * bandwidth
    rng = np.random.default_rng(1)
    start = 0.2 * rng.standard_normal((2, n))
    trajectory = FlatTrajectory(1.0, start, 0.05 * rng.standard_normal((3, n)))
    error = rng.uniform(-0.2, 0.2, n)
    follower, motion = Follower(vehicle, bandwidth), Motion(Plant(vehicle))
    state = vehicle.state(start[0] - error, start[1])
    found = []
    for k in range(600):
        now, middle = point(trajectory, k * step), point(trajectory, (k + 0.5) * step)
        thrust = follower.thrust(now, middle, *vehicle.flat(state))
        state = motion.advance(state, lambda s, thrust=thrust: thrust, step)
        found.append(trajectory((k + 1) * step) - vehicle.flat(state)[0])
    t = step * np.arange(1, 601)[:, None]
    decayed = (1.0 + each * t) * np.exp(-each * t) * error
    # the thrust is held for a hundredth of a second: the loop is that much later
    np.testing.assert_allclose(found, decayed, atol=0.03 * np.abs(error).max())
    assert np.abs(found[-1]).max() < 0.03 * np.abs(error).max()


def test_a_vehicle_keeps_its_bow_ahead_though_a_fifth_of_its_mass_and_drag_is_not_known():
    parameters = scaled(FALCON_2D, mass=1.2, added_mass=1.2, drag=1.2)
    vehicle = FossenVehicle(parameters, PLANAR.thrust_max)
    # the Munk moment of what is not known: a stiffness in yaw that the bandwidth of the position would not hold
    speed, (surge, sway, yaw) = 3.0, parameters.inertia_diagonal
    left = (1.0 - 1.0 / 1.2) * (sway - surge) * speed**2 / yaw
    assert 2.0**2 < left < turn_bandwidth(2.0) ** 2
    follower, motion = Follower(PLANAR, 2.0), Motion(Plant(vehicle))
    ahead, step = np.array([speed, 0.0, 0.0]), 0.02
    state, turned = vehicle.state(np.array([0.0, 0.0, 0.05]), ahead), []
    for k in range(150):
        now, middle = (FlatPoint(ahead * time, ahead, np.zeros(3)) for time in (k * step, (k + 0.5) * step))
        thrust = follower.thrust(now, middle, *PLANAR.flat(state))
        state = motion.advance(state, lambda s, thrust=thrust: thrust, step)
        turned.append(abs(state[2]))
    assert max(turned) < 0.1
    assert turned[-1] < 0.01


def test_feed_forward_alone_follows_a_plan_to_the_square_of_the_time_between_samples():
    trajectory = FlatTrajectory(1.0, np.array([[0.0, 0.0, 0.4], [1.0, -0.5, 0.3]]), np.array([[0.5, 0.8, -0.4]]))
    off = []
    for step in (0.04, 0.02):
        follower, motion = Follower(PLANAR, 0.0), Motion(Plant(PLANAR))
        state = PLANAR.state(*trajectory.start)
        for k in range(round(1.0 / step)):
            now, middle = point(trajectory, k * step), point(trajectory, (k + 0.5) * step)
            thrust = follower.thrust(now, middle, *PLANAR.flat(state))
            state = motion.advance(state, lambda s, thrust=thrust: thrust, step)
        off.append(np.linalg.norm(PLANAR.flat(state)[0] - trajectory(1.0)))
    assert off[1] < 1e-3
    assert 3.0 < off[0] / off[1] < 5.0


def test_an_angle_is_led_back_the_short_way_and_the_thrust_is_within_its_limits():
    follower, still = Follower(PLANAR, 2.0), np.zeros(3)
    at = FlatPoint(np.array([0.0, 0.0, 3.0]), still, still)
    there = follower.thrust(at, at, np.array([0.0, 0.0, -3.0]), still)
    nearby = follower.thrust(at, at, np.array([0.0, 0.0, 2.0 * math.pi - 3.0]), still)
    np.testing.assert_allclose(there, nearby, atol=1e-9)
    assert there[2] < 0.0
    far = FlatPoint(np.array([1e4, -1e4, 0.0]), still, still)
    np.testing.assert_array_equal(np.abs(follower.thrust(far, far, still, still)), [5000.0, 5000.0, 0.0])
    with pytest.raises(ValueError, match="bandwidth"):
        Follower(PLANAR, math.nan)


def test_a_vehicle_on_its_plan_is_not_slowed_down_however_much_of_its_yaw_moment_is_planned():
    follower = Follower(PLANAR, 2.0)
    z, dz, ddz = np.array([0.0, 0.0, 0.2]), np.array([2.0, 1.0, 0.3]), np.zeros(3)
    still = np.asarray(PLANAR.inputs(z, dz, ddz), dtype=float).ravel()
    at_one = np.asarray(PLANAR.inputs(z, dz, np.array([0.0, 0.0, 1.0])), dtype=float).ravel()
    ddz[2] = (0.98 * 1500.0 - still[2]) / (at_one - still)[2]
    planned = np.asarray(PLANAR.inputs(z, dz, ddz), dtype=float).ravel()
    at = FlatPoint(z, dz, ddz)
    np.testing.assert_allclose(follower.thrust(at, at, z, dz), planned, rtol=1e-12)
    slipped = z - np.array([0.0, 0.0, 0.3])
    unaided = np.asarray(PLANAR.inputs(slipped, dz, ddz + np.array([0.0, 0.0, 64.0 * 0.3])), dtype=float).ravel()
    slowed = follower.thrust(at, at, slipped, dz)
    assert slowed[2] == 1500.0
    assert (slowed - unaided)[:2] @ PLANAR.state(slipped, dz)[3:5] < 0.0, "against its motion"


@pytest.mark.parametrize(("period", "count"), [(0.1, 5), (0.02, 1), (0.005, 1), (0.03, 2), (1.0, 50)])
def test_it_is_sampled_at_fifty_hertz_or_faster(period, count):
    assert samples(period) == count


PROBLEMS = {
    "planar": lambda: fossen(2, "hard"),
    "spatial": lambda: fossen(3, "penalty"),
    "degree 3": lambda: replace(fossen(2, "hard"), degree=3),
    "free pieces": lambda: replace(fossen(3, "hard"), degree=4, continuity=1),
}


class _C:
    """What the generated library has besides the solver, by ctypes."""

    def __init__(self, problem):
        self.problem = problem
        n, d = problem.vehicle.flat_dimension, problem.vehicle.position_dimension
        m, p, joined, free = len(problem.vehicle.thrust_max), problem.pieces, problem.joined, problem.freedoms
        real, whole = ctypes.c_double, ctypes.c_int

        class Follower(ctypes.Structure):
            _fields_ = [
                ("bandwidth", real),
                ("planned", whole),
                ("start", real * (joined * n)),
                ("top", real * (p * free)),
            ]

        class Result(ctypes.Structure):
            _fields_ = [("status", whole), ("thrust", real * m), ("error", real * n), ("off_plan", real)]

        class Setpoint(ctypes.Structure):
            _fields_ = [
                ("status", whole), ("z", real * n), ("dz", real * n),
                *((name, real) for name in ("course", "speed", "heading", "depth")),
            ]  # fmt: skip

        class Startup(ctypes.Structure):
            _fields_ = [
                ("axis", real * 3),
                *((name, real) for name in ("deviation", "speed", "opening", "leg", "nearest", "period")),
                ("known", whole), ("crossing", whole), ("began", real),
            ]  # fmt: skip

        self.library = ctypes.CDLL(str(build_library(kernel_files() | generate_problem(problem).files)))
        numbers = ctypes.c_void_p
        self.library.gbt_follow_init.argtypes = [numbers, real]
        self.library.gbt_follow_plan.argtypes = [numbers] * 3
        self.library.gbt_follow.argtypes = [numbers, real, real, numbers, numbers, numbers]
        self.library.gbt_follow_setpoint.argtypes = [numbers, real, numbers, numbers]
        self.setpoint = Setpoint()
        self.library.gbt_startup_init.argtypes = [numbers, numbers, *[real] * 6]
        self.library.gbt_startup_step.argtypes = [numbers, real, *[numbers] * 5]
        self.follower, self.result, self.startup = Follower(), Result(), Startup()
        self.dimension, self.inputs = d, m

    def begin(self, bandwidth, trajectory=None):
        self.library.gbt_follow_init(ctypes.byref(self.follower), bandwidth)
        if trajectory is not None:
            start, top = (np.ascontiguousarray(values) for values in (trajectory.start, trajectory.top))
            self.library.gbt_follow_plan(ctypes.byref(self.follower), start.ctypes.data, top.ctypes.data)

    def follow(self, elapsed, hold, z, dz):
        arguments = (elapsed, hold, z.ctypes.data, dz.ctypes.data, ctypes.byref(self.result))
        status = self.library.gbt_follow(ctypes.byref(self.follower), *arguments)
        assert status == self.result.status
        return status, np.array(self.result.thrust), np.array(self.result.error), self.result.off_plan

    def start(self, axis, *settings):
        given = np.asarray(axis, dtype=float)
        self.library.gbt_startup_init(ctypes.byref(self.startup), given.ctypes.data, *settings)

    def step(self, time, z, dz, mean, covariance):
        thrust = np.full(self.inputs, np.nan)
        arrays = [np.ascontiguousarray(values, dtype=float) for values in (z, dz, mean, covariance)]
        status = self.library.gbt_startup_step(
            ctypes.byref(self.startup), time, *(values.ctypes.data for values in arrays), thrust.ctypes.data
        )
        return status, thrust


@pytest.fixture(scope="module", params=PROBLEMS)
def compiled(request):
    if find_compiler() is None:
        pytest.skip("no C compiler")
    return _C(PROBLEMS[request.param]())


FOLLOWED, CLIPPED, NO_PLAN, NOT_FINITE = range(4)


def drawn(problem, rng):
    n, scale = problem.vehicle.flat_dimension, problem.vehicle.acceleration_scale
    start = rng.standard_normal((problem.joined, n))
    top = np.tile(scale, problem.freedoms // n) * rng.uniform(-0.5, 0.5, (problem.pieces, problem.freedoms))
    return FlatTrajectory(problem.period, start, top)


def test_the_follower_in_c_asks_for_the_same_thrust(compiled):
    problem, rng = compiled.problem, np.random.default_rng(7)
    n, limit = problem.vehicle.flat_dimension, problem.vehicle.thrust_max
    seen = set()
    followers = [Follower(problem.vehicle, bandwidth) for bandwidth in (0.0, 0.7, 2.0, 5.0)]
    for number in range(300):
        follower, trajectory = followers[number % 4], drawn(problem, rng)
        compiled.begin(follower.bandwidth, trajectory)
        piece, share, hold = rng.integers(problem.pieces), rng.choice([0.0, 0.3, 0.6]), rng.uniform(0.0, 0.02)
        elapsed = (piece + share) * problem.period
        part = trajectory.segment(elapsed, (1.0 - share) * problem.period)
        z = part(0.0) + rng.normal(scale=rng.choice([1e-3, 1.0, 10.0]), size=n)
        dz = part(0.0, 1) + rng.normal(scale=0.1, size=n)
        wanted = follower.thrust(point(part, 0.0), point(part, 0.5 * hold), z, dz)
        status, thrust, error, off = compiled.follow(elapsed, hold, z, dz)
        np.testing.assert_allclose(thrust / limit, wanted / limit, rtol=0.0, atol=1e-9)
        assert status == (CLIPPED if np.any(np.abs(wanted) == limit) else FOLLOWED)
        seen.add(status)
        apart = part(0.0) - z
        np.testing.assert_allclose(off, np.linalg.norm(apart[: compiled.dimension]), rtol=1e-9)
        turns = (error - apart) / (2.0 * math.pi)
        np.testing.assert_allclose(turns, np.round(turns), atol=1e-9)
        assert np.all(np.abs(error[compiled.dimension :]) <= math.pi + 1e-9)
    assert seen == {FOLLOWED, CLIPPED}


def test_in_c_there_is_no_thrust_without_a_plan_or_a_measurement(compiled):
    problem, rng = compiled.problem, np.random.default_rng(2)
    n = problem.vehicle.flat_dimension
    z, dz, whole = np.zeros(n), np.zeros(n), problem.pieces * problem.period
    compiled.begin(2.0)
    assert compiled.follow(0.0, 0.02, z, dz)[0] == NO_PLAN
    compiled.begin(2.0, drawn(problem, rng))
    assert compiled.follow(whole, 0.02, z, dz)[0] <= CLIPPED
    for elapsed, hold, measured, status in (
        (-0.01, 0.02, z, NO_PLAN),
        (1.01 * whole, 0.02, z, NO_PLAN),
        (math.nan, 0.02, z, NOT_FINITE),
        (0.0, math.inf, z, NOT_FINITE),
        (0.0, 0.02, np.full(n, math.nan), NOT_FINITE),
    ):
        found = compiled.follow(elapsed, hold, measured, dz)
        assert found[0] == status
        np.testing.assert_array_equal(found[1], 0.0)


def test_a_setpoint_in_c_is_the_plan_at_its_time(compiled):
    problem, rng = compiled.problem, np.random.default_rng(11)
    n, d, end = problem.vehicle.flat_dimension, problem.vehicle.position_dimension, problem.pieces * problem.period

    def ask(ahead, water=None):
        flow = None if water is None else water.ctypes.data
        return compiled.library.gbt_follow_setpoint(
            ctypes.byref(compiled.follower), ahead, flow, ctypes.byref(compiled.setpoint)
        )

    compiled.begin(2.0)
    assert ask(0.0) == NO_PLAN
    for _ in range(50):
        trajectory, water = drawn(problem, rng), rng.normal(size=d)
        compiled.begin(2.0, trajectory)
        ahead = rng.uniform(0.0, end)
        assert ask(ahead, water) == FOLLOWED
        found, z, dz = compiled.setpoint, trajectory(ahead), trajectory(ahead, 1)
        ground = dz[:d] + water
        np.testing.assert_allclose(found.z, np.append(z[:d] + ahead * water, z[d:]), rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(found.dz[:d], ground, rtol=1e-9, atol=1e-9)
        assert found.speed == pytest.approx(np.hypot(*dz[:2]))
        assert found.course == pytest.approx(math.atan2(ground[1], ground[0]))
        assert found.heading == pytest.approx(z[d] if n > d else 0.0)
        assert found.depth == pytest.approx(-(z[2] + ahead * water[2]) if d == 3 else 0.0)
    assert ask(9.0 * end) == FOLLOWED
    np.testing.assert_allclose(compiled.setpoint.z, trajectory(end), rtol=1e-9, atol=1e-9)
    assert ask(math.nan) == NOT_FINITE
    assert ask(0.0, np.full(d, math.inf)) == NOT_FINITE
    assert list(compiled.setpoint.z) == [0.0] * n


PLAN, RESTART, CROSS, NO_INPUT = range(4)


def test_the_first_moves_in_c_are_the_same_as_in_python(compiled):
    vehicle, d, rng = compiled.problem.vehicle, compiled.dimension, np.random.default_rng(3)
    n, period, seen = vehicle.flat_dimension, 0.1, []
    axis = np.array([0.3, -0.2, 1.0])
    compiled.start(axis, 0.2, 2.0, 0.7, 1.3, 9.0, period)
    crossing = Crossing(axis / np.linalg.norm(axis), 0.2, 2.0, 0.7, 1.3, 9.0)
    dynamics = InverseDynamics(vehicle, period)
    spread = 20.0
    for k in range(600):
        z, dz = rng.normal(size=n), 0.3 * rng.standard_normal(n)
        line = rng.normal(size=d)
        if k % 50 == 7:  # the target where the vehicle is, and straight along the axis
            line = np.zeros(d)
        elif k % 50 == 8:
            line = axis[:d]
        mean = z[:d] + 10.0 * line
        spread = max(0.05, spread * math.exp(rng.normal(-0.02 if k < 300 else 0.02, 0.3)))
        root = spread * rng.normal(size=(d, d)) / math.sqrt(d)
        covariance, time = root @ root.T, k * period
        known = crossing.known
        velocity = crossing.step(time, z[:d], mean, covariance)
        status, thrust = compiled.step(time, z, dz, mean, covariance)
        seen.append(status)
        if velocity is None:
            assert status == (PLAN if known else RESTART)
            np.testing.assert_array_equal(thrust, 0.0)
        else:
            assert status == CROSS
            wanted = dynamics.reach_velocity(np.vstack([z, dz]), velocity)
            np.testing.assert_allclose(thrust / vehicle.thrust_max, wanted / vehicle.thrust_max, rtol=0.0, atol=1e-9)
    assert set(seen) == {PLAN, RESTART, CROSS}
    before = bytes(compiled.startup)
    status, thrust = compiled.step(60.0, z, dz, np.full(d, math.nan), covariance)
    assert status == NO_INPUT
    np.testing.assert_array_equal(thrust, 0.0)
    assert bytes(compiled.startup) == before
