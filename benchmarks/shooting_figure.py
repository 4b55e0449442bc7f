"""The figure of docs/shooting.md, after ``python benchmarks/shooting.py --study loop --out DIR``.

python benchmarks/shooting_figure.py DIR docs/figures/shooting_reach.png
"""

from __future__ import annotations

import csv
import sys
from pathlib import Path

import numpy as np
from shooting import REACHING, STATES, outline
from shooting_forms import Reach, falcon, make

from gbt_ocp.reporting.style import BLACK, BLUE, DPI, GREEN, ORANGE, VERMILLION, new_figure, styled

LOOKS = {
    "flat": (BLACK, "-", "o"),
    "flat, half pieces": (BLUE, "--", "s"),
    "body acceleration": (ORANGE, "-.", "^"),
    "thrust": (VERMILLION, "-", "D"),
    "flat, degree 3": (GREEN, ":", "v"),
}


def main() -> None:
    """Draw what one period reaches, and what the closed loops kept."""
    folder, target = Path(sys.argv[1]), Path(sys.argv[2])
    with (folder / "loop.csv").open(encoding="utf-8") as file:
        runs = list(csv.DictReader(file))
    with styled():
        figure = new_figure(3.0)
        left, right = figure.subplots(1, 2, width_ratios=(1.2, 1.0))
        start = "2 m/s ahead, turning 6 rad/s"
        for name in REACHING:
            colour, line, _ = LOOKS[name]
            corners = 100.0 * outline(make(name, falcon(2), 1, (Reach(2),)), STATES[start])
            left.plot(*np.vstack([corners, corners[:1]]).T, color=colour, linestyle=line, label=name)
        left.set_xlabel("ahead after 0.1 s [cm]")
        left.set_ylabel("to port after 0.1 s [cm]")
        left.set_aspect("equal", adjustable="datalim")
        left.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2, columnspacing=1.0)

        shown = [(5, name) for name in ("flat, degree 3", "flat", "body acceleration", "flat, half pieces", "thrust")]
        shown += [(10, "flat"), (10, "thrust")]
        for place, (pieces, name) in enumerate(shown):
            found = [
                float(run["share"])
                for run in runs
                if (run["case"], run["preset"], run["pull"], run["p"], run["held"])
                == ("case2", "paper", "0", str(pieces), name)
            ]
            colour, _, marker = LOOKS[name]
            spread = place + np.linspace(-0.2, 0.2, len(found))
            right.plot(found, spread, color=colour, marker=marker, linestyle="", markersize=3.5)
        right.set_yticks(range(len(shown)), [f"{name}, p = {pieces}" for pieces, name in shown])
        right.set_xlim(0.0, 1.05)
        right.set_xlabel("share of steps above 0.9 [1]")
        figure.savefig(target, dpi=DPI)


if __name__ == "__main__":
    main()
