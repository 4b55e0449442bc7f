"""The figure of benchmarks/solver.py: time over the horizon, and how the times of closed-loop steps spread."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.ticker import NullLocator

# Okabe and Ito's colours, which colour-blind readers can tell apart; line styles repeat the distinction.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7")
STYLES = ("-", "--", "-.", ":")


def draw(
    horizons: Sequence[int],
    horizon: Mapping[str, Sequence[np.ndarray]],
    loop: Mapping[str, Mapping[str, np.ndarray]],
    target: Path,
) -> None:
    """Write the figure.

    Parameters
    ----------
    horizons, horizon
        Numbers of pieces, and for each formulation the times of each of them in milliseconds.
    loop
        Title to solver to times of closed-loop steps in milliseconds; the first penalty is shown.
    """
    figure, (left, right) = plt.subplots(1, 2, figsize=(9.0, 4.4), layout="constrained")
    pieces = np.array(horizons, dtype=float)
    for (formulation, times), colour, marker in zip(horizon.items(), COLOURS, "os", strict=False):
        medians = np.array([np.median(sample) for sample in times])
        tails = np.array([np.percentile(sample, 99) for sample in times])
        left.plot(pieces, medians, color=colour, marker=marker, label=f"{formulation}, median")
        left.plot(pieces, tails, color=colour, marker=marker, linestyle="--", mfc="white", label=f"{formulation}, 99 %")
    first = np.median(next(iter(horizon.values()))[0])
    left.plot(pieces, first * (pieces / pieces[0]) ** 1.3, color="0.5", linestyle=":", label="p^1.3, the bound")
    left.set(xscale="log", yscale="log", xlabel="pieces p", ylabel="processor time per solve in ms")
    left.set_xticks(pieces, [f"{p}" for p in horizons], minor=False)
    left.xaxis.set_minor_locator(NullLocator())
    left.set_title("Warm starts, 2D, n_c = 4", fontsize="medium")
    left.legend(fontsize="small", frameon=False, loc="upper center", bbox_to_anchor=(0.5, -0.18), ncol=2)

    title = next(name for name in loop if "penalty" in name)
    for (solver, sample), colour, style in zip(loop[title].items(), COLOURS, STYLES, strict=False):
        share = np.arange(1, len(sample) + 1) / len(sample)
        right.step(
            np.sort(sample), share, where="post", color=colour, linestyle=style, label=f"{solver} ({len(sample)})"
        )
    right.axvline(2.0, color="0.5", linestyle=":", linewidth=1.0, label="2 ms")
    right.set(
        xscale="log", xlabel="processor time per solve in ms", ylabel="share of closed-loop steps", ylim=(0.0, 1.02)
    )
    right.set_title(f"Closed loop, {title}", fontsize="medium")
    right.legend(fontsize="small", frameon=False, loc="upper center", bbox_to_anchor=(0.5, -0.18), ncol=2)
    for axes in (left, right):
        axes.grid(alpha=0.3)
    figure.savefig(target, dpi=150)
    plt.close(figure)
