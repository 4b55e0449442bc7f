"""Closed loops of the forms of a plan: the settled error, and what decides it; steps in one part and in two.

    OPENBLAS_NUM_THREADS=1 python benchmarks/shooting_closed_loop.py --seeds 10 --seconds 30 --json loop.json

Cases 2 and 5 with hard limits on thrust and p = 5. "Two parts" is the real-time iteration: ``prepare`` between the
samples, ``feedback`` when the state is there. Times are wall time of the call in Python, and of that in C, after 2 s.
The error is that of the forecast, averaged over the times after 2 s; distance, and similarity of the bearing to the
desired one, are medians over the same time.

``--json`` writes a row a case and form: case, form, seeds, error_mean, error_median, error_worst, errors (of each
seed), distance_median, similarity_median, solved (share), solve_us_median, solve_us_p99, c_us_median, c_us_p99,
prepare_us_median.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from gbt_ocp.experiments.build.loop import build_loop
from gbt_ocp.experiments.config.loading import load_config
from gbt_ocp.simulation.loop import simulate

SETTLING = 2.0
"""Seconds after which errors count."""

SHOOTING = ("planner.form=shooting", "planner.steps=1", "planner.nodes=1", "planner.solver=compiled")
FORMS: dict[str, tuple[str, ...]] = {
    "degree 2": ("planner.solver=compiled",),
    "degree 4, C1": ("planner.degree=4", "planner.continuity=1", "planner.solver=compiled"),
    "held": (*SHOOTING, "planner.thrust=held"),
    "linear": (*SHOOTING, "planner.thrust=linear"),
    "held, two parts": (*SHOOTING, "planner.thrust=held"),
}


class Timed:
    """An entry of the compiled planner, with the times of its calls in µs."""

    def __init__(self, entry: Any) -> None:
        self._entry = entry
        self.took: list[float] = []

    def __call__(self, *arguments: Any) -> Any:
        """Call it."""
        began = perf_counter()
        found = self._entry(*arguments)
        self.took.append(1e6 * (perf_counter() - began))
        return found


class InTwoParts:
    """A planner whose steps are taken in two parts, with the times of both in µs."""

    def __init__(self, planner: Any) -> None:
        self._planner = planner
        self.prepared: list[float] = []

    def __getattr__(self, name: str) -> Any:
        return getattr(self._planner, name)

    def solve(self, state: Any, **data: Any) -> Any:
        """The second part, and then the first one of the next step."""
        plan = self._planner.feedback(state, **data)
        began = perf_counter()
        self._planner.prepare()
        self.prepared.append(1e6 * (perf_counter() - began))
        return plan


def flown(case: str, form: str, seed: int, seconds: float, overrides: Sequence[str]) -> dict[str, Any]:
    """One run."""
    chosen = ["planner.formulation=hard", "planner.pieces=5", *FORMS[form], *overrides]
    loop, start = build_loop(load_config(case, overrides=chosen, seed=seed))
    guidance: Any = loop.guidance  # the configurations plan
    solver, entry = guidance.planner.solver, "_feedback" if form.endswith("two parts") else "_plan"
    in_c = Timed(getattr(solver, entry))
    setattr(solver, entry, in_c)
    parts = InTwoParts(guidance.planner) if form.endswith("two parts") else None
    if parts is not None:
        guidance.planner = parts
    arrays = simulate(loop, start, seconds).arrays
    late = arrays["t"] >= SETTLING - 1e-9
    line = arrays["target"] - arrays["vehicle_pose"][:, : loop.target.dimension]
    distance = np.linalg.norm(line, axis=1)
    desired = loop.desired(arrays["t"])
    solved = (arrays["solver_status"] == "solved") & (arrays["fallback"] == "")
    return {
        "error": float(arrays["error"].mean(axis=1)[late].mean()),
        "distance": float(np.median(distance[late])),
        "similarity": float(np.median((desired * line).sum(axis=1)[late] / distance[late])),
        "solved": float(solved.mean()),
        "times": (1e6 * arrays["solver_time"][late]).tolist(),
        "in_c": in_c.took[-int(np.sum(late)) :],
        "prepared": [] if parts is None else parts.prepared,
    }


def measured(case: str, form: str, seeds: Sequence[int], seconds: float, overrides: Sequence[str]) -> dict[str, Any]:
    """A row of the table."""
    runs = [flown(case, form, seed, seconds, overrides) for seed in seeds]
    errors = [run["error"] for run in runs]
    times, in_c = (np.concatenate([run[name] for run in runs]) for name in ("times", "in_c"))
    prepared = [x for run in runs for x in run["prepared"]]
    return {
        "case": case,
        "form": form,
        "seeds": len(runs),
        "error_mean": float(np.mean(errors)),
        "error_median": float(np.median(errors)),
        "error_worst": float(np.max(errors)),
        "errors": errors,
        "distance_median": float(np.median([run["distance"] for run in runs])),
        "similarity_median": float(np.median([run["similarity"] for run in runs])),
        "solved": float(np.mean([run["solved"] for run in runs])),
        "solve_us_median": float(np.median(times)),
        "solve_us_p99": float(np.percentile(times, 99)),
        "c_us_median": float(np.median(in_c)),
        "c_us_p99": float(np.percentile(in_c, 99)),
        "prepare_us_median": float(np.median(prepared)) if prepared else None,
    }


def main() -> None:
    """Print the table as Markdown."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cases", default="case2,case5")
    parser.add_argument("--forms", default=";".join(FORMS), help="with ; between: " + "; ".join(FORMS))
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--seed-from", type=int, default=0)
    parser.add_argument("--seconds", type=float, default=30.0)
    parser.add_argument("--set", action="append", default=[], help="a key and its value for all runs")
    parser.add_argument("--json", type=Path, help="where to write a row a case and form")
    arguments = parser.parse_args()
    unknown = [form for form in arguments.forms.split(";") if form not in FORMS]
    if unknown:
        parser.error(f"--forms: found {'; '.join(unknown)}; allowed: {'; '.join(FORMS)}")
    seeds = range(arguments.seed_from, arguments.seed_from + arguments.seeds)
    print("Closed loop\n")
    print(
        "| case | form | settled error m: mean | median seed | worst | distance m | similarity | solved at once "
        "| plan µs: median | 99 % | of it in C | 99 % | prepare µs |"
    )
    print("|" + "---|" * 13)
    rows = []
    for case in arguments.cases.split(","):
        for form in arguments.forms.split(";"):
            row = measured(case, form, seeds, arguments.seconds, arguments.set)
            rows.append(row)
            prepare = "" if row["prepare_us_median"] is None else f"{row['prepare_us_median']:.0f}"
            print(
                f"| {case[-1]} | {form} | {row['error_mean']:.4f} | {row['error_median']:.4f} "
                f"| {row['error_worst']:.4f} | {row['distance_median']:.3f} | {row['similarity_median']:.4f} "
                f"| {row['solved']:.1%} "
                f"| {row['solve_us_median']:.0f} | {row['solve_us_p99']:.0f} "
                f"| {row['c_us_median']:.0f} | {row['c_us_p99']:.0f} | {prepare} |",
                flush=True,
            )
    if arguments.json is not None:
        arguments.json.write_text(json.dumps(rows, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
