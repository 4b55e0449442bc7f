"""The C kernel's inner functions, against finite differences and dense linear algebra."""

import ctypes
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

from gbt_ocp.guidance.objectives import BearingSimilarity, RangePull
from gbt_ocp.models.fossen import FALCON_2D, FALCON_3D, FossenVehicle
from gbt_ocp.ocp import KeepOut, ThrustLimit, TrajectoryProblem
from gbt_ocp.ocp.codegen.library import build_library, find_compiler, kernel_files
from gbt_ocp.ocp.codegen.problem_source import generate_problem

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler")


class Coupled:
    """A function of three sums that is smooth whatever they are, curved both ways, and reads places and rates."""

    def __init__(self, dimension):
        self.dimension = dimension
        self.shapes = {"goal": (dimension, 1)}

    def accumulated(self, point, parameters):
        line = parameters["goal"] - point.z[: self.dimension]
        return ca.vertcat(ca.sqrt(1.0 + ca.sumsqr(line)), ca.sin(line[0] * line[1]), point.dz[0] * line[1])

    def of_sums(self, sums):
        return -ca.log(1.0 + 0.1 * ca.sumsqr(sums)) + 0.5 * ca.sin(sums[0] - sums[1] * sums[2])

    def bind(self, pieces, data):
        return {"goal": np.zeros((pieces, self.dimension, 1))}


def fossen_problem(
    dimension: int, degree: int, pieces: int, continuity: int | None = None, *, coupled: bool = False
) -> TrajectoryProblem:
    parameters = FALCON_2D if dimension == 2 else FALCON_3D
    vehicle = FossenVehicle(parameters, [5000.0] * dimension + [1500.0])
    problem = TrajectoryProblem(vehicle, pieces, 0.1, degree=degree, continuity=continuity)
    problem = problem.maximize(BearingSimilarity(dimension)).maximize(RangePull(dimension))
    problem = problem.subject_to(ThrustLimit(vehicle, 0.98), nodes=2)
    problem = problem.maximize(Coupled(dimension)) if coupled else problem
    return problem.subject_to_penalty(KeepOut((0.0,) * dimension, 2.0), nodes=3)


SIZES = [(2, 2, 5), (3, 2, 2), (2, 3, 4), (2, 2, 1), (2, 4, 3, 1), (3, 3, 2, 1), (2, 4, 3, 2)]
"""Dimension, degree, pieces and, where it is less than the most, continuity."""

COUPLED = [(2, 2, 5), (3, 3, 2, 1)]
"""The same of problems with an objective of sums."""


@pytest.fixture(
    scope="module", params=[*((size, False) for size in SIZES), *((size, True) for size in COUPLED)], ids=str
)
def checks(request):
    size, coupled = request.param
    problem = fossen_problem(*size, coupled=coupled)
    own = {"kernel_checks.c": (Path(__file__).parent / "kernel_checks.c").read_text()}
    library = ctypes.CDLL(str(build_library(kernel_files() | generate_problem(problem).files | own)))
    for name in ("check_gradient", "check_hessian", "check_step"):
        getattr(library, name).restype = ctypes.c_double
    parameters = np.random.default_rng(1).normal(size=library.check_numbers())

    def check(name: str, seed: int) -> float:
        return getattr(library, name)(seed, ctypes.c_void_p(parameters.ctypes.data))

    return check


@pytest.mark.parametrize("seed", range(5))
def test_gradient_of_the_lagrangian_is_its_central_difference(checks, seed):
    assert checks("check_gradient", seed) < 1e-6


@pytest.mark.parametrize("seed", range(5))
def test_hessian_is_the_central_difference_of_the_gradient(checks, seed):
    assert checks("check_hessian", seed) < 1e-6


@pytest.mark.parametrize("seed", range(5))
def test_riccati_step_is_the_dense_newton_step(checks, seed):
    assert checks("check_step", seed) < 1e-9


@pytest.mark.parametrize("seed", range(3))
def test_riccati_recursion_sees_the_inertia_of_the_dense_hessian(checks, seed):
    assert checks("check_inertia", seed) == 1
