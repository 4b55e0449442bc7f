"""The figure of benchmarks/planner_peers.py: time of a step, and the objective reached, of each planner."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from solver_figure import COLOURS


def draw(shown: Mapping[str, Sequence[Any]], target: Path) -> None:
    """Write the figure; ``shown`` has the steps of every planner for each case, ours (compiled) first."""
    names = [steps.name for steps in next(iter(shown.values()))]
    size = (9.0, 0.55 * len(names) + 0.6)  # two labels a row, one above the other
    figure, (left, right) = plt.subplots(1, 2, figsize=size, layout="constrained", sharey=True)
    for number, (case, results) in enumerate(shown.items()):
        offset = 0.4 * (number - 0.5 * (len(shown) - 1))
        colour, marker = COLOURS[number], "os^D"[number]
        for row, steps in enumerate(results):
            low, median, high = np.percentile(steps.times, [1.0, 50.0, 99.0])
            label = case if row == 0 else None
            left.plot([low, high], [row + offset] * 2, color=colour, linewidth=1.5)
            left.plot(median, row + offset, marker=marker, color=colour, linestyle="none", label=label)
            text = f"{median:.{2 if median < 10.0 else 0}f} ms"
            left.annotate(text, (high, row + offset), (4, 0), textcoords="offset points", va="center", fontsize=7)
            if row:
                both = np.array(steps.solved) & np.array(results[0].solved)
                gap = (np.array(steps.objectives) - np.array(results[0].objectives))[both]
                low, high = np.percentile(gap, [5.0, 95.0])
                right.plot([low, high], [row + offset] * 2, color=colour, linewidth=1.5)
                right.plot(gap.mean(), row + offset, marker=marker, color=colour, linestyle="none")
    left.set_yticks(range(len(names)), names)
    left.invert_yaxis()
    left.set(xscale="log", xlabel="processor time per step in ms")
    left.set_xlim(right=4.0 * left.get_xlim()[1])
    left.legend(frameon=False, fontsize="small", loc="upper right")
    right.axvline(0.0, color="0.5", linestyle=":")
    right.set(xlabel="objective minus the first row's (of 5)")
    for axes in (left, right):
        axes.grid(alpha=0.3, axis="x")
    figure.savefig(target, dpi=200)
    plt.close(figure)
