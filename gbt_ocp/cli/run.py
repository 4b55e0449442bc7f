"""``gbt-ocp run``: one experiment, its run folder and what the terminal shows of it."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from gbt_ocp.cli.arguments import add_config, add_out, add_quiet, add_set, seed
from gbt_ocp.cli.exit_codes import DONE, LIMIT_BROKEN, PROGRAM_FAULT, WRONG_INPUT
from gbt_ocp.cli.folders import free_folder, refuse_unwritable, save_somewhere
from gbt_ocp.cli.output import remark, show
from gbt_ocp.cli.subcommand import Subcommand
from gbt_ocp.experiments.config.loading import load_config

VIOLATION_TOLERANCE = 1.0e-9
"""Relative thrust violation that still counts as round-off."""


def _add_arguments(parser: argparse.ArgumentParser) -> None:
    add_config(parser)
    add_out(parser, "run folder (default: a new one in runs/)")
    add_set(parser)
    parser.add_argument("--seed", metavar="N", type=seed, help="replace the seed")
    parser.add_argument("--no-figures", action="store_true", help="write no figures")
    add_quiet(parser)


def _carry_out(arguments: argparse.Namespace) -> int:
    configuration = load_config(arguments.config, overrides=arguments.set, seed=arguments.seed)
    given: Path | None = arguments.out
    name = f"{configuration.name}-{configuration.preset}-{configuration.planner.formulation}-seed{configuration.seed}"
    refuse_unwritable(given or free_folder(name))

    from gbt_ocp.experiments.run import run

    result = run(configuration, progress=not arguments.quiet)
    asked = given or free_folder(name)
    out, drawn = save_somewhere(result, asked, figures=not arguments.no_figures)
    _show_summary(result.summary)
    show(f"\n{out}")
    summaries = [result.summary, *(other.summary for other in result.others.values())]
    broken = [one for one in summaries if not limits_kept(one["violation_max"], one["retries"]["clipped"])]
    if given is not None and out != asked:
        return WRONG_INPUT
    if not drawn:
        return PROGRAM_FAULT
    return LIMIT_BROKEN if broken else DONE


def limits_kept(violation: float | None, clipped: int) -> bool:
    """Whether the thrust kept its limits by plan; if not, a remark says by how much.

    Parameters
    ----------
    violation
        Largest thrust beyond its limit, as a share of the limit; ``None`` if it is no finite number.
    clipped
        Steps in which the thrust had to be clipped.
    """
    if clipped:
        remark(f"the thrust limits were kept only by clipping, in {clipped} steps")
        return False
    if violation is None:
        remark("the thrust limits count as broken: the thrust is not a finite number")
        return False
    if violation > VIOLATION_TOLERANCE:
        remark(f"the thrust limits were broken by {violation:.3g} of the limit")
        return False
    return True


_SHOWN = {
    "error_settled": "m",
    "error_mean": "m",
    "error_final": "m",
    "distance_median": "m",
    "violation_max": "of the limit",
    "solver": "",
    "solver_success_rate": "",
    "solver_iterations_mean": "",
    "solver_time_median_ms": "ms",
    "tracker_time_median_ms": "ms",
    "steps": "",
    "wall_s": "s",
}
"""The keys of the summary that the terminal shows, with their units; summary.json has all of them."""


def _show_summary(summary: Mapping[str, Any]) -> None:
    for key, unit in _SHOWN.items():
        value = summary.get(key)
        if value is not None:
            text = f"{value:.4g}" if isinstance(value, float) else str(value)
            show(f"{key:<24}{text:>10} {unit}".rstrip())
    for key, value in (summary.get("team") or {}).items():
        text = f"{value:.4g}" if isinstance(value, float) else str(value)
        show(f"{'team ' + key:<28}{text:>6}")


RUN = Subcommand(
    "run",
    "run one experiment and write its run folder",
    (
        "gbt-ocp run case2",
        "gbt-ocp run case5 --set planner.formulation=hard planner.pieces=10 --seed 3",
        "gbt-ocp run mine.yaml --out runs/mine --no-figures",
    ),
    _add_arguments,
    _carry_out,
)
