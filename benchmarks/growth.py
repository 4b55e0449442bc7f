"""How time grows: pieces and nodes of a plan, window of the tracker, in the plane and in space.

    OPENBLAS_NUM_THREADS=1 python benchmarks/growth.py --figure docs/figures/growth.png

Warm steps of the compiled solver as in benchmarks/solver.py (forecasts that come true, hard limits), p from 5 to 80 at
n_c = 4 and n_c from 4 to 80 at p = 5; the same over p where the trajectory follows from held thrust by integration, and
the vehicle goes where each plan leads; steps of the Gaussian-process tracker with exact bearings, N_c from 10 to 200.
Processor time of the thread; the exponent is the slope of the logarithms over the whole range, and the last one that of
the two largest sizes. Workers are the matter of benchmarks/sweep_rate.py.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from time import thread_time
from types import SimpleNamespace

import numpy as np
from peers.statement import Statement
from shooting_cold import period_of, posed
from solver import measure, times_of, warmed
from solver_instances import fossen_problem, pursuit_instances

from gbt_ocp.models.bearings import DesiredBearing
from gbt_ocp.models.targets import case_target
from gbt_ocp.ocp.binding import Binding
from gbt_ocp.ocp.solvers.compiled import CompiledSolver
from gbt_ocp.reporting import style
from gbt_ocp.tracking.gp.gp import GaussianProcessTracker

PIECES = (5, 10, 20, 40, 80)
NODES = (4, 8, 20, 40, 80)
WINDOWS = (10, 20, 50, 100, 200)
KINDS = ("p", "p by integration", "n_c", "N_c")
"""What grows."""
PERIOD, AHEAD = 0.1, 12
TURN = {2: 2.0 * np.pi, 3: 2.0 * np.pi / 0.4}
"""Rate of the desired bearing in rad/s."""

Curve = tuple[str, Sequence[int], list[float], list[float], str]
"""What grows, its sizes, median and 99 % in ms, what was found beside."""


def plans(dimension: int, what: str, sizes: Sequence[int], steps: int) -> Curve:
    """Time of a plan over its pieces or over its nodes."""
    medians, slow, solved = [], [], 0
    for size in sizes:
        pieces, nodes = (size, 4) if what == "p" else (5, size)
        problem = fossen_problem(dimension, "hard", nodes, pieces)
        instances = pursuit_instances(problem, steps)
        rows = measure(problem, warmed(CompiledSolver(problem, {}), instances[0]), instances)
        times = times_of(rows)
        medians.append(float(np.median(times)))
        slow.append(float(np.percentile(times, 99)))
        solved += sum(row.solved for row in rows)
    return f"{what}, {dimension}D", sizes, medians, slow, f"{solved} of {len(sizes) * steps} solved"


def integrated(dimension: int, sizes: Sequence[int], steps: int) -> Curve:
    """Time of a plan by integration of held thrust over its pieces."""
    medians, slow, solved = [], [], 0
    target, desired = case_target(2 if dimension == 2 else 5), DesiredBearing(dimension, TURN[dimension])
    for size in sizes:
        problem = fossen_problem(dimension, "hard", 4, size)
        by_integration, period = posed(problem, "held"), period_of(Statement(problem))
        solver, bound = CompiledSolver(by_integration, {}), Binding(problem)
        state, coasting = np.zeros(2 * (dimension + 1)), np.zeros((size, by_integration.freedoms))
        state[0], guess, cold, times = 3.0, coasting, True, []
        for step in range(steps + 1):
            at = PERIOD * (step + np.arange(1, size + 1))
            spread = np.tile(1e-4 * np.eye(dimension), (size, 1, 1))
            forecast = SimpleNamespace(mean=target.position(at), covariance=spread)
            numbers = bound.objective_parameters({"forecast": forecast, "desired": desired(at)})
            began = thread_time()
            found = solver.solve(state, numbers, guess, cold=cold, tightening=0.0)
            times.append(1e3 * (thread_time() - began))
            state = np.asarray(period(state, found.variables[0], found.variables[0])).ravel()
            guess, cold = np.vstack([found.variables[1:], coasting[:1]]), False
            solved += found.solved and step > 0
        medians.append(float(np.median(times[1:])))  # the first step is cold
        slow.append(float(np.percentile(times[1:], 99)))
    return f"p by integration, {dimension}D", sizes, medians, slow, f"{solved} of {len(sizes) * steps} solved"


def tracker(dimension: int, sizes: Sequence[int], steps: int) -> Curve:
    """Time of a tracker's step over its window, once the window is full."""
    target = case_target(2 if dimension == 2 else 5)
    desired = DesiredBearing(dimension, TURN[dimension])
    medians, slow = [], []
    for window in sizes:
        kept, times = GaussianProcessTracker(dimension, window=window, nugget=1e-8), []
        for k in range(window + steps):
            t = PERIOD * k
            bearing = desired(t)
            began = thread_time()
            kept.update(t, bearing, target.position(t) - bearing)
            kept.predict(t + PERIOD * np.arange(AHEAD))
            times.append(1e3 * (thread_time() - began))
        medians.append(float(np.median(times[window:])))
        slow.append(float(np.percentile(times[window:], 99)))
    return f"N_c, {dimension}D", sizes, medians, slow, ""


def exponent(sizes: Sequence[int], values: list[float]) -> float:
    """Slope of the logarithms."""
    return float(np.polyfit(np.log(sizes), np.log(values), 1)[0])


def draw(curves: list[Curve], path: Path) -> None:
    """One panel each for pieces, nodes and window."""
    figure = style.new_figure(2.6)
    panels = figure.subplots(1, 3)
    looks = {"2D": (style.BLUE, "o"), "3D": (style.VERMILLION, "s")}
    for panel, (what, label) in zip(
        panels, (("p", "pieces p"), ("n_c", "nodes n_c"), ("N_c", "window N_c")), strict=True
    ):
        for name, sizes, medians, slow, _ in curves:
            if name.startswith(f"{what},"):
                colour, marker = looks[name[-2:]]
                panel.plot(sizes, medians, color=colour, marker=marker, label=f"{name[-2:]}, median")
                panel.plot(sizes, slow, color=colour, marker=marker, linestyle=":", label=f"{name[-2:]}, 99 %")
        panel.set_xscale("log")
        panel.set_yscale("log")
        panel.set_xlabel(label)
        sizes = {"p": PIECES, "n_c": NODES, "N_c": WINDOWS}[what]
        panel.set_xticks(sizes, [str(size) for size in sizes])
        panel.set_xticks([], minor=True)
    panels[0].set_ylabel("processor time [ms]")
    style.legend_above(figure, panels[0], columns=4)
    figure.savefig(path, dpi=150)


def main() -> None:
    """Print the table as Markdown."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--steps", type=int, default=60)
    parser.add_argument("--only", default=",".join(KINDS), help="which of " + ", ".join(KINDS))
    parser.add_argument("--figure", type=Path)
    arguments = parser.parse_args()
    unknown = [what for what in arguments.only.split(",") if what not in KINDS]
    if unknown:
        parser.error(f"--only: found {', '.join(unknown)}; allowed: {', '.join(KINDS)}")
    curves: list[Curve] = []
    print("| what grows | median ms at each size | 99 % ms at the largest | exponent | of the two largest | |")
    print("|---|---|---|---|---|---|")
    for dimension in (2, 3):
        measured = {
            "p": lambda d: plans(d, "p", PIECES, arguments.steps),
            "p by integration": lambda d: integrated(d, PIECES, arguments.steps),
            "n_c": lambda d: plans(d, "n_c", NODES, arguments.steps),
            "N_c": lambda d: tracker(d, WINDOWS, arguments.steps),
        }
        for what in arguments.only.split(","):
            curve = measured[what](dimension)
            curves.append(curve)
            name, sizes, medians, slow, note = curve
            found = ", ".join(f"{size}: {median:.3g}" for size, median in zip(sizes, medians, strict=True))
            last = exponent(sizes[-2:], medians[-2:])
            print(
                f"| {name} | {found} | {slow[-1]:.3g} | {exponent(sizes, medians):.2f} | {last:.2f} | {note} |",
                flush=True,
            )
    if arguments.figure is not None:
        with style.styled():
            draw(curves, arguments.figure)


if __name__ == "__main__":
    main()
