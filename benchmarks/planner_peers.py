"""Our planner against alpaqa, fatrop, CasADi Opti, rockit and do-mpc on the same problem: tables of docs/benchmarks.

    OPENBLAS_NUM_THREADS=1 python benchmarks/planner_peers.py --seconds 30 --pieces 5 --json peers.json

The peers are set up in benchmarks/peers/, one short file each. Steps are those of recorded closed loops in the hard
form. All planners take a step before the next one comes, so that they share what the machine does meanwhile, and every
planner starts from its own last solution, shifted. Times are processor time of the thread for the whole call of the
package; "solver alone" leaves out what the package does around its solver. "Build" has the first solve in it, since
rockit transcribes only then; our C code comes out of the cache if it is there. Objectives (to be maximised) and thrust
are those of one judge, benchmarks/peers/judge.py. A peer that is not installed is left out, and the table says so.

``--json`` writes a row a case, solver and form: case, solver, form, pieces, steps, solved, call_ms_median,
call_ms_p99, objective_mean, violation_max.
"""

from __future__ import annotations

import argparse
import json
import platform
import sys
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from time import thread_time
from typing import Any, Literal, NamedTuple, Protocol

import numpy as np
from peers import NAMES, PACKAGES, Answer, Statement, make
from peers.judge import Judge
from solver_instances import Instance, closed_loop_instances

from gbt_ocp.experiments.build.loop import build_loop
from gbt_ocp.experiments.config.loading import load_config
from gbt_ocp.ocp import ShootingProblem, TrajectoryProblem
from gbt_ocp.ocp.plan_forms import plan_form
from gbt_ocp.ocp.problem_data import HardLimit
from gbt_ocp.ocp.shooting import ShootingPlanner
from gbt_ocp.ocp.solvers.base import Solution, Solver
from gbt_ocp.ocp.solvers.compiled import CompiledSolver
from gbt_ocp.ocp.solvers.ipopt import IpoptSolver
from gbt_ocp.ocp.transcription import input_scale
from gbt_ocp.simulation.loop import simulate

warnings.filterwarnings("ignore", module=r"do_mpc|casadi")  # optional parts that are not installed


class Flat(NamedTuple):
    """A flat form of our own planner."""

    solver: type[CompiledSolver] | type[IpoptSolver]
    degree: int
    continuity: int | None
    nodes: int


class Shooting(NamedTuple):
    """A form of our own planner that integrates, always compiled."""

    thrust: Literal["held", "linear"]


OURS: dict[str, Flat | Shooting] = {
    "degree 4, C1": Flat(CompiledSolver, 4, 1, 4),
    "degree 3, C1": Flat(CompiledSolver, 3, 1, 4),
    "degree 2": Flat(CompiledSolver, 2, None, 4),
    "held thrust": Shooting("held"),
    "linear thrust": Shooting("linear"),
    "degree 2, IPOPT": Flat(IpoptSolver, 2, None, 4),
}
"""The first is what all others are held against. Degree 2 is the paper's form."""

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

    def row(self, case: str, pieces: int) -> dict[str, Any]:
        """What ``--json`` says of them; means and the largest violation are over the solved steps."""
        solver, form = (self.name.removeprefix("this package, "), "held thrust")
        if self.name.startswith("this package, "):
            form = solver.removesuffix(", IPOPT")
            solver = "gbt_ocp, IPOPT" if solver.endswith("IPOPT") else "gbt_ocp"
        solved = np.array(self.solved)
        return {
            "case": case,
            "solver": solver,
            "form": form,
            "pieces": pieces,
            "steps": len(self.solved),
            "solved": int(solved.sum()),
            "call_ms_median": float(np.median(self.times)),
            "call_ms_p99": float(np.percentile(self.times, 99)),
            "objective_mean": float(np.mean(np.array(self.objectives)[solved])),
            "violation_max": float(max(0.0, np.max(np.array(self.peaks)[solved]) - 1.0)),
        }


class Runner(Protocol):
    """A planner that takes recorded steps one after another, from its own shifted solutions."""

    steps: Steps

    def begin(self) -> None:
        """Forget the last solution."""

    def take(self, item: Instance) -> None:
        """Solve one more step."""


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


def recorded(case: str, seed: int, seconds: float, pieces: int) -> tuple[TrajectoryProblem, list[Instance]]:
    """First attempts of a closed loop's steps: what is asked again after a tightening or a failure is left out."""
    problem, asked = closed_loop_instances(case, "hard", 4, seed, seconds, pieces)
    first = [k for k, item in enumerate(asked) if k == 0 or not np.array_equal(item.start, asked[k - 1].start)]
    return problem, [asked[k] for k in first]


class OurRunner:
    """A form of this package's planner."""

    def __init__(self, problem: TrajectoryProblem, name: str, first: Instance, judge: Judge) -> None:
        began, ours = thread_time(), OURS[name]
        limit, self._judge = problem.hard[0].constraint, judge
        posed: Any
        self._solver: Solver
        if isinstance(ours, Flat):
            hard = (HardLimit(limit, ours.nodes),)
            posed = replace(problem, degree=ours.degree, continuity=ours.continuity, hard=hard)
            self._solver = ours.solver(posed, {})
        else:
            posed = ShootingProblem(problem.vehicle, problem.pieces, problem.period, thrust=ours.thrust, steps=1)
            for objective in problem.objectives:
                posed = posed.maximize(objective)
            posed = posed.subject_to(limit, nodes=1)
            self._solver = CompiledSolver(posed, {})
        self._flat = isinstance(ours, Flat)
        # thrust comes in units of its limit, a derivative in units of its natural size
        self._scale = input_scale(posed) if self._flat else np.ones(posed.freedoms)
        self._coasting = np.zeros((posed.pieces, posed.freedoms))
        self._start = plan_form(posed).start  # the state of the vehicle, where it is integrated
        # the first call pays for what is set up late
        self._solver.solve(self._start(first.start), first.parameters, self._coasting, cold=True, tightening=0.0)
        self.steps = Steps(f"this package, {name}", thread_time() - began)
        self.begin()

    def begin(self) -> None:
        """Forget the last solution."""
        self._guess, self._cold = self._coasting, True

    def take(self, item: Instance) -> None:
        """Solve one more step."""
        start = self._start(item.start)
        began = thread_time()
        found = self._solver.solve(start, item.parameters, self._guess, cold=self._cold, tightening=0.0)
        seconds = thread_time() - began
        variables = found.variables * self._scale
        judge = self._judge.flat if self._flat else self._judge.thrust
        self.steps.add(seconds, found, judge(item.start, variables, item.parameters))
        self._cold = not found.solved
        self._guess = self._coasting if self._cold else np.vstack([found.variables[1:], self._coasting[:1]])


class PeerRunner:
    """A peer."""

    def __init__(self, problem: TrajectoryProblem, name: str, first: Instance, judge: Judge) -> None:
        self._planner, self._judge = PeerPlanner(problem, name), judge
        self._coasting = np.zeros((problem.pieces, problem.vehicle.flat_dimension))
        self._planner.attempt(first.start, first.parameters, self._coasting)
        self.steps = Steps(NAMES[name], self._planner.build_seconds + self._planner.seconds)
        self.begin()

    def begin(self) -> None:
        """Forget the last solution."""
        self._guess = self._coasting

    def take(self, item: Instance) -> None:
        """Solve one more step."""
        planner = self._planner
        found = planner.attempt(item.start, item.parameters, self._guess)
        assert planner.answer is not None, "just called"
        judged = self._judge.held(item.start, found.variables, item.parameters)
        self.steps.add(planner.seconds, planner.answer, judged)
        self._guess = np.vstack([found.variables[1:], self._coasting[:1]]) if found.solved else self._coasting


def taken(runners: Sequence[Runner], runs: Sequence[Sequence[Instance]]) -> list[Steps]:
    """The steps of all runs by all runners in turn."""
    for run in runs:
        for runner in runners:
            runner.begin()
        for item in run:
            for runner in runners:
                runner.take(item)
    return [runner.steps for runner in runners]


def table(results: Sequence[Steps], write: Callable[[str], None]) -> None:
    """Times and objectives; ratios and differences are against the first."""
    write(
        "| | build and first solve s | solved | iterations | median ms | 99 % ms | solver alone, median ms "
        "| times the first | solver alone, times the first | objective, mean "
        "| minus the first's: mean (5 % to 95 %) | median | largest thrust |"
    )
    write("|" + "---|" * 13)
    base = results[0]
    for steps in results:
        both = np.array(steps.solved) & np.array(base.solved)
        values, gaps = np.array(steps.objectives), np.array(steps.objectives) - np.array(base.objectives)
        median, alone, first = np.median(steps.times), np.median(steps.alone), np.median(base.times)
        low, high = np.percentile(gaps[both], [5.0, 95.0])
        inner = ("", "") if np.isnan(alone) else (f"{alone:.2f}", f"{alone / first:.2f}")
        write(
            f"| {steps.name} | {steps.build:.2f} | {sum(steps.solved)} of {len(steps.solved)} "
            f"| {np.mean(steps.iterations):.1f} | {median:.3f} | {np.percentile(steps.times, 99):.3f} | {inner[0]} "
            f"| {median / first:.2f} | {inner[1]} | {values[both].mean():.4f} "
            f"| {gaps[both].mean():+.4f} ({low:+.4f} to {high:+.4f}) | {np.median(gaps[both]):+.4f} "
            f"| {np.max(np.array(steps.peaks)[np.array(steps.solved)]):.3f} |"
        )


def closed_loop(case: str, name: str, seed: int, seconds: float, pieces: int) -> tuple[float, float, float, float]:
    """Settled error in m, median distance in m, median solve in ms, share solved at once, with this planner."""
    ours = OURS.get(name, OURS["degree 2"])  # a peer takes the place of the planner
    overrides = ["planner.formulation=hard", f"planner.pieces={pieces}"]
    if isinstance(ours, Flat):
        overrides += [f"planner.degree={ours.degree}", f"planner.continuity={'null' if ours.continuity is None else 1}"]
        overrides += [f"planner.nodes={ours.nodes}", f"planner.solver={ours.solver.name}"]
    else:
        overrides += ["planner.form=shooting", f"planner.thrust={ours.thrust}", "planner.steps=1", "planner.nodes=1"]
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
        seeds, seconds = range(arguments.loop_seeds), arguments.loop_seconds
        rows = [closed_loop(case, name, seed, seconds, arguments.pieces) for seed in seeds]
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
    for name, package in PACKAGES.items():
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
    for package in (*dict.fromkeys(PACKAGES.values()), "numpy"):
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
    parser.add_argument("--pieces", type=int, default=5, help="p, periods of a plan")
    parser.add_argument("--planners", help="those of the tables, with ; between: forms of ours and modules of peers")
    parser.add_argument("--json", type=Path, help="where to write a row a case, solver and form")
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
    chosen = [*OURS, *there]
    if arguments.planners is not None:
        chosen = [name.strip() for name in arguments.planners.split(";")]
        unknown = [name for name in chosen if name not in (*OURS, *there)]
        if unknown:
            parser.error(f"--planners: found {'; '.join(unknown)}; allowed: {'; '.join((*OURS, *there))}")
    shown: dict[str, list[Steps]] = {}
    rows = []
    for case in arguments.cases.split(","):
        runs = []
        for seed in range(arguments.seeds):
            problem, asked = recorded(case, seed, arguments.seconds, arguments.pieces)
            runs.append(asked)
        judge = Judge(problem)
        runners = [(OurRunner if name in OURS else PeerRunner)(problem, name, runs[0][0], judge) for name in chosen]
        results = taken(runners, runs)
        write(f"\nRecorded steps, {case}, p = {arguments.pieces}, hard, {sum(map(len, runs))} steps\n")
        table(results, write)
        shown[case] = results
        rows += [steps.row(case, arguments.pieces) for steps in results]
    if arguments.json is not None:
        arguments.json.write_text(json.dumps(rows, indent=1) + "\n", encoding="utf-8")
    if arguments.loop_seconds > 0.0:
        for case in arguments.cases.split(","):
            loops(case, chosen, arguments, write)
    if arguments.figure is not None:
        from planner_peers_figure import draw

        draw(shown, arguments.figure)


if __name__ == "__main__":
    sys.exit(main())
