"""Generated C under both compilers, the sanitizers, absurd input and two threads; see docs/reliability.md."""

import re
import shutil
import subprocess
from dataclasses import replace
from itertools import product
from pathlib import Path

import pytest
from test_codegen import fossen, with_target_limits

from gbt_ocp.ocp.codegen.library import find_compiler
from gbt_ocp.ocp.export.folder import write_c
from gbt_ocp.ocp.planner import Planner

pytestmark = [
    pytest.mark.skipif(find_compiler() is None, reason="no C compiler"),
    pytest.mark.skipif(shutil.which("make") is None, reason="no make"),
]

FUZZ = Path(__file__).parent / "generated_fuzz.c"
DEFINED = ["-ffp-contract=off", "-DFUZZ_FORCE=5000.0", "-DFUZZ_MOMENT=1500.0"]
WARNINGS = ["-Wall", "-Wextra", "-Wpedantic", "-Werror"]


def free_pieces():
    """Case 2 with pieces of degree 4 that share only position and velocity."""
    problem = fossen(2, "hard")
    hard = tuple(replace(limit, nodes=8) for limit in problem.hard)
    return replace(problem, degree=4, continuity=1, hard=hard)


PROBLEMS = {
    "case2": lambda: fossen(2, "hard"),
    "case5": lambda: fossen(3, "penalty"),
    "limits": lambda: with_target_limits(2),
    "free pieces": free_pieces,
}
SANITIZERS = [("gcc", "address,undefined"), ("clang", "address,undefined"), ("clang", "memory")]
BUILDS = list(product(("gcc", "clang"), ("-O0", "-O3"), ("c99", "c11")))

QUICK = [
    ("case5", "gcc", "-O0", "c99"),
    ("case5", "clang", "-O3", "c11"),
    ("limits", "clang", "-O0", "c99"),
    ("free pieces", "gcc", "-O3", "c11"),
    ("limits", "gcc", "address,undefined"),
    ("free pieces", "clang", "address,undefined"),
    ("case5", "clang", "memory"),
]
"""Every compiler, level, standard, sanitizer and form of a problem once; all combinations of them are slow."""


def combinations(builds):
    """Parameters of a test: problem and build, those that are not :data:`QUICK` among the slow ones."""
    every = [(name, *build) for name in PROBLEMS for build in builds]
    return [pytest.param(*one, marks=[] if one in QUICK else pytest.mark.slow) for one in every]


@pytest.fixture(scope="module")
def folder(request, tmp_path_factory):
    return write_c(Planner(PROBLEMS[request.param](), "compiled"), tmp_path_factory.mktemp("generated") / "planner")


def build(folder, scratch, compiler, *flags):
    """The fuzzer with the planner of this folder; skips where compiler or flags are not to be had."""
    if shutil.which(compiler) is None:
        pytest.skip(f"no {compiler}")
    (scratch / "empty.c").write_text("int main(void) { return 0; }\n")
    tried = subprocess.run([compiler, *flags, "empty.c", "-o", "empty"], cwd=scratch, capture_output=True, check=False)
    if tried.returncode != 0 or subprocess.run([scratch / "empty"], check=False).returncode != 0:
        pytest.skip(f"{compiler} cannot build and run with {' '.join(flags)}")
    sources = [str(FUZZ), *(str(path) for path in sorted((folder / "src").glob("*.c")))]
    command = [compiler, *DEFINED, *flags, f"-I{folder / 'src'}", *sources, "-o", str(scratch / "fuzz"), "-lm"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return scratch / "fuzz"


def fuzz(program, *arguments):
    done = subprocess.run([program, *map(str, arguments)], capture_output=True, text=True, check=False)
    assert done.returncode == 0, (done.stdout + done.stderr)[-3000:]
    return done.stdout


@pytest.mark.parametrize(("folder", "compiler", "level", "standard"), combinations(BUILDS), indirect=["folder"])
@pytest.mark.long
def test_no_warnings_and_every_plan_as_it_says(folder, tmp_path, compiler, level, standard):
    program = build(folder, tmp_path, compiler, f"-std={standard}", level, *WARNINGS)
    counts = [int(number) for number in re.findall(r"\d+", fuzz(program, 60, 1))]
    assert counts[0] == 60
    assert counts[1] > 20, "most problems must be solved"
    assert counts[3] > 0, "some input must be refused"


@pytest.mark.parametrize(("folder", "compiler", "sanitizer"), combinations(SANITIZERS), indirect=["folder"])
@pytest.mark.long
def test_no_sanitizer_report(folder, tmp_path, compiler, sanitizer):
    flags = ["-O1", f"-fsanitize={sanitizer}", "-fno-sanitize-recover=all"]
    fuzz(build(folder, tmp_path, compiler, "-std=c99", *flags), 60, 2)


@pytest.mark.parametrize("folder", ["limits"], indirect=True)
@pytest.mark.long
def test_two_threads_with_a_planner_each_give_the_same_bytes(folder, tmp_path):
    flags = ["-std=c99", "-O2", "-pthread", "-D_POSIX_C_SOURCE=200112L", "-DFUZZ_THREADS"]
    fuzz(build(folder, tmp_path, "gcc", *flags), 60, 3, "threads")


@pytest.mark.slow
@pytest.mark.parametrize("folder", PROBLEMS, indirect=True)
@pytest.mark.parametrize(("compiler", "sanitizer"), SANITIZERS)
def test_a_hundred_thousand_problems_without_a_report(folder, tmp_path, compiler, sanitizer):
    flags = ["-O1", f"-fsanitize={sanitizer}", "-fno-sanitize-recover=all"]
    # twelve builds together make 100,000
    print(fuzz(build(folder, tmp_path, compiler, "-std=c99", *flags), 8_334, 4))
