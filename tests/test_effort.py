"""Thrust limits that differ by sign, energy and effort."""

from dataclasses import replace
from typing import ClassVar

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import minimize

import gbt_ocp as gbt
from gbt_ocp.experiments.build.loop import build_vehicle
from gbt_ocp.experiments.config.faults import ConfigurationError
from gbt_ocp.experiments.config.loading import load_config
from gbt_ocp.experiments.config.vehicle import KNOWN_BY_NAME
from gbt_ocp.models import KNOWN_VEHICLES, FossenVehicle, PlanarPointMass
from gbt_ocp.models.thrust import ThrustRange
from gbt_ocp.ocp import ShootingProblem, ThrustChange, ThrustEffort, ThrustLimit, TrajectoryProblem
from gbt_ocp.ocp.braking import BrakingPlanner
from gbt_ocp.ocp.transcription import smoothed_hinge
from gbt_ocp.simulation.effort import effort_numbers


class Nearness:
    """Minus the square of the distance from a goal."""

    shapes: ClassVar = {"goal": (2, 1)}

    def value(self, point, parameters):
        return -ca.sumsqr(point.z[:2] - parameters["goal"])

    def bind(self, pieces, data):
        return {"goal": np.tile(np.reshape(data["goal"], (2, 1)), (pieces, 1, 1))}


def test_a_range_clips_and_measures_each_side():
    limits = ThrustRange(np.array([-1.0, -4.0]), np.array([2.0, 4.0]))
    np.testing.assert_allclose(limits.clip([-3.0, 9.0]), [-1.0, 4.0])
    np.testing.assert_allclose(limits.clip([-3.0, 9.0], 0.5), [-0.5, 2.0])
    np.testing.assert_allclose(limits.used([[-3.0, 2.0], [1.0, -6.0]]), [[3.0, 0.5], [0.5, 1.5]])
    np.testing.assert_allclose(ThrustRange.of(PlanarPointMass(thrust_max=(1.0, 2.0))).lower, [-1.0, -2.0])


@pytest.mark.parametrize("name", KNOWN_VEHICLES)
@pytest.mark.parametrize("dimension", [2, 3])
def test_known_vehicles_move_at_the_speed_at_which_drag_takes_their_thrust(name, dimension):
    vehicle = KNOWN_VEHICLES[name].make(dimension)
    thrust = np.zeros(dimension + 1)
    thrust[0] = vehicle.thrust_max[0]
    end = solve_ivp(lambda t, x: vehicle.rates(x, thrust), (0.0, 120.0), np.zeros(2 * dimension + 2), rtol=1e-8)
    parameters = vehicle.parameters
    linear, quadratic = parameters.linear_drag[0], parameters.quadratic_drag[0]
    top = (-linear + np.sqrt(linear**2 + 4.0 * quadratic * thrust[0])) / (2.0 * quadratic)
    assert end.y[dimension + 1, -1] == pytest.approx(top, rel=1e-3)
    assert 0.5 < top < 5.0


@pytest.mark.parametrize("solver", ["ipopt", "compiled"])
def test_plans_keep_limits_that_differ_by_sign(solver):
    known = KNOWN_VEHICLES["bluerov2_heavy"]
    vehicle = FossenVehicle(known.plane, (100.0, 100.0, 30.0), (-30.0, -50.0, -30.0))
    problem = TrajectoryProblem(vehicle, pieces=6, period=0.4).maximize(Nearness())
    planner = problem.subject_to(ThrustLimit(vehicle), nodes=16).compile(solver)
    start = np.zeros((2, 3))
    ahead, astern = planner.solve(start, goal=(9.0, 0.0)), planner.solve(start, goal=(-9.0, 0.0))
    go, back = (
        [float(vehicle.inputs(*map(ca.DM, p))[0]) for p in _points(plan.trajectory)] for plan in (ahead, astern)
    )
    assert 95.0 < max(go) <= 100.2
    assert -30.2 <= min(back) < -28.0  # a little more between the nodes
    assert max(back) <= 100.2


def _points(trajectory):
    z, dz, ddz = trajectory.sample(9)[:3]
    return [(z[i, k], dz[i, k], ddz[i, k]) for i in range(len(z)) for k in range(9)]


def test_braking_and_commands_keep_to_the_range_of_each_side():
    vehicle = FossenVehicle(KNOWN_VEHICLES["bluerov2_heavy"].plane, (100.0, 100.0, 30.0), (-20.0, -100.0, -30.0))
    problem = TrajectoryProblem(vehicle, pieces=3, period=0.5).maximize(Nearness()).subject_to(ThrustLimit(vehicle))
    trajectory = BrakingPlanner(problem)(np.array([[0.0, 0.0, 0.0], [0.8, 0.0, 0.0]]))
    surge = [float(vehicle.inputs(*map(ca.DM, point))[0]) for point in _points(trajectory)]
    assert -20.2 <= min(surge) < -10.0  # a symmetric limit would brake with up to 100 N
    assert trajectory.knots[-1, 1, 0] < 0.5


def test_the_effort_is_the_parabola_that_it_says():
    x = np.linspace(-1.0, 1.0, 21)
    both = [float(smoothed_hinge(ca.DM(v - 1.0), 2.0) + smoothed_hinge(ca.DM(-v - 1.0), 2.0)) for v in x]
    np.testing.assert_allclose(both, (x**2 + 1.0) / 4.0, atol=1e-14)


@pytest.mark.parametrize("solver", ["ipopt", "compiled"])
def test_effort_is_weighed_against_the_objective(solver):
    """A unit mass one second from a goal at x: minimise (x - g)² + w∫a²; held acceleration moves it by a/2."""
    vehicle = PlanarPointMass(mass=1.0, thrust_max=(10.0, 10.0))
    weight, goal = 3.0, 1.0
    problem = TrajectoryProblem(vehicle, pieces=1, period=1.0).maximize(Nearness())
    problem = problem.subject_to_penalty(ThrustEffort(vehicle), weight=4.0 * weight, width=ThrustEffort.WIDTH, nodes=2)
    options = {"compiled": {"tolerance": 1e-9, "gap": 1e-9}} if solver == "compiled" else {}
    plan = problem.compile(solver, options.get(solver, {})).solve(np.zeros((2, 2)), goal=(goal, 0.0))
    # d/da of (a/2 - g)² + w (a/10)²
    wanted = (goal / 1.0) / (0.5 + 2.0 * weight / 100.0)
    assert plan.trajectory.sample(2)[2][0, 0, 0] == pytest.approx(wanted, rel=1e-5)


# ---- changes of the thrust -------------------------------------------------------------------------------------------

TIGHT = {"compiled": {"tolerance": 1e-9, "gap": 1e-9}, "ipopt": {}}


def with_change(problem, vehicle, weight, nodes=2):
    change = ThrustChange(vehicle, reach=2.0 / problem.period)
    return problem.subject_to_penalty(change, weight=change.weight(weight), width=change.width, nodes=nodes)


@pytest.mark.parametrize("dimension", [2, 3])
def test_the_rate_of_the_thrust_is_that_of_the_thrust_along_the_trajectory(dimension):
    vehicle, rng = KNOWN_VEHICLES["falcon"].make(dimension), np.random.default_rng(dimension)
    z, dz, ddz, dddz = rng.normal(size=(4, dimension + 1))

    def thrust(s):
        at = (z + s * dz + s**2 / 2 * ddz + s**3 / 6 * dddz, dz + s * ddz + s**2 / 2 * dddz, ddz + s * dddz)
        return np.asarray(vehicle.inputs(*map(ca.DM, at))).ravel() / vehicle.thrust_max

    step = 1e-4
    wanted = (8.0 * (thrust(step) - thrust(-step)) - (thrust(2.0 * step) - thrust(-2.0 * step))) / (12.0 * step)
    point = [ca.SX.sym(name, dimension + 1) for name in "abcd"]
    rate = ca.Function("rate", point, [ThrustChange(vehicle).of_motion(*point)])
    np.testing.assert_allclose(np.asarray(rate(z, dz, ddz, dddz)).ravel(), wanted, rtol=1e-7, atol=1e-9)


@pytest.mark.parametrize("solver", ["ipopt", "compiled"])
def test_a_flat_trajectory_pays_for_the_change_of_its_thrust(solver):
    """A unit mass at rest, one piece of held jerk j for a second: minimise (j/6 - g)² + w (j/10)²."""
    vehicle, weight, goal = PlanarPointMass(mass=1.0, thrust_max=(10.0, 10.0)), 3.0, 1.0
    problem = TrajectoryProblem(vehicle, pieces=1, period=1.0, degree=3).maximize(Nearness())
    plan = (
        with_change(problem, vehicle, weight).compile(solver, TIGHT[solver]).solve(np.zeros((3, 2)), goal=(goal, 0.0))
    )
    wanted = (goal / 6.0) / (1.0 / 36.0 + weight / 100.0)
    assert plan.trajectory.top[0, 0] == pytest.approx(wanted, rel=1e-5)
    assert plan.status == "solved"


@pytest.mark.parametrize("solver", ["ipopt", "compiled"])
def test_a_flat_trajectory_pays_for_the_steps_of_its_thrust(solver):
    """A unit mass under held accelerations, from the one that acts: the minimum by brute force."""
    vehicle, weight, goal, acting = PlanarPointMass(mass=1.0, thrust_max=(10.0, 10.0)), 2.0, 1.0, 4.0
    problem = TrajectoryProblem(vehicle, pieces=3, period=0.5).maximize(Nearness())
    planner = with_change(problem, vehicle, weight).compile(solver, TIGHT[solver])
    planner.act((acting, 0.0))
    found = planner.solve(np.zeros((2, 2)), goal=(goal, 0.0)).trajectory.top[:, 0]
    np.testing.assert_allclose(found, cheapest(weight, goal, acting), atol=2e-5)
    # the next plan goes on from the first piece of this one
    again = planner.solve(np.zeros((2, 2)), goal=(goal, 0.0)).trajectory.top[:, 0]
    np.testing.assert_allclose(again, cheapest(weight, goal, found[0]), atol=2e-5)


def test_a_start_that_does_not_say_what_acts_goes_on_from_nothing():
    """What calls a solver without a planner gives z and its rate alone."""
    vehicle = PlanarPointMass(mass=1.0, thrust_max=(10.0, 10.0))
    problem = TrajectoryProblem(vehicle, pieces=3, period=0.5).maximize(Nearness())
    planner = with_change(problem, vehicle, 2.0).compile("compiled", TIGHT["compiled"])
    goal = [np.tile([[1.0], [0.0]], (1, 3))]
    limits = [np.zeros((0, 4))]
    guesses = np.zeros((3, 2))
    found = planner.solver.solve(np.zeros((2, 2)), goal, guesses, cold=True, limits=limits).variables
    np.testing.assert_allclose(10.0 * found[:, 0], cheapest(2.0, 1.0, 0.0), atol=2e-5)
    moved = planner.solve(np.zeros((2, 2)), goal=(1.0, 0.0)).trajectory
    assert planner.solver.check(moved).shape == (3,)


def cheapest(weight, goal, acting, form="held"):
    """Forces on a unit mass over three half seconds that cost least, from the exact motion."""

    def cost(forces):
        before, x, v, total = acting, 0.0, 0.0, 0.0
        for force in forces:
            total += weight * 0.5 * ((force - before) / 0.5 / 10.0) ** 2
            first = force if form == "held" else before
            x += 0.5 * v + 0.125 * first + 0.125 / 3.0 * (force - first)
            v += 0.5 * (first + force) / 2.0
            total += (x - goal) ** 2
            before = force
        return total

    return minimize(cost, np.zeros(3), method="BFGS", options={"gtol": 1e-10}).x


@pytest.mark.parametrize("solver", ["ipopt", "compiled"])
@pytest.mark.parametrize("form", ["held", "linear"])
def test_a_trajectory_by_integration_pays_for_the_change_of_its_inputs(form, solver):
    """A unit mass under forces in x, from the force that acts now: the minimum by brute force on the exact motion."""
    vehicle, weight, goal, acting = PlanarPointMass(mass=1.0, thrust_max=(10.0, 10.0)), 2.0, 1.0, 4.0
    problem = ShootingProblem(vehicle, 3, 0.5, form).maximize(Nearness())
    planner = with_change(problem, vehicle, weight).compile(solver, TIGHT[solver])
    planner.act((acting, 0.0))
    plan = planner.solve(np.zeros((2, 2)), goal=(goal, 0.0))

    found = plan.thrust[:, 0] if form == "held" else plan.thrust_end[:, 0]
    np.testing.assert_allclose(found, cheapest(weight, goal, acting, form), atol=2e-5)


@pytest.mark.parametrize("degree", [2, 3])
def test_both_solvers_find_the_same_plan_of_a_vehicle_whose_thrust_turns(degree):
    vehicle = KNOWN_VEHICLES["falcon"].make(2)
    problem = TrajectoryProblem(vehicle, pieces=5, period=0.5, degree=degree).maximize(Nearness())
    problem = with_change(problem.subject_to(ThrustLimit(vehicle)), vehicle, 5.0)
    start = np.array([[0.0, 0.0, 0.3], [1.0, 0.2, 0.1], [0.0, 0.5, 0.0]])[:degree]
    ends = [
        problem.compile(solver, TIGHT[solver]).solve(start, goal=(4.0, 3.0)).trajectory.knots[:, 0]
        for solver in ("ipopt", "compiled")
    ]
    np.testing.assert_allclose(ends[1], ends[0], atol=1e-4)
    still = TrajectoryProblem(vehicle, pieces=5, period=0.5, degree=degree).maximize(Nearness())
    free = still.subject_to(ThrustLimit(vehicle)).compile("ipopt").solve(start, goal=(4.0, 3.0)).trajectory
    assert np.abs(free.knots[:, 0] - ends[0]).max() > 0.05  # it makes a difference


def test_a_penalty_on_held_thrust_weighs_the_same_in_both_solvers():
    vehicle = PlanarPointMass(mass=1.0, thrust_max=(1.0, 1.0))
    problem = ShootingProblem(vehicle, 2, 1.0, "held").maximize(Nearness())
    problem = problem.subject_to_penalty(ThrustLimit(vehicle), weight=3.0, width=1.0, nodes=4)
    found = [
        problem.compile(solver, TIGHT[solver]).solve(np.zeros((2, 2)), goal=(2.0, 0.0)).thrust
        for solver in ("ipopt", "compiled")
    ]
    np.testing.assert_allclose(found[1], found[0], atol=1e-5)


def test_a_change_of_thrust_that_jumps_and_changes_within_pieces_is_refused_in_one_line():
    vehicle = KNOWN_VEHICLES["falcon"].make(2)
    with pytest.raises(ValueError, match=r"planner.effort_rate: found degree 3 .*; allowed: planner.degree 2"):
        with_change(TrajectoryProblem(vehicle, 3, 0.5, degree=3, continuity=1), vehicle, 1.0)
    with pytest.raises(
        ConfigurationError, match=r"planner.effort_rate: found 1; allowed: 0 with planner.continuity: 1"
    ):
        load_config("case2", ["planner.effort_rate=1", "planner.degree=3", "planner.continuity=1"])
    assert load_config("case2", ["planner.effort_rate=1"]).planner.effort_rate == 1.0
    assert load_config("case2", ["planner.effort_rate=1", "planner.form=shooting"]).planner.effort_rate == 1.0
    with pytest.raises(ValueError, match="reach"):
        ThrustChange(vehicle, 0.0)


@pytest.fixture(scope="module")
def moved():
    return {
        follow: gbt.run("case2", overrides=["duration_s=2", f"vehicle.follow={follow}"], seed=3)
        for follow in ("exact", "dynamics")
    }


def test_energy_is_the_work_along_the_path(moved):
    """Of the recorded states and thrusts alone: Σ|τν| by the trapezoidal rule, coarser than what is recorded."""
    run = moved["exact"]
    power = np.sum(np.abs(run.history.thrust * run.history.vehicle_velocity), axis=1)
    assert run.summary["energy_j"] == pytest.approx(np.sum(power[:-1]) * 0.1, rel=0.2)
    assert moved["dynamics"].summary["energy_j"] == pytest.approx(run.summary["energy_j"], rel=0.05)
    assert run.summary["power_mean_w"] == pytest.approx(run.summary["energy_j"] / 2.0)


def test_reversals_and_hotel_load_are_counted(moved):
    history = moved["exact"].history
    wave = np.zeros_like(history.thrust)
    wave[:, 0] = np.where(np.arange(len(wave)) % 5 < 2, -100.0, 300.0)
    changed = replace(history, thrust=wave)
    numbers = effort_numbers(changed, 0.1, hotel_w=50.0)
    turns = np.count_nonzero(np.diff(np.sign(wave[:-1, 0])))
    assert numbers["thrust_reversals_per_min"] == pytest.approx(turns / 2.0 * 60.0)
    assert numbers["power_mean_w"] == pytest.approx(moved["exact"].summary["power_mean_w"] + 50.0)


def test_every_vehicle_is_described():
    assert list(KNOWN_BY_NAME) == list(KNOWN_VEHICLES)


def test_a_named_vehicle_brings_its_limits():
    rov = load_config({"problem": "case5", "vehicle": {"parameters": "bluerov2_heavy"}})
    assert rov.vehicle.thrust_max == (129.7, 129.7, 160.8, 30.4)
    vehicle = build_vehicle(rov)
    assert vehicle.parameters.mass == 13.5
    assert vehicle.thrust_min is None
    weak = load_config({"vehicle": {"parameters": "bluerov2_heavy", "thrust_min": [-50.0, -60.0, -9.0]}})
    np.testing.assert_allclose(ThrustRange.of(build_vehicle(weak)).lower, [-50.0, -60.0, -9.0])
    assert load_config("case2").vehicle.thrust_max == (5000.0, 5000.0, 1500.0)
    with pytest.raises(ConfigurationError, match=r"vehicle.thrust_min: found \[-1, 0, -1\]; allowed: .*3 numbers < 0"):
        load_config({"vehicle": {"thrust_min": [-1, 0, -1]}})
