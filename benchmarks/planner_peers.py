"""Our planner against CasADi Opti, rockit and do-mpc on the same problem: the tables of docs/benchmarks.md.

    OPENBLAS_NUM_THREADS=1 python benchmarks/planner_peers.py --seconds 30 --figure docs/figures/planner_peers.png

The peers are set up in benchmarks/peers/, one short file each. Steps are those of recorded closed loops in the hard
form, taken one after another: every planner starts from its own last solution, shifted. Times are processor time of
the thread for the whole call of the package; "IPOPT alone" leaves out what the package does around IPOPT. "Build" has
the first solve in it, since rockit transcribes only then; our C code comes out of the cache if it is there. Objectives
(to be maximised) and thrust are those of one judge, benchmarks/peers/judge.py. A peer that is not installed is left
out, and the table says so.
"""

from __future__ import annotations

import argparse
import platform
import sys
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from time import thread_time
from typing import Any, NamedTuple

import numpy as np
from peers import NAMES, Answer, Statement, make
from peers.judge import Judge
from solver_instances import Instance, closed_loop_instances

from gbt_ocp.experiments.build.loop import build_loop
from gbt_ocp.experiments.config.loading import load_config
from gbt_ocp.ocp import TrajectoryProblem
from gbt_ocp.ocp.problem_data import HardLimit
from gbt_ocp.ocp.shooting import ShootingPlanner
from gbt_ocp.ocp.solvers.base import Solution, Solver
from gbt_ocp.ocp.solvers.compiled import CompiledSolver
from gbt_ocp.ocp.solvers.ipopt import IpoptSolver
from gbt_ocp.ocp.transcription import input_scale
from gbt_ocp.simulation.loop import simulate

warnings.filterwarnings("ignore", module=r"do_mpc|casadi")  # optional parts that are not installed


class Ours(NamedTuple):
    """A form of our own planner."""

    solver: type[CompiledSolver] | type[IpoptSolver]
    degree: int
    continuity: int | None
    nodes: int


OURS = {
    "compiled, degree 3, C1": Ours(CompiledSolver, 3, 1, 6),
    "compiled, degree 4, C1": Ours(CompiledSolver, 4, 1, 8),
    "compiled": Ours(CompiledSolver, 2, None, 4),
    "IPOPT": Ours(IpoptSolver, 2, None, 4),
}
"""The first is what the peers are held against: its pieces are as free as theirs. The last two are the paper's form."""

SETTLING = 2.0
"""Seconds after which errors of a closed loop count."""


@dataclass
class Steps:
    """What one planner did on the recorded steps, and how long it took to build, in processor seconds."""

    name: str
    build: float
    times: list[float] = field(default_factory=list)
    alone: list[float] = field(default_factory=list)
    solved: list[bool] = field(default_factory=list)
    iterations: list[int] = field(default_factory=list)
    objectives: list[float] = field(default_factory=list)
    peaks: list[float] = field(default_factory=list)

    def add(self, seconds: float, answer: Answer | Solution, judged: tuple[float, float]) -> None:
        """One more step; times are kept in milliseconds."""
        self.times.append(1e3 * seconds)
        self.alone.append(1e3 * getattr(answer, "solver_seconds", np.nan))
        self.solved.append(answer.solved)
        self.iterations.append(answer.iterations)
        self.objectives.append(judged[0])
        self.peaks.append(judged[1])


class PeerPlanner(ShootingPlanner):
    """A peer in the place of our own multiple shooting: the same call, the same answers to failure."""

    def __init__(self, problem: TrajectoryProblem, name: str) -> None:
        super().__init__(problem)
        began = thread_time()
        self.peer = make(name, Statement(problem))
        self.build_seconds = thread_time() - began
        self.seconds = 0.0
        self.answer: Answer | None = None

    def attempt(self, start: Any, objectives: Any, guess: Any) -> Solution:
        """One call of the peer from a guess of the held inputs ``(p, n)``."""
        states, _ = self._rollout(start.ravel(), guess.T)
        began = thread_time()
        answer = self.peer.solve(start.ravel(), np.vstack(objectives), np.asarray(states), guess.T)
        self.seconds, self.answer = thread_time() - began, answer
        # IPOPT widens bounds by its tolerance
        held = np.clip(answer.held, -self.gamma, self.gamma)
        return Solution(held, answer.solved, "solved" if answer.solved else answer.status, answer.iterations)


def recorded(case: str, seed: int, seconds: float) -> tuple[TrajectoryProblem, list[Instance]]:
    """First attempts of a closed loop's steps: what is asked again after a tightening or a failure is left out."""
    problem, asked = closed_loop_instances(case, "hard", 4, seed, seconds, 5)
    first = [k for k, item in enumerate(asked) if k == 0 or not np.array_equal(item.start, asked[k - 1].start)]
    return problem, [asked[k] for k in first]


def our_steps(problem: TrajectoryProblem, name: str, runs: Sequence[Sequence[Instance]], judge: Judge) -> Steps:
    """A form of this package's planner on the recorded steps, from its own shifted solutions."""
    began, ours = thread_time(), OURS[name]
    hard = (HardLimit(problem.hard[0].constraint, ours.nodes),)
    posed = replace(problem, degree=ours.degree, continuity=ours.continuity, hard=hard)
    solver: Solver = ours.solver(posed, {})
    coasting = np.zeros((posed.pieces, posed.freedoms))
    # the first call pays for what is set up late
    solver.solve(runs[0][0].start, runs[0][0].parameters, coasting, cold=True, tightening=0.0)
    steps = Steps(f"this package, {name}", thread_time() - began)
    for run in runs:
        guess, cold = coasting, True
        for item in run:
            began = thread_time()
            found = solver.solve(item.start, item.parameters, guess, cold=cold, tightening=0.0)
            seconds = thread_time() - began
            top = found.variables * input_scale(posed)
            steps.add(seconds, found, judge.flat(item.start, top, item.parameters))
            cold = not found.solved
            guess = coasting if cold else np.vstack([found.variables[1:], coasting[:1]])
    return steps


def peer_steps(problem: TrajectoryProblem, name: str, runs: Sequence[Sequence[Instance]], judge: Judge) -> Steps:
    """A peer on the recorded steps."""
    planner = PeerPlanner(problem, name)
    coasting = np.zeros((problem.pieces, problem.vehicle.flat_dimension))
    planner.attempt(runs[0][0].start, runs[0][0].parameters, coasting)
    steps = Steps(NAMES[name], planner.build_seconds + planner.seconds)
    for run in runs:
        guess = coasting
        for item in run:
            found = planner.attempt(item.start, item.parameters, guess)
            assert planner.answer is not None, "just called"
            steps.add(planner.seconds, planner.answer, judge.held(item.start, found.variables, item.parameters))
            guess = np.vstack([found.variables[1:], coasting[:1]]) if found.solved else coasting
    return steps


def table(results: Sequence[Steps], write: Callable[[str], None]) -> None:
    """Times and objectives; ratios and differences are against the first."""
    write(
        "| | build and first solve s | solved | iterations | median ms | 99 % ms | IPOPT alone, median ms "
        "| times the first | IPOPT alone, times the first | objective, mean "
        "| minus the first's: mean (5 % to 95 %) | largest thrust |"
    )
    write("|" + "---|" * 12)
    base = results[0]
    for steps in results:
        both = np.array(steps.solved) & np.array(base.solved)
        values, gaps = np.array(steps.objectives), np.array(steps.objectives) - np.array(base.objectives)
        median, alone, first = np.median(steps.times), np.median(steps.alone), np.median(base.times)
        low, high = np.percentile(gaps[both], [5.0, 95.0])
        inner = ("", "") if np.isnan(alone) else (f"{alone:.2f}", f"{alone / first:.0f}")
        write(
            f"| {steps.name} | {steps.build:.2f} | {sum(steps.solved)} of {len(steps.solved)} "
            f"| {np.mean(steps.iterations):.1f} | {median:.3f} | {np.percentile(steps.times, 99):.3f} | {inner[0]} "
            f"| {median / first:.1f} | {inner[1]} | {values[both].mean():.4f} "
            f"| {gaps[both].mean():+.4f} ({low:+.4f} to {high:+.4f}) "
            f"| {np.max(np.array(steps.peaks)[np.array(steps.solved)]):.3f} |"
        )


def closed_loop(case: str, name: str, seed: int, seconds: float) -> tuple[float, float, float, float]:
    """Settled error in m, median distance in m, median solve in ms, share solved at once, with this planner."""
    ours = OURS.get(name, OURS["compiled"])  # a peer takes the place of the planner
    overrides = ["planner.formulation=hard", "planner.pieces=5", f"planner.nodes={ours.nodes}"]
    overrides += [f"planner.degree={ours.degree}", f"planner.continuity={'null' if ours.continuity is None else 1}"]
    overrides.append(f"planner.solver={ours.solver.name}")
    loop, start = build_loop(load_config(case, overrides=overrides, seed=seed))
    if name not in OURS:
        guidance: Any = loop.guidance  # the configurations plan
        guidance.planner = PeerPlanner(guidance.planner.problem, name)
    arrays = simulate(loop, start, seconds).arrays
    late = arrays["t"] >= SETTLING - 1e-9
    distance = np.linalg.norm(arrays["target"] - arrays["vehicle_pose"][:, : loop.target.dimension], axis=1)
    solved = np.mean((arrays["solver_status"] == "solved") & (arrays["fallback"] == ""))
    return (
        float(arrays["error"].mean(axis=1)[late].mean()),
        float(np.median(distance[late])),
        1e3 * float(np.median(arrays["solver_time"])),
        float(solved),
    )


def loops(case: str, names: Sequence[str], arguments: argparse.Namespace, write: Callable[[str], None]) -> None:
    """Every planner flies the case itself."""
    write(f"\nClosed loop, {case}, {arguments.loop_seconds:.0f} s, {arguments.loop_seeds} seeds\n")
    write("| planner | settled error: mean m (each seed) | median distance m | solved at once | planner, wall ms |")
    write("|---|---|---|---|---|")
    for name in names:
        rows = [closed_loop(case, name, seed, arguments.loop_seconds) for seed in range(arguments.loop_seeds)]
        error, distance, time, solved = np.array(rows).T
        each = ", ".join(f"{value:.4f}" for value in error)
        label = f"this package, {name}" if name in OURS else NAMES[name]
        write(
            f"| {label} | {error.mean():.4f} ({each}) | {distance.mean():.2f} | {solved.mean():.1%} "
            f"| {np.median(time):.2f} |"
        )


def installed() -> tuple[list[str], list[str]]:
    """Peers that are there, and a line for each that is not."""
    there, missing = [], []
    for name, package in zip(NAMES, ("casadi", "rockit-meco", "do-mpc"), strict=True):
        try:
            version(package)
            there.append(name)
        except PackageNotFoundError:
            missing.append(f"{NAMES[name]} is left out: {package} is not installed (pip install gbt_ocp[bench]).")
    return there, missing


def machine() -> str:
    """Machine and versions in one line."""
    cpu = platform.machine()
    if Path("/proc/cpuinfo").is_file():
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace").splitlines()
        cpu = next((line.partition(":")[2].strip() for line in lines if line.startswith("model name")), cpu)
    found = []
    for package in ("casadi", "rockit-meco", "do-mpc", "numpy"):
        try:
            found.append(f"{package} {version(package)}")
        except PackageNotFoundError:
            found.append(f"no {package}")
    return f"{cpu}, {platform.system()}, Python {platform.python_version()}, {', '.join(found)}"


def main() -> None:
    """All tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cases", default="case2,case5")
    parser.add_argument("--seconds", type=float, default=30.0, help="length of the recorded runs")
    parser.add_argument("--seeds", type=int, default=1, help="number of the recorded runs")
    parser.add_argument("--loop-seconds", type=float, default=10.0, help="length of the closed loops; 0 for none")
    parser.add_argument("--loop-seeds", type=int, default=3)
    parser.add_argument("--figure", type=Path, help="where to write the figure")
    arguments = parser.parse_args()

    def write(line: str) -> None:
        print(line, flush=True)

    there, missing = installed()
    write(machine())
    for line in missing:
        write(line)
    shown: dict[str, list[Steps]] = {}
    for case in arguments.cases.split(","):
        runs = []
        for seed in range(arguments.seeds):
            problem, asked = recorded(case, seed, arguments.seconds)
            runs.append(asked)
        judge = Judge(problem)
        results = [our_steps(problem, name, runs, judge) for name in OURS]
        results += [peer_steps(problem, name, runs, judge) for name in there]
        write(f"\nRecorded steps, {case}, p = 5, hard, {sum(map(len, runs))} steps\n")
        table(results, write)
        shown[case] = results
    if arguments.loop_seconds > 0.0:
        for case in arguments.cases.split(","):
            loops(case, [*OURS, *there], arguments, write)
    if arguments.figure is not None:
        from planner_peers_figure import draw

        draw(shown, arguments.figure)


if __name__ == "__main__":
    sys.exit(main())
