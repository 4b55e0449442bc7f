"""Objectives of sums over the endpoints in the compiled solver: against IPOPT, brute force and finite differences."""

import itertools
from typing import ClassVar

import casadi as ca
import numpy as np
import pytest

from gbt_ocp.guidance.information import CRITERIA, FisherInformation
from gbt_ocp.guidance.objectives import RangePull
from gbt_ocp.guidance.path_information import MotionInformation, PosteriorVariance, stage_ends
from gbt_ocp.models.contracts import ContractError
from gbt_ocp.models.fossen import FALCON_2D, FossenVehicle
from gbt_ocp.models.vehicles import PlanarPointMass
from gbt_ocp.ocp import KeepOut, ShootingProblem, ThrustLimit, TrajectoryProblem, write_c
from gbt_ocp.ocp.codegen.library import find_compiler
from gbt_ocp.ocp.export.verification import verify_folder
from gbt_ocp.tracking.path_belief import path_covariance
from gbt_ocp.tracking.protocol import Forecast, JointForecast

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler")

GAMMA = 0.98
PLACE = np.array([6.0, 2.0])


def told(pieces, period, stages=1, seed=0):
    """A forecast of a slow target at about 6 m, what is known of its path, and of bearings taken before."""
    rng = np.random.default_rng(seed)
    times = period * np.arange(1, pieces + 1)
    mean = PLACE + times[:, None] * np.array([0.2, -0.1])
    root = rng.normal(size=(4, 4)) * np.array([0.4, 0.4, 0.1, 0.1])[:, None]
    motion = root @ root.T + np.diag([0.1, 0.1, 0.01, 0.01])
    ends = np.concatenate([times, times[stage_ends(pieces, stages)] + 3.0])
    way = [np.hstack([np.eye(2), t * np.eye(2)]) for t in ends]
    ahead = np.array([h @ motion @ h.T + 1e-3 * t**3 * np.eye(2) for h, t in zip(way, ends, strict=True)])
    path = JointForecast(path_covariance(ends, motion[:2, :2], ahead, motion), 0.0, 0.02**2)
    joint = JointForecast(path.covariance[:pieces, :, :pieces], 0.0, 0.02**2)
    forecast = Forecast(mean, ahead[:pieces])
    return {"forecast": forecast, "joint": joint, "path": path, "past": np.diag([2.0, 0.5])}


def objectives(pieces):
    found = [FisherInformation(2, name, 4.0) for name in CRITERIA if name != "trace"]
    motion = [
        MotionInformation(2, pieces, name, stages) for name, stages in (("logdet", 1), ("trace", 2), ("logdet", 3))
    ]
    return [*found, PosteriorVariance(2, pieces), *motion]


def near_the_target(problem, objective, reach=4.0):
    """Maximise, outside a circle about the target."""
    problem = problem.maximize(objective).maximize(RangePull(2, 0.05, reach))
    problem = problem.subject_to(ThrustLimit(problem.vehicle, GAMMA), nodes=2)
    return problem.subject_to(KeepOut(tuple(PLACE), reach), nodes=2)


def flat_problem(objective, pieces=6):
    return near_the_target(TrajectoryProblem(PlanarPointMass(1.0, 0.3, (1.0, 0.8)), pieces, 0.5), objective)


STARTS = np.array([[[0.0, -0.5], [0.3, 0.2]], [[1.0, 4.0], [0.0, -0.4]], [[5.0, -3.0], [-0.4, 0.0]]])


@pytest.mark.parametrize("number", [0, 5, *(pytest.param(k, marks=pytest.mark.long) for k in (1, 2, 3, 4, 6))])
def test_the_compiled_solver_finds_ipopt_s_plans(number):
    objective = objectives(6)[number]
    planners = [flat_problem(objective).compile(solver) for solver in ("ipopt", "compiled")]
    data, gaps = told(6, 0.5, getattr(objective, "stages", 1)), []
    for start in STARTS:
        plans = []
        for planner in planners:
            planner.reset()
            plans.append(planner.solve(start, **data))
            assert not plans[-1].fallback, plans[-1].status
        gaps.append(plans[1].objective - plans[0].objective)
    # two of three at least: the other may be another optimum
    assert np.sum(np.abs(gaps) < 2e-3) >= 2, gaps
    assert min(gaps) > -0.5


class Apart:
    """Of one's own: neighbours of the target's place count by their distance, the more the less there is of it."""

    shapes: ClassVar = {"goal": (2, 1)}

    def accumulated(self, point, parameters):
        line = point.z[:2] - parameters["goal"]
        return ca.vertcat(ca.sumsqr(line), line[0] * line[1], point.dz[0])

    def of_sums(self, sums):
        return -ca.log(1.0 + sums[0]) - 0.1 * ca.log(1.0 + sums[1] ** 2) - 0.01 * (sums[2] - 1.0) ** 2

    def bind(self, pieces, data):
        return {"goal": np.tile(PLACE.reshape(2, 1), (pieces, 1, 1))}


def test_brute_force_over_two_pieces_finds_nothing_better():
    """An objective of one's own, and the motion's, over all thrusts of a grid."""
    vehicle, period = PlanarPointMass(1.0, 0.0, (1.0, 1.0)), 2.0
    start = np.array([[0.0, 0.0], [0.6, 0.3]])
    grid = np.linspace(-1.0, 1.0, 13)
    first, last = np.array(list(itertools.product(grid, repeat=4))).reshape(-1, 2, 2).transpose(1, 0, 2)
    middle = start[0] + period * start[1] + 0.5 * period**2 * first
    speed = start[1] + period * first
    ends = np.stack([middle, middle + period * speed + 0.5 * period**2 * last], axis=1)
    rates = np.stack([speed, speed + period * last], axis=1)
    data = told(2, period)
    for objective in (Apart(), MotionInformation(2, 2), MotionInformation(2, 2, "trace")):
        problem = TrajectoryProblem(vehicle, 2, period).maximize(objective).subject_to(ThrustLimit(vehicle, gamma=1.0))
        plan = problem.compile("compiled").solve(start, **data)
        assert plan.solved
        if isinstance(objective, Apart):
            line = ends - PLACE
            values = -np.log(1.0 + np.sum(line**2, axis=(1, 2))) - 0.01 * (rates[..., 0].sum(axis=1) - 1.0) ** 2
            values -= 0.1 * np.log(1.0 + np.sum(line[..., 0] * line[..., 1], axis=1) ** 2)
        else:
            values = variance_by_conditioning(objective, ends, data)
        assert plan.objective >= np.max(values) - 1e-3


def variance_by_conditioning(objective, own, data):
    """The motion's criterion of own positions ``(N, p, 2)``: asked positions conditioned on all bearings at once."""
    path, d, count = data["path"], 2, own.shape[1]
    full = path.covariance.reshape((count + 1) * d, -1)
    asked = full[-2 * d :, -2 * d :]
    weights = full[: count * d, -2 * d :] @ np.linalg.inv(asked)
    rest = (
        np.diag(full[: count * d, : count * d] - weights @ full[-2 * d :, : count * d]).reshape(count, d).mean(axis=1)
    )
    line = data["forecast"].mean - own
    square = np.sum(line**2, axis=-1)
    across = np.stack([-line[..., 1], line[..., 0]], axis=-1) / np.sqrt(square)[..., None]
    seen = np.einsum("nki,kia->nka", across, weights.reshape(count, d, -1))
    noise = np.einsum("nk,kl->nkl", path.angle_variance * square + rest, np.eye(count))
    cross = asked @ np.swapaxes(seen, -1, -2)
    after = asked - cross @ np.linalg.solve(seen @ cross + noise, np.swapaxes(cross, -1, -2))
    if objective.criterion == "trace":
        return -0.5 * count * np.log(np.trace(after, axis1=-2, axis2=-1))
    return -0.25 * count / d * sum(np.linalg.slogdet(after[:, k : k + d, k : k + d])[1] for k in (0, d))


def test_sums_of_trajectories_by_integration():
    """Stationary by finite differences along the integrated trajectory, and IPOPT's plan."""
    vehicle = FossenVehicle(FALCON_2D, [60.0, 60.0, 20.0])
    for objective in (FisherInformation(2, "logdet", 4.0), MotionInformation(2, 5)):
        problem = ShootingProblem(vehicle, 5, 0.5).maximize(objective).maximize(RangePull(2, 0.2, 4.0))
        problem = problem.subject_to(ThrustLimit(vehicle, GAMMA))
        data, state = told(5, 0.5), np.array([[0.0, -0.5, 0.2], [0.3, 0.2, 0.0]])
        plans = [problem.compile(solver).solve(state, **data) for solver in ("ipopt", "compiled")]
        assert all(plan.solved for plan in plans)
        assert plans[1].objective == pytest.approx(plans[0].objective, abs=2e-3)


def test_a_wrong_objective_of_sums_is_one_line():
    vehicle, stray = PlanarPointMass(), ca.SX.sym("stray")
    problem = TrajectoryProblem(vehicle, 2, 1.0)

    def wrong(**members):
        return type("Wrong", (Apart,), members)()

    for term, said in (
        (wrong(accumulated=lambda self, point, parameters: ca.SX.zeros(1, 3)), "Wrong.accumulated: found shape"),
        (wrong(of_sums=lambda self, sums: sums), "Wrong.of_sums: found shape"),
        (wrong(of_sums=lambda self, sums: sums[0] * stray), "Wrong.of_sums: found the symbol stray"),
        (wrong(of_sums=lambda self: 0.0), "Wrong.of_sums: found the arguments"),
    ):
        with pytest.raises(ContractError, match=said):
            problem.maximize(term)


@pytest.mark.parametrize(
    "form", [pytest.param("flat", marks=pytest.mark.long), pytest.param("shooting", marks=pytest.mark.slow)]
)
def test_generated_c_says_what_python_says(form, tmp_path):
    if form == "flat":
        planner = flat_problem(MotionInformation(2, 6)).compile("compiled")
        states = STARTS
    else:
        vehicle = FossenVehicle(FALCON_2D, [60.0, 60.0, 20.0])
        problem = ShootingProblem(vehicle, 6, 0.5).maximize(PosteriorVariance(2, 6))
        planner = problem.subject_to(ThrustLimit(vehicle, GAMMA)).compile("compiled")
        states = [np.array([[0.0, -0.5, 0.2], [0.3, 0.2, 0.0]]), np.array([[1.0, 4.0, 0.0], [0.0, -0.4, 0.0]])]
    steps = [{"state": state, **told(6, 0.5)} for state in states]
    found = verify_folder(write_c(planner, tmp_path / "planner", steps))
    assert found.faults == ()
    assert found.vectors >= 2
