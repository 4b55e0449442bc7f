"""The kernel of this checkout against that of an earlier commit: time a call, instructions, objective, iterations.

    OPENBLAS_NUM_THREADS=1 python benchmarks/kernel_versions.py --base e63aa57

Both commits generate the C of the same problems (cases 2 and 5, hard limits; flat of degree 2 and 4, held thrust), each
with its own code generator in a process of its own. Both are compiled with the flags of the compiled solver and called
in turn on the same recorded steps, each from its own last solution, shifted. A time is the processor time of a call of
``gbt_solve``, the least of ``--repeats`` passes. ``--instructions`` counts with valgrind, which has to be there, what
all steps of one pass execute.
"""

from __future__ import annotations

import argparse
import ctypes
import io
import json
import os
import re
import subprocess
import sys
import tarfile
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from time import thread_time_ns

import numpy as np

from gbt_ocp.ocp import ShootingProblem, TrajectoryProblem
from gbt_ocp.ocp.codegen.library import FLAGS, find_compiler, kernel_files
from gbt_ocp.ocp.codegen.problem_source import generate_problem
from gbt_ocp.ocp.plan_forms import plan_form
from gbt_ocp.ocp.problem_data import HardLimit, PosedProblem
from gbt_ocp.ocp.solvers.compiled import CompiledSolver

FORMS = ("degree 2", "degree 4, C1", "held thrust")
HERE = Path(__file__).resolve()


def posed(problem: TrajectoryProblem, form: str) -> PosedProblem:
    """A recorded problem in one of :data:`FORMS`."""
    limit = problem.hard[0].constraint
    if form == "degree 2":
        return problem
    if form == "degree 4, C1":
        return replace(problem, degree=4, continuity=1, hard=(HardLimit(limit, 8),))
    shooting = ShootingProblem(problem.vehicle, problem.pieces, problem.period, steps=1)
    for term in problem.objectives:
        shooting = shooting.maximize(term)
    return shooting.subject_to(limit)


def problem_of(case: str, pieces: int) -> TrajectoryProblem:
    """The flat problem of a configuration, without recording any step."""
    from gbt_ocp.experiments.build.loop import build_loop
    from gbt_ocp.experiments.config.loading import load_config

    overrides = ["planner.formulation=hard", "planner.nodes=4", "planner.solver=compiled", f"planner.pieces={pieces}"]
    loop, _ = build_loop(load_config(case, overrides=overrides, seed=0))
    problem = loop.guidance.planner.problem  # type: ignore[attr-defined]  # the configurations plan
    assert isinstance(problem, TrajectoryProblem), "the configurations are flat"
    return problem


def emit(out: Path, cases: Sequence[str], pieces: int) -> None:
    """Write the C of all problems with the package that this process imports."""
    for case in cases:
        problem = problem_of(case, pieces)
        for form in FORMS:
            folder = out / f"{case}, {form}"
            folder.mkdir(parents=True)
            files = kernel_files(shooting=form == "held thrust") | generate_problem(posed(problem, form)).files
            for name, text in files.items():
                (folder / name).write_text(text, encoding="utf-8")


def emitted(tree: Path, out: Path, cases: Sequence[str], pieces: int) -> None:
    """Have the package of a tree write its C."""
    command = [sys.executable, str(HERE), "--emit", str(out), "--cases", ",".join(cases), "--pieces", str(pieces)]
    subprocess.run(command, check=True, env={**os.environ, "PYTHONPATH": str(tree)})


def checked_out(commit: str, folder: Path) -> Path:
    """The files of a commit."""
    packed = subprocess.run(["git", "archive", commit], check=True, capture_output=True, cwd=HERE.parent.parent).stdout
    with tarfile.open(fileobj=io.BytesIO(packed)) as archive:
        archive.extractall(folder, filter="data")
    return folder


class Result(ctypes.Structure):
    """``gbt_result``."""

    _fields_ = [
        *((name, ctypes.c_int) for name in ("status", "iterations", "starts")),
        *((name, ctypes.c_double) for name in ("residual", "violation", "objective")),
    ]


@dataclass
class Kernel:
    """A compiled kernel with its warm start, and what its calls gave; ``shape`` is pieces and freedoms."""

    path: Path
    shape: tuple[int, int]
    held: bool
    times: list[float] = field(default_factory=list)
    objectives: list[float] = field(default_factory=list)
    iterations: list[int] = field(default_factory=list)
    solved: list[bool] = field(default_factory=list)

    def __post_init__(self) -> None:
        library = ctypes.CDLL(str(self.path))
        library.gbt_workspace_bytes.restype = ctypes.c_size_t
        library.gbt_solve.argtypes = [ctypes.c_void_p] * 4 + [ctypes.c_int] + [ctypes.c_void_p] * 3
        self._solve = library.gbt_solve
        self._work = np.zeros(library.gbt_workspace_bytes() // 8 + 1)
        self._settings = np.zeros(64)
        library.gbt_default_settings(ctypes.c_void_p(self._settings.ctypes.data))
        self._none, self._result = np.zeros(64), Result()
        self.forget()

    def forget(self) -> None:
        """Begin a pass: no plan to start from."""
        self._guess, self._warm = np.zeros(self.shape), False
        self.objectives, self.iterations, self.solved = [], [], []

    def step(self, start: np.ndarray, numbers: np.ndarray) -> float:
        """Solve one step; processor time in microseconds."""
        pointers = [array.ctypes.data for array in (self._settings, start, numbers, self._none)]
        guess, work = self._guess.ctypes.data, self._work.ctypes.data
        result, warm = ctypes.byref(self._result), int(self._warm)
        began = thread_time_ns()
        status = self._solve(*pointers, warm, guess, work, result)
        microseconds = 1e-3 * (thread_time_ns() - began)
        self._warm = status in (0, 6)  # solved, also where limits gave way
        self.objectives.append(self._result.objective)
        self.iterations.append(self._result.iterations)
        self.solved.append(self._warm)
        self._guess[:-1] = self._guess[1:]
        if not self._warm:
            self._guess[:] = 0.0
        elif not self.held:
            self._guess[-1] = 0.0
        return microseconds


def recorded_steps(case: str, seconds: float, pieces: int) -> tuple[TrajectoryProblem, list[tuple[np.ndarray, list]]]:
    """Starts and parameters of the first attempts of a closed loop's steps."""
    from solver_instances import closed_loop_instances

    problem, asked = closed_loop_instances(case, "hard", 4, 0, seconds, pieces)
    first = [k for k, item in enumerate(asked) if k == 0 or not np.array_equal(item.start, asked[k - 1].start)]
    return problem, [(asked[k].start, asked[k].parameters) for k in first]


def in_kernel(problem: PosedProblem, steps: Sequence[tuple[np.ndarray, list]]) -> Iterator[tuple[np.ndarray, ...]]:
    """Starts and numbers as the kernel takes them, relative to where the plan begins."""
    # the package of the earlier commit, which this file runs with too, has it elsewhere
    from gbt_ocp.ocp.solvers.kernel_arrays import stacked_parameters

    coordinates, form = CompiledSolver(problem, {})._coordinates, plan_form(problem)
    for start, parameters in steps:
        origin, begin = coordinates.begin(form.start(start) if isinstance(problem, ShootingProblem) else start)
        ends = coordinates.placed("ends", origin, stacked_parameters(parameters), problem.pieces)
        yield np.array(begin).ravel(), np.array(ends).ravel()


def compiled(folder: Path) -> Path:
    """The shared library of a folder's C."""
    compiler, library = find_compiler(), folder / "kernel.so"
    assert compiler is not None, "a C compiler is needed"
    sources = sorted(map(str, folder.glob("*.c")))
    subprocess.run([*compiler, *FLAGS, "-g", "-o", str(library), *sources, "-lm"], check=True)
    return library


def passes(kernels: Sequence[Kernel], steps: Sequence[tuple[np.ndarray, ...]], repeats: int) -> None:
    """All kernels on all steps, one after another at every step."""
    times = np.full((len(kernels), len(steps)), np.inf)
    for _ in range(repeats):
        for kernel in kernels:
            kernel.forget()
        for k, step in enumerate(steps):
            for number, kernel in enumerate(kernels):
                times[number, k] = min(times[number, k], kernel.step(*step))
    for kernel, row in zip(kernels, times, strict=True):
        kernel.times = row.tolist()


def instructions(library: Path, shape: tuple[int, int], held: bool, steps: Sequence[tuple[np.ndarray, ...]]) -> int:
    """What gbt_solve and all below it execute on the steps, counted by valgrind."""
    with tempfile.TemporaryDirectory() as place:
        np.savez(Path(place, "steps.npz"), start=[one[0] for one in steps], numbers=[one[1] for one in steps])
        counted = Path(place, "counted")
        what = json.dumps([str(library), list(shape), held, str(Path(place, "steps.npz"))])
        command = ["valgrind", "--tool=callgrind", f"--callgrind-out-file={counted}", "--toggle-collect=gbt_solve"]
        command += [sys.executable, str(HERE), "--replay", what]
        subprocess.run(command, check=True, capture_output=True)
        found = re.search(r"^(?:summary|totals): (\d+)", counted.read_text(encoding="utf-8"), re.MULTILINE)
    assert found is not None, "callgrind writes a total"
    return int(found[1])


def replay(what: str) -> None:
    """One pass of one kernel, for :func:`instructions`."""
    library, shape, held, path = json.loads(what)
    with np.load(path) as kept:
        steps = list(zip(kept["start"], kept["numbers"], strict=True))
    passes([Kernel(Path(library), tuple(shape), held)], steps, 1)


def main() -> None:
    """Print the table as Markdown."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--base", default="HEAD", help="commit to compare with")
    parser.add_argument("--cases", default="case2,case5")
    parser.add_argument("--pieces", type=int, default=5)
    parser.add_argument("--seconds", type=float, default=30.0, help="length of the recorded runs")
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--instructions", action="store_true", help="count instructions with valgrind, too")
    parser.add_argument("--emit", type=Path, help=argparse.SUPPRESS)
    parser.add_argument("--replay", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    cases = arguments.cases.split(",")
    if arguments.emit is not None:
        emit(arguments.emit, cases, arguments.pieces)
        return
    if arguments.replay is not None:
        replay(arguments.replay)
        return
    counted = " | instructions, ratio" if arguments.instructions else ""
    print(
        f"| case, form | solved | iterations, mean | median µs: {arguments.base} | here | ratio | 99 % over median "
        f"| objective less that of {arguments.base}: mean | steps that differ by more than 1e-4{counted} |"
    )
    print("|" + "---|" * (10 if arguments.instructions else 9))
    with tempfile.TemporaryDirectory() as place:
        emitted(checked_out(arguments.base, Path(place, "base")), Path(place, "then"), cases, arguments.pieces)
        emitted(HERE.parent.parent, Path(place, "now"), cases, arguments.pieces)
        for case in cases:
            flat, steps = recorded_steps(case, arguments.seconds, arguments.pieces)
            for form in FORMS:
                problem, held = posed(flat, form), form == "held thrust"
                shape = problem.pieces, problem.freedoms
                libraries = [compiled(Path(place, when, f"{case}, {form}")) for when in ("then", "now")]
                kernels = [Kernel(library, shape, held) for library in libraries]
                given = list(in_kernel(problem, steps))
                passes(kernels, given, arguments.repeats)
                then, now = kernels
                medians = [float(np.median(kernel.times)) for kernel in kernels]
                gaps = np.array(now.objectives) - np.array(then.objectives)
                cells = [
                    f"{case}, {form}",
                    f"{sum(now.solved)} of {len(now.solved)}",
                    f"{np.mean(then.iterations):.1f}, {np.mean(now.iterations):.1f}",
                    *(f"{median:.0f}" for median in medians),
                    f"{medians[1] / medians[0]:.2f}",
                    f"{np.percentile(now.times, 99) / medians[1]:.1f}",
                    f"{gaps.mean():+.1e}",
                    f"{np.sum(np.abs(gaps) > 1e-4)}",
                ]
                if arguments.instructions:
                    counts = [instructions(library, shape, held, given) for library in libraries]
                    cells.append(f"{counts[1] / counts[0]:.2f}")
                print(f"| {' | '.join(cells)} |", flush=True)


if __name__ == "__main__":
    main()
