"""The signed and the axial similarity beside each other in closed loop: a table of docs/theory.md.

    OPENBLAS_NUM_THREADS=1 python benchmarks/axial.py --seeds 4

All cases as shipped but with hard limits and the compiled solver, 30 s, each with two numbers m of bearings a turn;
errors in m, means over the seeds.
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse

import numpy as np

import gbt_ocp as gbt

HARD = ("planner.formulation=hard", "planner.solver=compiled")
SIMILARITIES = ("signed", "axial")
NUMBERS = ("error_settled", "error_mean", "solver_iterations_mean")
BEARINGS = {2: (10, 20), 3: (4, 8)}


def runs(name: str, m: int, similarity: str, seeds: int) -> np.ndarray:
    """The numbers of each seed ``(seeds, 3)``."""
    changes = [*HARD, f"desired_bearing.m={m}", f"planner.similarity={similarity}"]
    found = [gbt.run(name, overrides=changes, seed=seed).summary for seed in range(seeds)]
    return np.array([[summary[number] for number in NUMBERS] for summary in found], dtype=float)


def main() -> None:
    """Print the table as Markdown."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=4)
    seeds = parser.parse_args().seeds
    heads = ["case", "m", "settled, signed", "settled, axial", "worst seed, axial", "whole run, signed"]
    heads += ["whole run, axial", "iterations, signed", "iterations, axial"]
    print(f"| {' | '.join(heads)} |\n{'|---' * len(heads)}|", flush=True)
    for case in range(1, 7):
        name = f"case{case}"
        for m in BEARINGS[gbt.load_config(name).dimension]:
            signed, axial = (runs(name, m, similarity, seeds) for similarity in SIMILARITIES)
            one, other = signed.mean(axis=0), axial.mean(axis=0)
            cells = [f"{one[0]:.5f}", f"{other[0]:.5f}", f"{axial[:, 0].max():.5f}"]
            cells += [f"{one[1]:.3f}", f"{other[1]:.3f}", f"{one[2]:.1f}", f"{other[2]:.1f}"]
            print(f"| {case} | {m} | {' | '.join(cells)} |", flush=True)


if __name__ == "__main__":
    main()
