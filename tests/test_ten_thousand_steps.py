"""Random steps of shipped planners: ``Planner.solve`` and the C that `codegen` writes, built as a user builds it."""

import ctypes
import subprocess

import numpy as np
import pytest

from gbt_ocp.experiments.build.loop import build_planner, build_vehicle
from gbt_ocp.experiments.config.loading import load_config
from gbt_ocp.ocp.codegen.library import find_compiler
from gbt_ocp.ocp.export.folder import write_c
from gbt_ocp.ocp.solvers.compiled import NO_PLAN, ORIGINS, STATUSES
from gbt_ocp.tracking.protocol import Forecast

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler")

PROBLEMS = {
    "case2": ["planner.formulation=hard"],
    "case2 by integration": ["planner.formulation=hard", "planner.form=shooting"],
    "case5 penalty": ["planner.formulation=penalty"],
    "case5 degree 4": ["planner.formulation=hard", "planner.degree=4", "planner.continuity=1"],
    "sea2d": [],
    "sea3d": [],
}

SHIM = """
#include <string.h>
#include "gbt_plan.h"
gbt_planner planner;
static gbt_plan_result plan;
void begin(void) { gbt_plan_init(&planner); }
int asks_for_the_present(void) { return GBT_PRESENT; }
void forget(void) { planner.warm = 0; }
void step(const double *state, const double *mean, const double *covariance, const double *desired, double *endpoints,
          double *given_up, int *said) {
    gbt_plan(&planner, state, mean, covariance, desired, &plan);
    memcpy(endpoints, plan.endpoints, sizeof plan.endpoints);
    memcpy(given_up, plan.given_up, sizeof plan.given_up);
    said[0] = plan.status;
    said[1] = plan.origin;
}
"""


def written(planner, folder):
    """The folder of a planner, built with -O2 beside a shim that a foreign caller might have."""
    write_c(planner, folder)
    (folder / "shim.c").write_text(SHIM)
    units = ["shim.c", *(f"src/{path.name}" for path in (folder / "src").glob("*.c"))]
    flags = ["-std=c99", "-O2", "-ffp-contract=off", "-fPIC", "-shared", "-Isrc", "-o", "planner.so"]
    subprocess.run([*find_compiler(), *flags, *units, "-lm"], cwd=folder, check=True)
    return ctypes.CDLL(str(folder / "planner.so"))


def steps(count, problem, near):
    """Some follow their plan, some are pushed, some begin anew; the forecast jumps, often into what is not allowed."""
    rng, d, p = np.random.default_rng(0), problem.vehicle.position_dimension, problem.pieces
    target = np.zeros(d)
    for _ in range(count):
        kind = rng.integers(0, 4)
        if kind == 0:
            target = near * rng.normal(size=d)
        root = rng.normal(size=(p + 1, d, d)) * 0.05 * near
        mean = target + np.arange(p + 1)[:, None] * 0.2 * rng.normal(size=d)
        angle = rng.uniform(-np.pi, np.pi) + 0.2 * np.arange(p)
        desired = np.zeros((p, d))
        desired[:, 0], desired[:, 1] = np.cos(angle), np.sin(angle)
        push = rng.normal(size=(2, problem.vehicle.flat_dimension)) * (0.0, 0.0, 0.1, 0.6)[kind]
        yield push, rng.random() < 0.2, mean, root @ np.swapaxes(root, 1, 2), desired


def compared(name, changes, count, folder):
    """Steps that differ, and how often each pair of status and origin was seen."""
    configuration = load_config(name.split()[0], ["planner.solver=compiled", *changes])
    planner = build_planner(configuration, build_vehicle(configuration))
    problem, library = planner.problem, written(planner, folder)
    library.begin()
    p, n = problem.pieces, problem.vehicle.flat_dimension
    endpoints, given_up, said = np.zeros((p, n)), np.zeros(len(problem.constraints) + 1), np.zeros(2, dtype=np.intc)
    state = np.zeros((planner.start(np.zeros((2, n))).size // n, n))
    at_sea, different, words = name.startswith("sea"), [], {}
    for number, (push, anew, mean, covariance, desired) in enumerate(steps(count, problem, 40.0 if at_sea else 4.0)):
        state = np.zeros_like(state) if anew else state.copy()
        state[:2] += push
        if anew:
            planner.reset()
            library.forget()
        first = 1 - library.asks_for_the_present()
        given = [np.ascontiguousarray(values) for values in (planner.start(state), mean[first:], covariance[first:])]
        arrays = [*given, np.ascontiguousarray(desired), endpoints, given_up, said]
        library.step(*(ctypes.c_void_p(array.ctypes.data) for array in arrays))
        forecast, present = Forecast(mean[1:], covariance[1:]), Forecast(mean[0], covariance[0])
        try:
            plan = planner.solve(state, forecast, desired, present=present)
        except ValueError:  # so fast that no integration of it is finite
            assert (STATUSES[said[0]], ORIGINS[said[1]]) == ("input not finite", NO_PLAN)
            state = np.zeros_like(state)
            continue
        word = (plan.status, plan.fallback)
        words[word] = words.get(word, 0) + 1
        same = STATUSES[said[0]] == plan.status and ORIGINS[said[1]] == plan.fallback
        # of a plan by integration that is not finished only the first piece is meant to be followed: the others of a
        # vehicle that is broadside at speed magnify a last bit without bound
        followed = 1 if plan.fallback == "unfinished" else p
        same = same and np.abs(plan.endpoints - endpoints)[:followed].max() <= 1e-9
        same = same and sorted(plan.given_up.values()) == pytest.approx(sorted(given_up[given_up > 0.0]), abs=1e-9)
        if not same:
            different.append((number, word, STATUSES[said[0]], ORIGINS[said[1]], plan.endpoints - endpoints))
        state = np.asarray(plan.knots[1])
    return different, words


FEW = ("case2", "case2 by integration", "sea2d")
"""One of each kind, of which a few steps are compared by .ci/run."""

COUNTS = [
    *(pytest.param(name, 40, marks=pytest.mark.long) for name in FEW),
    *(pytest.param(name, 10_000, marks=pytest.mark.slow) for name in PROBLEMS),
]


@pytest.mark.parametrize(("name", "count"), COUNTS)
def test_random_steps_of_the_written_c_are_those_of_python(name, count, tmp_path):
    different, words = compared(name, PROBLEMS[name], count, tmp_path / "planner")
    assert different == []
    if count > 1000:
        assert len(words) > 1
