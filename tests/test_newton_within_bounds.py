"""Newton's method within the bounds of the inputs: derivatives, optimality, and where another limit takes over."""

import casadi as ca
import numpy as np
import pytest
from scipy.optimize import minimize
from test_shooting_problem import GAMMA, PERIOD, cold, drifting, falcon, first_order_gain, objective, posed

from gbt_ocp.models.dynamics import Dynamics, differentiated, integrated
from gbt_ocp.ocp import KeepOut, SpeedLimit, ThrustEffort
from gbt_ocp.ocp.codegen.library import find_compiler

compiles = pytest.mark.skipif(find_compiler() is None, reason="no C compiler")


@pytest.mark.parametrize("linear", [False, True])
@pytest.mark.parametrize("vehicle", [falcon(2), falcon(3)], ids=["plane", "space"])
def test_a_step_differentiated_rate_by_rate_is_the_step_differentiated_as_one_expression(vehicle, linear):
    dynamics, rng = Dynamics(vehicle), np.random.default_rng(0)
    own, m = dynamics.states, dynamics.inputs
    unknowns, multiplier = ca.SX.sym("z", own + m * (1 + linear)), ca.SX.sym("l", own)
    inputs = unknowns[own : own + m], unknowns[own + m :] if linear else unknowns[own:]
    end = integrated(dynamics, unknowns[:own], inputs, PERIOD, 1)
    known = ca.Function(
        "known",
        [unknowns, multiplier],
        [end, ca.jacobian(end, unknowns), ca.tril(ca.hessian(ca.dot(multiplier, end), unknowns)[0])],
    )
    found = ca.Function(
        "found",
        [unknowns, multiplier],
        [*differentiated(dynamics, unknowns[:own], inputs, PERIOD, unknowns, multiplier)],
    )
    for _ in range(5):
        size = np.concatenate([np.ones(own), np.tile(vehicle.thrust_max, 1 + linear)])
        point = rng.normal(size=unknowns.numel()) * size, rng.normal(size=own)
        for one, other in zip(found(*point), known(*point), strict=True):
            np.testing.assert_allclose(np.array(one), np.array(other), rtol=1e-9, atol=1e-12)


@compiles
@pytest.mark.parametrize(("dimension", "thrust", "steps"), [(2, "held", 1), (3, "held", 2), (2, "linear", 1)])
def test_no_input_can_be_moved_for_the_better(dimension, thrust, steps):
    """The slopes of what is free are within the tolerance, by differences of an objective in numpy."""
    planner = posed(dimension, thrust=thrust, steps=steps).compile("compiled")
    vehicle = planner.problem.vehicle
    for seed in range(4):
        data = cold(dimension, 5, seed)
        planner.reset()
        plan = planner.solve(**data)
        assert plan.solved
        assert np.abs(plan.thrust / vehicle.thrust_max).max() <= GAMMA
        if steps == 1:  # the objective of the test takes one
            assert first_order_gain(vehicle, data, plan) < 2.5e-4  # 1e-4 times a way of up to 2 γ, and differences


@compiles
def test_another_minimiser_finds_nothing_better_nearby():
    planner, vehicle = posed(2).compile("compiled"), falcon(2)
    for seed in range(3):
        data = cold(2, 5, seed)
        planner.reset()
        plan = planner.solve(**data)

        def cost(inputs, data=data, shape=plan.thrust.shape):
            thrust = inputs.reshape(shape) * vehicle.thrust_max
            return -objective(vehicle, data, thrust, thrust)

        begin = (plan.thrust / vehicle.thrust_max).ravel()
        near = [(max(-GAMMA, u - 0.05), min(GAMMA, u + 0.05)) for u in begin]
        found = minimize(cost, begin, method="L-BFGS-B", bounds=near)
        assert -found.fun - plan.objective < 2e-4


@compiles
def test_a_limit_that_does_not_act_changes_nothing_and_one_that_acts_is_kept():
    plain = posed(2)
    idle = plain.subject_to(KeepOut((40.0, 0.0), 1.0), nodes=2).subject_to_penalty(SpeedLimit(2, 50.0))
    some = plain.subject_to(SpeedLimit(2, 1.0), nodes=4)
    planners, slow = [problem.compile("compiled") for problem in (plain, idle, some)], 0
    for seed in range(6):
        for planner in planners:
            planner.reset()
        data = cold(2, 5, seed)
        data["state"][1] *= 0.2
        free, same, kept = (planner.solve(**data) for planner in planners)
        np.testing.assert_array_equal(same.thrust, free.thrust)
        assert same.iterations == free.iterations
        assert kept.solved
        fastest = [np.linalg.norm(plan.knots[1:, 1, :2], axis=1).max() for plan in (free, kept)]
        slow += fastest[0] > 1.0
        assert fastest[1] <= 1.0 + 1e-5
    assert slow >= 4, "the limit acts in most of them"


@compiles
def test_a_penalty_that_is_never_zero_is_left_to_the_interior_point_method():
    vehicle = falcon(2)
    problem = posed(2).subject_to_penalty(ThrustEffort(vehicle), weight=4.0, width=ThrustEffort.WIDTH, nodes=1)
    data = cold(2, 5, 1)
    plans = [problem.compile(solver).solve(**data) for solver in ("compiled", "ipopt")]
    np.testing.assert_allclose(plans[0].thrust / vehicle.thrust_max, plans[1].thrust / vehicle.thrust_max, atol=5e-3)


@compiles
@pytest.mark.parametrize("dimension", [2, 3])
def test_warm_plans_take_a_few_iterations(dimension):
    planner, taken = posed(dimension).compile("compiled"), []
    state = np.zeros((2, dimension + 1))
    state[0, 0] = 2.0
    for step in range(20):
        plan = planner.solve(state, **drifting(dimension, 5, step))
        assert plan.solved
        taken.append(plan.iterations)
        state = plan.knots[1]
    assert np.median(taken[5:]) <= 6, taken
