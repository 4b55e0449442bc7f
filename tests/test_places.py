"""Coordinates relative to the start: the numbers of absolute ones, also in single precision far from the origin."""

import shutil
import subprocess
from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from test_codegen import fossen

from gbt_ocp.guidance.target_limits import FieldOfView, RangeLimits
from gbt_ocp.models.vehicles import PlanarPointMass
from gbt_ocp.ocp import DepthLimits, KeepOut, KeepOutPolygon, Planner
from gbt_ocp.ocp.codegen.library import find_compiler
from gbt_ocp.ocp.codegen.places import placed
from gbt_ocp.ocp.codegen.problem_source import generate_problem
from gbt_ocp.ocp.export.folder import write_c

UTM = np.array([569000.4, 7034000.3, -3000.2])
"""A place in map coordinates, deep down; single precision knows it to half a metre."""

CORNERS = ((2.0, -3.0), (4.0, -3.0), (4.5, -1.0), (2.0, -1.5))


def zone(z, p, rest):
    return ca.sumsqr(z[:2] - ca.DM(UTM[:2])) / 2.0**2


def polygon(z, p, rest):
    corners = tuple(tuple(np.add(corner, UTM[:2])) for corner in CORNERS)

    class Point:
        pass

    Point.z = z
    return KeepOutPolygon(corners).value(Point)


def target(z, p, rest):
    line = p[:3] - z
    return ca.vertcat(ca.dot(rest[:3], line) / ca.sqrt(ca.sumsqr(line) + 1e-6), ca.cos(rest[0]) * line[1])


def depths(z, p, rest):
    return ca.vertcat(z[2], z[2] / 3.0 + rest[1], -2.0 * (z[2] - p[3]) / 4.0, p[3] * z[2])


def branches(z, p, rest):
    east = z[0] - UTM[0]
    return ca.if_else(east > 0.5, ca.fmax(east, rest[0]) ** 2, ca.atan2(z[1] - p[1], 1.0 + rest[0] ** 2)) + (
        z[0] - z[0]
    )


def independent(z, p, rest):
    return ca.vertcat(ca.sin(rest[0]) * p[4] + 3.0, (z[0] + p[0]) - (z[0] - p[1]))


EXPRESSIONS = [zone, polygon, target, depths, branches, independent]


def rewritten(expression, reference=None):
    """The expression of (z, p, rest), and value and numbers of its rewritten form."""
    z, p, rest, origin = (ca.SX.sym(name, size) for name, size in (("z", 3), ("p", 5), ("rest", 4), ("origin", 3)))
    value = ca.SX(ca.vertcat(expression(z, p, rest)))
    form = placed(value, z, p, rest, origin, reference)
    return (
        ca.Function("direct", [z, p, rest], [value]),
        ca.Function("relative", [z, form.numbers, rest], [form.value]),
        ca.Function("located", [origin, p], [form.located]),
        form.shift,
    )


@pytest.mark.parametrize("expression", EXPRESSIONS)
def test_a_rewritten_expression_has_the_same_value_from_any_origin(expression):
    direct, relative, located, _ = rewritten(expression)
    rng = np.random.default_rng(0)
    for _ in range(50):
        z = UTM + rng.normal(size=3)
        p = np.concatenate([UTM + rng.normal(size=3), [UTM[2]], rng.normal(size=1)])
        rest, origin = rng.normal(size=4), UTM + rng.uniform(-5.0, 5.0, 3) * rng.choice([1.0, 1e3])
        expected = np.asarray(direct(z, p, rest)).ravel()
        found = np.asarray(relative(z - origin, located(origin, p), rest)).ravel()
        np.testing.assert_allclose(found, expected, rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("expression", [zone, polygon, target, depths, branches])
def test_numbers_near_the_place_are_all_that_is_left(expression):
    """Rounded to single precision in absolute coordinates the values are off by metres; relative ones are not."""
    direct, relative, located, shift = rewritten(expression, np.array([UTM[2], UTM[2] / 3.0, 0.0, np.nan]))
    rng = np.random.default_rng(1)

    def narrow(values):
        return np.asarray(values, dtype=np.float32).astype(float).ravel()

    errors = []
    for _ in range(50):
        z, origin = UTM + rng.normal(size=3), UTM + rng.normal(size=3)
        p = np.concatenate([UTM + rng.normal(size=3), [UTM[2]], rng.normal(size=1)])
        rest = narrow(rng.normal(size=4))
        z = origin + narrow(z - origin)
        exact = np.asarray(direct(z, p, rest)).ravel()
        close = np.asarray(relative(narrow(z - origin), narrow(located(origin, p)), rest)).ravel() + shift
        far = np.asarray(direct(narrow(z), narrow(p), rest)).ravel()
        rows = slice(0, 3) if expression is depths else slice(None)  # a product of positions is no difference
        errors.append([np.abs(close - exact)[rows].max(), np.abs(far - exact)[rows].max()])
    relative_error, absolute_error = np.max(errors, axis=0)
    assert relative_error < 2e-5
    assert absolute_error > 5.0 * relative_error


def test_parameters_that_are_not_needed_are_left_out():
    _, relative, located, _ = rewritten(independent)
    assert relative.size1_in(1) == located.size1_out(0) == 2
    assert not np.any(np.asarray(ca.DM(located.jac_sparsity(0, 0), 1)))


class Drifting(PlanarPointMass):
    """A point mass in a current that differs from place to place."""

    def inputs(self, z, dz, ddz):
        return super().inputs(z, dz - 0.1 * ca.vertcat(ca.sin(z[1]), 0.0), ddz)


def test_a_vehicle_that_depends_on_its_place_plans_in_absolute_coordinates():
    for kind, relative in ((Drifting, 0), (PlanarPointMass, 1)):
        problem = replace(fossen(2, "hard"), vehicle=kind(drag=0.2, thrust_max=(1.0, 1.0)), hard=())
        assert f"#define GBT_RELATIVE {relative} " in generate_problem(problem).header


PROGRAM = """
#include <stdio.h>
#include <string.h>
#include <math.h>
#include "gbt_plan.h"
static gbt_planner planner;
static gbt_plan_result plan;
static gbt_real state[GBT_STATE], mean[(GBT_PIECES + 1) * 3], covariance[(GBT_PIECES + 1) * 9], desired[GBT_PIECES * 3];
static double fast(double speed)
{
    gbt_real still[GBT_STATE] = {0};
    still[GBT_FLAT] = (gbt_real)speed;
    gbt_plan_init(&planner);
    gbt_plan(&planner, still, mean, covariance, desired, &plan);
    printf("%d %d %g\\n", (int)plan.status, (int)plan.origin, (double)plan.piece_violation[0]);
    return plan.violation;
}
int main(void)
{
    const double place[3] = {PLACE}, base[3] = {BASE};
    gbt_plan_init(&planner);
    for (int j = 0; j < 3; j++) planner.origin[j] = base[j];
    for (int j = 0; j < 3; j++) state[j] = (gbt_real)(place[j] - base[j]);
    for (int k = 0; k < 20; k++) {
        for (int i = 0; i <= GBT_PIECES; i++) {
            const double t = 0.1 * (k + i), at[3] = {place[0] + 3 + 0.5 * t, place[1] + 1 + 0.3 * t, place[2] + 0.2};
            for (int j = 0; j < 3; j++) mean[3 * i + j] = (gbt_real)(at[j] - base[j]);
            for (int j = 0; j < 3; j++) covariance[9 * i + 4 * j] = (gbt_real)0.01;
            if (i < GBT_PIECES) desired[3 * i] = (gbt_real)cos(0.6 * t), desired[3 * i + 1] = (gbt_real)sin(0.6 * t);
        }
        gbt_plan(&planner, state, mean, covariance, desired, &plan);
        printf("%d %d", (int)plan.status, (int)plan.origin);
        for (int q = 0; q < GBT_LIMITS; q++) printf(" %.9g", (double)plan.given_up[q]);
        for (int j = 0; j < GBT_FLAT; j++)
            printf(" %.9g", (double)plan.endpoints[GBT_PIECES - 1][j] - (j < 3 ? place[j] - base[j] : 0));
        printf("\\n");
        for (int j = 0; j < GBT_FLAT; j++) {
            state[j] = plan.endpoints[0][j];
            state[GBT_FLAT + j] = plan.rates[0][j];
        }
    }
    /* the inputs within the result of the last plan */
    static gbt_plan_result whole;
    gbt_real *inside = &whole.top[0][0];
    gbt_planner copy = planner;
    gbt_plan(&copy, state, mean, covariance, desired, &plan);
    memcpy(inside, state, sizeof state);
    gbt_plan(&planner, inside, mean, covariance, desired, &whole);
    printf("aliased %d\\n", memcmp(&plan, &whole, sizeof plan) != 0);
    return 0;
}
"""


def limited(base):
    """Case 5 with zones, a seabed and limits on the target, at a place."""
    x, y, z = (float(number) for number in base)
    problem = fossen(3, "hard").subject_to(DepthLimits(z - 1.0, z + 0.4), nodes=4)
    problem = problem.subject_to(KeepOut((x + 1.2, y + 0.3, z), 0.5), nodes=4)
    corners = tuple((x + east, y + north) for east, north in CORNERS)
    problem = problem.subject_to_penalty(KeepOutPolygon(corners), nodes=4)
    problem = problem.subject_to(RangeLimits(3, nearest=1.0, farthest=9.0), nodes=4)
    return problem.subject_to_penalty(FieldOfView(3, 2.0), nodes=3)


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    """The C of the problem here and there."""
    if find_compiler() is None:
        pytest.skip("no C compiler")
    place = tmp_path_factory.mktemp("places")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("gbt_ocp.ocp.export.folder.find_compiler", lambda: None)  # sizes are of no interest here
        return {
            "here": write_c(Planner(limited(np.zeros(3)), "compiled"), place / "here"),
            "there": write_c(Planner(limited(UTM), "compiled"), place / "there"),
        }


def ran(folder, scratch, place, base, *flags):
    """The rows that the program above prints, where the vehicle begins at a place, in coordinates of a base."""
    text = PROGRAM.replace("PLACE", ", ".join(map(repr, map(float, place))))
    (scratch / "program.c").write_text(text.replace("BASE", ", ".join(map(repr, map(float, base)))))
    sources = [str(path) for path in sorted((folder / "src").glob("*.c"))]
    command = ["gcc", "-std=c99", "-O1", *flags, f"-I{folder / 'src'}", "program.c", *sources, "-lm", "-o", "program"]
    done = subprocess.run(command, cwd=scratch, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    shown = subprocess.run([scratch / "program"], capture_output=True, text=True, check=True).stdout.splitlines()
    assert shown[-1] == "aliased 0"
    return np.array([[float(word) for word in line.split()] for line in shown[:-1]])


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("gcc") is None, reason="no gcc")
def test_a_plan_does_not_depend_on_where_the_coordinates_begin(folders, tmp_path):
    nowhere = np.zeros(3)
    reference = ran(folders["here"], tmp_path, nowhere, nowhere)
    assert np.all(reference[:, 1] == 0)
    assert np.all(np.isin(reference[:, 0], (0, 6)))
    assert np.any(np.abs(np.diff(reference[:, -4:], axis=0)) > 1e-3), "the vehicle moves"
    # the heading at the end of a plan is nearly free: 1e-9 m at the start of the loop move it by 1e-2 rad
    position = slice(0, -1)
    # double precision, in map coordinates as they are, and from a base
    for base in (nowhere, UTM - 7.3):
        found = ran(folders["there"], tmp_path, UTM, base)
        np.testing.assert_allclose(found[:3], reference[:3], atol=2e-6)
        np.testing.assert_allclose(found[:, position], reference[:, position], atol=2e-3)
    # single precision from a base: what it is near the origin
    single = ran(folders["here"], tmp_path, nowhere, nowhere, "-DGBT_SINGLE")
    far = ran(folders["there"], tmp_path, UTM, UTM, "-DGBT_SINGLE")
    assert np.array_equal(far[:, :2], single[:, :2])
    np.testing.assert_allclose(far[:, position], single[:, position], atol=1e-4)
    np.testing.assert_allclose(single[:, position], reference[:, position], atol=2e-3)
