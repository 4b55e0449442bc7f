"""The compiled solver against closed forms, SciPy, IPOPT and the optimality conditions in CasADi."""

import pickle
import subprocess
import sys
from dataclasses import dataclass
from types import SimpleNamespace

import casadi as ca
import numpy as np
import pytest
from scipy.optimize import lsq_linear, minimize

from gbt_ocp.guidance.objectives import BearingSimilarity, RangePull
from gbt_ocp.guidance.target_limits import RangeLimits
from gbt_ocp.models.bearings import DesiredBearing
from gbt_ocp.models.fossen import FALCON_2D, FALCON_3D, FossenVehicle
from gbt_ocp.models.vehicles import PlanarPointMass, Unicycle
from gbt_ocp.ocp import FlatTrajectory, KeepOut, ThrustLimit, TrajectoryProblem
from gbt_ocp.ocp.binding import Binding
from gbt_ocp.ocp.check import LimitCheck
from gbt_ocp.ocp.codegen import library as building
from gbt_ocp.ocp.codegen.expressions import NotGenerableError, c_source
from gbt_ocp.ocp.codegen.library import CompilerError, build_library, find_compiler
from gbt_ocp.ocp.codegen.options import CompiledOptions
from gbt_ocp.ocp.solvers.choice import make_solver
from gbt_ocp.ocp.solvers.compiled import CompiledSolver
from gbt_ocp.ocp.solvers.ipopt import IpoptSolver
from gbt_ocp.ocp.transcription import input_scale, transcribe

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler")


@dataclass(frozen=True)
class Term:
    """An objective of the endpoint's position from any CasADi function, with a goal ``(2,)`` as parameter."""

    function: object

    @property
    def shapes(self):
        return {"goal": (2, 1)}

    def value(self, point, parameters):
        return self.function(point, parameters["goal"])

    def bind(self, pieces, data):
        return {"goal": np.tile(np.reshape(data["goal"], (2, 1)), (pieces, 1, 1))}


@dataclass(frozen=True)
class Bounded:
    """``lower <= function(point) <= upper``."""

    function: object
    lower: np.ndarray
    upper: np.ndarray
    scale: np.ndarray

    @property
    def backoff(self):
        return np.zeros(len(self.lower))

    def value(self, point):
        return self.function(point)


NEAREST = Term(lambda point, goal: -ca.sumsqr(point.z - goal))
POINT_MASS = PlanarPointMass(mass=2.0, thrust_max=(1.0, 4.0))


def solve(problem, start, goal, *, options=None, guess=None, tightening=0.0):
    solver = CompiledSolver(problem, options or {})
    parameters = Binding(problem).objective_parameters({"goal": goal})
    guess = np.zeros((problem.pieces, problem.vehicle.flat_dimension)) if guess is None else guess
    return solver.solve(np.asarray(start, dtype=float), parameters, guess, cold=True, tightening=tightening)


def test_convex_quadratic_with_active_limits_has_its_closed_form():
    # one piece: z(1) = z0 + ż0 + a/2, |2 a| <= τ_max on each axis, so each axis clips by itself
    problem = TrajectoryProblem(POINT_MASS, 1, 1.0).maximize(NEAREST).subject_to(ThrustLimit(POINT_MASS), nodes=1)
    found = solve(problem, [[0.0, 0.0], [0.1, 0.0]], [3.0, -0.4])
    wanted = 2.0 * (np.array([3.0, -0.4]) - [0.1, 0.0])
    assert found.status == "solved"
    np.testing.assert_allclose(
        found.variables[0] * input_scale(problem), np.clip(wanted, [-0.5, -2.0], [0.5, 2.0]), atol=2e-4
    )
    assert found.violation <= 1e-6


def test_rosenbrock_with_a_limit_agrees_with_scipy():
    def rosenbrock(x, y):
        return (1.0 - x) ** 2 + 100.0 * (y - x**2) ** 2

    disc = Bounded(lambda point: ca.sumsqr(point.z), np.array([-np.inf]), np.array([1.0]), np.ones(1))
    vehicle = PlanarPointMass(thrust_max=(5.0, 5.0))
    problem = TrajectoryProblem(vehicle, 1, 1.0).maximize(Term(lambda point, _: -rosenbrock(point.z[0], point.z[1])))
    problem = problem.subject_to(disc, nodes=1)
    found = solve(problem, [[-0.5, 0.5], [0.0, 0.0]], [0.0, 0.0], options={"gap": 1e-6, "tolerance": 1e-7})
    end = FlatTrajectory(1.0, np.array([[-0.5, 0.5], [0.0, 0.0]]), found.variables * 5.0).endpoints[0]
    circle = {"type": "ineq", "fun": lambda x: 1.0 - x @ x}
    expected = minimize(lambda x: rosenbrock(*x), [-0.5, 0.5], constraints=circle, tol=1e-12)
    assert found.solved
    np.testing.assert_allclose(end, expected.x, atol=1e-5)


def test_infeasible_limits_give_the_least_violation_and_say_so():
    # both axes: ẍ >= 1 against ẍ <= -1 with half the unit, so a violation of the latter counts twice
    against = Bounded(
        lambda point: ca.vertcat(point.ddz[0], point.ddz[0]),
        np.array([1.0, -np.inf]), np.array([np.inf, -1.0]), np.array([1.0, 0.5]),
    )  # fmt: skip
    problem = TrajectoryProblem(POINT_MASS, 1, 1.0).maximize(NEAREST).subject_to(against, nodes=1)
    found = solve(problem, np.zeros((2, 2)), [0.0, 0.0])
    assert found.status == "limit violated"
    assert not found.solved
    assert found.violation == pytest.approx(2.0, abs=1e-3)
    assert found.variables[0, 0] * 0.5 == pytest.approx(-1.0, abs=1e-3)


def test_a_hard_limit_is_kept_however_steep_the_objective():
    steep = Term(lambda point, goal: -1e4 * ca.sumsqr(point.z - goal))
    problem = TrajectoryProblem(POINT_MASS, 2, 1.0).maximize(steep).subject_to(ThrustLimit(POINT_MASS), nodes=1)
    found = solve(problem, np.zeros((2, 2)), [9.0, 9.0])
    assert found.status == "solved"
    np.testing.assert_allclose(found.variables, 1.0, atol=1e-5)


def test_tightening_moves_both_bounds_by_its_share_of_the_limit():
    problem = TrajectoryProblem(POINT_MASS, 1, 1.0).maximize(NEAREST).subject_to(ThrustLimit(POINT_MASS), nodes=1)
    found = solve(problem, np.zeros((2, 2)), [9.0, -9.0], tightening=0.25)
    np.testing.assert_allclose(found.variables, [[0.75, -0.75]], atol=1e-4)


def test_warm_starts_of_long_horizons_begin_with_a_small_barrier():
    short, long = (CompiledOptions.checked({}, pieces).warm_barrier for pieces in (5, 50))
    assert (short, long) == (1e-2, pytest.approx(1e-4))
    assert CompiledOptions.checked({"barrier": 1.0}, 50).warm_barrier == pytest.approx(1e-2)
    assert CompiledOptions.checked({"warm_barrier": 0.5}, 50).warm_barrier == 0.5
    problem = fossen(2, "hard", pieces=20)
    start, parameters = instance(problem, 1)
    solver = CompiledSolver(problem, {})
    cold = solver.solve(start, parameters, np.zeros((20, 3)), cold=True)
    again = solver.solve(start, parameters, cold.variables, cold=False)
    thrown = solver.solve(start, parameters, cold.variables, cold=True)
    assert cold.solved
    assert again.solved
    assert again.iterations < min(thrown.iterations, cold.iterations / 2)


def test_without_limits_it_is_newton_s_method():
    problem = TrajectoryProblem(POINT_MASS, 2, 0.5).maximize(NEAREST)
    found = solve(problem, np.zeros((2, 2)), [1.0, 2.0])
    trajectory = FlatTrajectory(0.5, np.zeros((2, 2)), found.variables * input_scale(problem))
    np.testing.assert_allclose(trajectory.endpoints, [[1.0, 2.0]] * 2, atol=1e-4)
    assert found.iterations <= 2


def test_exit_codes_for_bad_inputs_and_early_stops():
    problem = TrajectoryProblem(POINT_MASS, 3, 1.0).maximize(NEAREST).subject_to(ThrustLimit(POINT_MASS), nodes=2)
    start, goal = np.zeros((2, 2)), [2.0, 2.0]
    early = solve(problem, start, goal, options={"deadline": 2})
    assert (early.status, early.solved) == ("iteration limit", False)
    assert early.iterations == 2
    assert np.all(np.isfinite(early.variables))
    solver = CompiledSolver(problem, {})
    parameters = Binding(problem).objective_parameters({"goal": goal})
    guess = np.zeros((3, 2))
    for bad in (np.nan, np.inf, -np.inf):
        for which in range(3):
            arguments = [start.copy(), [parameters[0].copy()], guess.copy()]
            (arguments[0] if which == 0 else arguments[1][0] if which == 1 else arguments[2])[0, 1] = bad
            found = solver.solve(*arguments, cold=True)
            assert (found.status, found.solved) == ("input not finite", False)
    assert solver.solve(start, parameters, guess, cold=True).solved, "a bad input must leave nothing behind"


def test_an_objective_without_value_is_a_numerical_failure():
    problem = TrajectoryProblem(POINT_MASS, 1, 1.0).maximize(Term(lambda point, _: ca.sqrt(point.z[0] - 10.0)))
    assert solve(problem, np.zeros((2, 2)), [0.0, 0.0]).status == "numerical failure"


def fossen(dimension, form, pieces=5, nodes=4, degree=2, continuity=None):
    vehicle = FossenVehicle(FALCON_2D if dimension == 2 else FALCON_3D, [5000.0] * dimension + [1500.0])
    problem = TrajectoryProblem(vehicle, pieces, 0.1, degree=degree, continuity=continuity)
    problem = problem.maximize(BearingSimilarity(dimension)).maximize(RangePull(dimension))
    limit = ThrustLimit(vehicle, 0.98)
    return problem.subject_to(limit, nodes=nodes) if form == "hard" else problem.subject_to_penalty(limit, nodes=nodes)


def instance(problem, seed, rate=None):
    """A random start at speed and the parameters of the objectives; the desired bearing turns at ``rate`` (rad/s)."""
    rng = np.random.default_rng(seed)
    d, p = problem.vehicle.position_dimension, problem.pieces
    start = np.zeros((problem.joined, d + 1))
    start[0, :d] = rng.uniform(-5.0, 5.0, d)
    start[1] = rng.normal(size=d + 1) * ([1.0] * d + [0.5])
    mean = rng.normal(size=d) + np.arange(1, p + 1)[:, None] * 0.1 * rng.normal(size=d)
    root = 0.2 * rng.normal(size=(d, d))
    forecast = SimpleNamespace(mean=mean, covariance=np.tile(root @ root.T, (p, 1, 1)))
    turn = 6.0 + 9.0 * (d == 3) if rate is None else rate
    desired = DesiredBearing(d, turn)(seed + 0.1 * np.arange(1, p + 1))
    return start, Binding(problem).objective_parameters({"forecast": forecast, "desired": desired})


def most(excess, soft, slack, weight):
    """Largest multiplier λ in [0, weight] with ``λ (soft λ - excess) <= slack``: complementary but for the slack."""
    if soft > 0.0:
        largest = (excess + np.sqrt(excess**2 + 4.0 * soft * slack)) / (2.0 * soft)
    else:
        largest = np.where(excess < 0.0, slack / np.maximum(-excess, 1e-300), np.inf)
    return np.minimum(largest, weight)


def kkt_residual_of(problem, slack=3e-4):
    """Least gradient of the Lagrangian over all multipliers that are complementary but for ``slack``, as a function of
    start, parameters and solution.

    Gradients and Jacobians are CasADi's, of the problem transcribed for IPOPT.
    """
    program = transcribe(problem)
    slope = ca.gradient(-program.objective, program.variables)
    gradient = ca.Function("g", [program.variables, program.parameters], [slope])
    (limit,) = (*problem.hard, *problem.penalties)
    bare = TrajectoryProblem(problem.vehicle, problem.pieces, problem.period).maximize(problem.objectives[0])
    other = transcribe(bare.subject_to(limit.constraint, nodes=limit.nodes))
    both = [other.limits, ca.jacobian(other.limits, other.variables)]
    function = ca.Function("c", [other.variables, other.parameters], both)
    width = getattr(limit, "width", 0.0)
    weights = np.full(other.limits.numel(), 1e3)
    if width:
        trapezoid = np.ones(limit.nodes + 1)
        trapezoid[[0, -1]] = 0.5
        rows = len(limit.constraint.upper)
        weights = limit.weight * problem.period / limit.nodes * np.tile(np.repeat(trapezoid, rows), problem.pieces)

    def residual(start, parameters, variables):
        unknowns = variables.ravel()
        vector = Binding(problem).vector(start, parameters, [(soft.width, 0.0) for soft in problem.penalties], 0.0)
        free = np.asarray(gradient(unknowns, vector)).ravel()
        values, jacobian = function(unknowns, Binding(bare).vector(start, parameters[:1], [], 0.0))
        values, jacobian = np.asarray(values).ravel(), np.asarray(jacobian)
        low, high = [], []
        for excess in (values - other.upper, other.lower - values):
            for y, weight in zip(excess, weights, strict=True):
                soft = 2.0 * width / weight
                high.append(most(y + width, soft, slack, weight))
                low.append(weight - most(width - y, soft, slack, weight))
        matrix = np.vstack([jacobian, -jacobian]).T
        # an active-set method stops at the minimum; bounds must not coincide
        found = lsq_linear(matrix, -free, (np.array(low) - 1e-9, np.array(high) + 1e-9), method="bvls")
        return np.abs(matrix @ found.x + free).max()

    return residual


@pytest.mark.parametrize(("dimension", "form"), [(2, "hard"), (2, "penalty"), (3, "hard"), (3, "penalty")])
def test_cold_random_instances_end_at_points_that_satisfy_the_optimality_conditions(dimension, form):
    problem = fossen(dimension, form)
    solver, kkt_residual = CompiledSolver(problem, {}), kkt_residual_of(problem)
    for seed in range(25):
        start, parameters = instance(problem, seed)
        found = solver.solve(start, parameters, np.zeros((5, dimension + 1)), cold=True)
        assert found.status == "solved", seed
        assert kkt_residual(start, parameters, found.variables) < 3e-4, seed


@pytest.mark.parametrize(("dimension", "form", "degree"), [(2, "hard", 2), (3, "penalty", 2), (2, "hard", 3)])
def test_from_ipopt_s_solution_it_finds_the_same_one(dimension, form, degree):
    problem = fossen(dimension, form, degree=degree)
    ipopt, compiled = IpoptSolver(problem, {}), CompiledSolver(problem, {"gap": 1e-5, "barrier": 1e-4})
    agreed = 0
    for seed in range(6):
        start, parameters = instance(problem, seed)
        guess = np.zeros((5, dimension + 1))
        expected = ipopt.solve(start, parameters, guess, cold=True)
        if not expected.solved:
            continue
        # from there, with a barrier that does not throw it out of the basin
        found = compiled.solve(start, parameters, expected.variables, cold=False)
        assert found.status == "solved"
        difference = np.abs(found.variables - expected.variables).max()
        agreed += difference < 1e-2
    assert agreed >= 5


def test_the_objective_it_reports_is_that_of_casadi():
    problem = fossen(2, "hard")
    start, parameters = instance(problem, 3)
    found = CompiledSolver(problem, {}).solve(start, parameters, np.zeros((5, 3)), cold=True)
    program = transcribe(problem)
    value = ca.Function("f", [program.variables, program.parameters], [program.objective])
    vector = Binding(problem).vector(start, parameters, [], 0.0)
    assert found.objective == pytest.approx(float(value(found.variables.ravel(), vector)), abs=1e-12)


def test_its_check_of_the_limits_is_that_of_casadi():
    problem = fossen(3, "penalty").subject_to(KeepOut((0.0, 0.0, 0.0), 1.0), nodes=3)
    solver, check = CompiledSolver(problem, {}), LimitCheck(problem)
    rng = np.random.default_rng(0)
    for _ in range(5):
        trajectory = FlatTrajectory(0.1, rng.normal(size=(2, 4)), 10.0 * rng.normal(size=(5, 4)))
        np.testing.assert_allclose(solver.check(trajectory), check(trajectory), rtol=1e-12)
    broken = FlatTrajectory(0.1, np.zeros((2, 4)), np.full((5, 4), np.nan))
    assert np.all(solver.check(broken) == np.inf)


@pytest.mark.parametrize(
    "vehicle",
    [Unicycle((0.5, 1.0), slow_speed=0.5), PlanarPointMass(thrust_max=(1.0, 1.0))],
    ids=lambda v: type(v).__name__,
)
def test_user_problems_run_through_the_same_path(vehicle):
    problem = TrajectoryProblem(vehicle, 8, 0.5).maximize(NEAREST)
    problem = problem.subject_to(ThrustLimit(vehicle), nodes=4).subject_to(KeepOut((2.0, 0.05), 0.8), nodes=8)
    planner = problem.compile("compiled")
    state = np.array([[0.0, 0.0], [0.5, 0.0]])
    closest, solved = np.inf, 0
    for _ in range(20):
        plan = planner.solve(state, goal=[4.0, 0.0])
        assert plan.piece_violation[0] <= 0.0
        solved += plan.solved
        closest = min(closest, np.linalg.norm(plan(np.linspace(0.0, 0.5, 20)) - [2.0, 0.05], axis=1).min())
        state = plan.trajectory.knots[1]
    # a keep-out circle can be met too fast to be kept between the nodes; then the planner brakes
    assert solved >= 18
    assert np.linalg.norm(state[0] - [4.0, 0.0]) < 0.5
    assert 0.8 <= closest < 1.5


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("distance", [0.5, 5.0, 20.0, 29.0])
def test_a_symmetric_start_deep_within_a_forbidden_range_is_solved(dimension, distance):
    # at rest on the line of sight, along which the bearing is desired: nothing says to which side to go
    problem = fossen(dimension, "hard").subject_to_penalty(RangeLimits(dimension, nearest=30.0), nodes=4)
    mean = distance * np.eye(dimension)[0]
    covariance = 0.01 * np.eye(dimension)
    data = {
        "forecast": SimpleNamespace(mean=np.tile(mean, (5, 1)), covariance=np.tile(covariance, (5, 1, 1))),
        "present": SimpleNamespace(mean=mean, covariance=covariance),
        "desired": np.tile(np.eye(dimension)[0], (5, 1)),
    }
    binding, solver = Binding(problem), CompiledSolver(problem, {})
    found = solver.solve(
        np.zeros((2, dimension + 1)),
        binding.objective_parameters(data),
        np.zeros((5, dimension + 1)),
        cold=True,
        limits=binding.limit_parameters(data),
    )
    assert found.status == "solved"


def test_a_warm_start_whose_end_coasts_is_repaired_there():
    """The new piece of a shifted plan costs few iterations, however long the plan is."""
    problem = fossen(2, "hard", pieces=40)
    start, parameters = instance(problem, 1)
    solver = CompiledSolver(problem, {})
    cold = solver.solve(start, parameters, np.zeros((40, 3)), cold=True)
    spoilt = cold.variables.copy()
    spoilt[-1] = 0.0
    repaired = solver.solve(start, parameters, spoilt, cold=False)
    assert cold.solved
    assert repaired.solved
    assert repaired.iterations < 20
    assert repaired.objective == pytest.approx(cold.objective, abs=1e-2)


@pytest.mark.parametrize("deadline", [1, 2, 7, 30, 300])
def test_a_guess_far_from_a_solution_keeps_the_deadline_and_ends_within_the_limits(deadline):
    """Its parts cost iterations too, and that it is far is no status of a solution."""
    problem = fossen(2, "hard", pieces=20)
    start, parameters = instance(problem, 3)
    elsewhere = instance(problem, 103)[1]
    plan = CompiledSolver(problem, {}).solve(start, parameters, np.zeros((20, 3)), cold=True)
    solver = CompiledSolver(problem, {"deadline": deadline})
    for cold in (False, True):
        found = solver.solve(start, elsewhere, plan.variables, cold=cold)
        assert found.iterations <= deadline
        assert found.status == ("solved" if deadline == 300 else "iteration limit")
        if found.solved:
            assert found.violation < 1e-6


def test_hard_limits_and_penalties_mix():
    problem = TrajectoryProblem(POINT_MASS, 4, 1.0).maximize(NEAREST).subject_to(ThrustLimit(POINT_MASS), nodes=2)
    problem = problem.subject_to_penalty(KeepOut((1.0, 0.0), 0.5), weight=50.0, width=0.05, nodes=8)
    start, goal = np.array([[0.0, 0.02], [0.0, 0.0]]), [2.0, 0.0]
    found = solve(problem, start, goal)
    assert found.solved
    ipopt = IpoptSolver(problem, {})
    parameters = Binding(problem).objective_parameters({"goal": goal})
    expected = ipopt.solve(start, parameters, found.variables, cold=False)
    np.testing.assert_allclose(found.variables, expected.variables, atol=5e-3)


def test_auto_is_the_compiled_solver_and_falls_back_where_there_is_no_compiler(monkeypatch, tmp_path):
    problem = TrajectoryProblem(POINT_MASS, 1, 1.0).maximize(NEAREST)
    assert problem.compile().solver.name == "compiled"
    monkeypatch.setenv("CC", str(tmp_path / "no-such-compiler"))
    with pytest.warns(RuntimeWarning, match="auto takes ipopt.*no C compiler"):
        assert problem.compile("auto").solver.name == "ipopt"
    with pytest.raises(CompilerError, match="no C compiler"):
        problem.compile("compiled")


def test_a_compiler_that_fails_is_quoted(monkeypatch, tmp_path):
    compiler = tmp_path / "cc"
    compiler.write_text("#!/bin/sh\necho 'out of paper' >&2\nexit 1\n")
    compiler.chmod(0o755)
    monkeypatch.setenv("CC", str(compiler))
    monkeypatch.setenv("GBT_OCP_CACHE", str(tmp_path / "cache"))
    with pytest.raises(CompilerError, match="out of paper"):
        CompiledSolver(TrajectoryProblem(POINT_MASS, 1, 1.0).maximize(NEAREST), {})
    assert list((tmp_path / "cache").iterdir()) == []


def test_an_expression_without_c_form_is_refused():
    x = ca.MX.sym("x", 2, 2)
    with pytest.raises(NotGenerableError, match="cannot be generated"):
        c_source([ca.Function("inverse", [x], [ca.vec(ca.inv(x))])])


TABLE = ca.interpolant("table", "bspline", [np.linspace(-9.0, 9.0, 19)], np.linspace(-9.0, 9.0, 19) ** 2)
PLANE = ca.interpolant("plane", "linear", [[-9.0, 9.0], [-9.0, 9.0]], [0.0, 1.0, 2.0, 3.0])


@pytest.mark.parametrize(
    ("named", "function"),
    [
        ("erfinv", lambda x: ca.erfinv(x / 100.0)),
        ("CASADI_PRINTF", lambda x: ca.SX.printme(x, x)),
        ("table", TABLE),
        ("plane", lambda x: PLANE(ca.vertcat(x, x))),
    ],
)
def test_what_libm_does_not_have_is_refused_and_auto_falls_back(named, function):
    term = Term(lambda point, goal: -(function(point.z[0] - goal[0]) ** 2))
    problem = TrajectoryProblem(POINT_MASS, 1, 1.0).maximize(term)
    with pytest.raises(NotGenerableError, match=f"found {named}; allowed: what C99 and its libm have"):
        problem.compile("compiled")
    with pytest.warns(RuntimeWarning, match=f"auto takes ipopt.*{named}"):
        assert problem.compile("auto").solver.name == "ipopt"


def test_generated_code_that_is_not_understood_is_refused_and_auto_falls_back(monkeypatch):
    """Another version of CasADi may write its C otherwise."""
    problem = TrajectoryProblem(POINT_MASS, 1, 1.0).maximize(NEAREST)
    dump = ca.CodeGenerator.dump
    spoilt = (
        lambda text: text.replace("return casadi_f", "return casadi_g"),
        lambda text: text.replace("casadi_sq", "casadi_square_").replace("casadi_square_ CASADI", "casadi_q CASADI"),
        lambda text: text.replace("static int casadi_f", "static long casadi_f"),
        lambda text: text.replace("(res[0]!=0)", "(res[0])"),
        lambda text: "",
    )
    for change in spoilt:
        monkeypatch.setattr(ca.CodeGenerator, "dump", lambda self, change=change: change(dump(self)))
        with pytest.raises(NotGenerableError, match="cannot be generated as C"):
            problem.compile("compiled")
        with pytest.warns(RuntimeWarning, match="auto takes ipopt"):
            assert problem.compile("auto").solver.name == "ipopt"


@pytest.mark.parametrize("constant", [np.inf, np.nan], ids=str)
def test_infinite_and_undefined_constants_compile(constant):
    """A constant behind a condition that never holds on the way changes nothing."""
    plain = TrajectoryProblem(POINT_MASS, 2, 1.0).subject_to(ThrustLimit(POINT_MASS), nodes=1)

    def fenced(point, goal):
        return ca.if_else(point.z[0] > -5.0, -ca.sumsqr(point.z - goal), -constant)

    found = solve(plain.maximize(Term(fenced)), np.zeros((2, 2)), [0.3, 1.0])
    expected = solve(plain.maximize(NEAREST), np.zeros((2, 2)), [0.3, 1.0])
    assert found.status == "solved"
    np.testing.assert_allclose(found.variables, expected.variables, atol=1e-6)


def test_unknown_names_and_options_are_refused():
    problem = TrajectoryProblem(POINT_MASS, 1, 1.0).maximize(NEAREST)
    with pytest.raises(ValueError, match="allowed: auto, compiled, ipopt"):
        make_solver(problem, "fast", {})
    for options, message in (
        ({"tol": 1.0}, "allowed keys: tolerance"), ({"gap": -1.0}, "a positive number"),
        ({"deadline": 1.5}, "a positive whole number"), ({"iterations": True}, "a positive whole number"),
    ):  # fmt: skip
        with pytest.raises(ValueError, match=message):
            CompiledSolver(problem, options)


def test_a_library_is_compiled_once(monkeypatch, tmp_path):
    monkeypatch.setenv("GBT_OCP_CACHE", str(tmp_path))
    first = build_library({"a.c": "int one(void) { return 1; }\n"})
    monkeypatch.setattr(building, "_compile", lambda *_: pytest.fail("compiled twice"))
    assert build_library({"a.c": "int one(void) { return 1; }\n"}) == first
    assert [entry.name for entry in tmp_path.iterdir()] == [first.name]


def test_two_processes_may_build_the_same_library_at_once(tmp_path):
    code = (
        "import ctypes; from gbt_ocp.ocp.codegen.library import build_library;"
        "print(ctypes.CDLL(str(build_library({'a.c': 'int seven(void) { return 7; }'}))).seven())"
    )
    environment = {"GBT_OCP_CACHE": str(tmp_path), "PATH": "/usr/bin:/bin", "PYTHONPATH": ":".join(sys.path)}
    runs = [
        subprocess.Popen([sys.executable, "-c", code], env=environment, stdout=subprocess.PIPE, text=True)
        for _ in range(2)
    ]
    assert [run.communicate(timeout=120)[0].strip() for run in runs] == ["7", "7"]
    assert len(list(tmp_path.iterdir())) == 1


def test_it_pickles():
    problem = TrajectoryProblem(POINT_MASS, 1, 1.0).maximize(BearingSimilarity(2))
    solver = pickle.loads(pickle.dumps(CompiledSolver(problem, {"gap": 1e-3})))
    assert solver.name == "compiled"
