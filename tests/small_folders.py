"""The smallest folders of each kind: the commands that make them and take them up, and what must come out the same."""

import csv
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest
from damage import files
from test_comparison import comparable

from gbt_ocp.experiments.sweep.table import WALL_CLOCK_COLUMNS
from gbt_ocp.reporting import bands, tables
from gbt_ocp.simulation.history import WALL_CLOCK, History
from gbt_ocp.studies.limits import comparison_figures, sensitivity
from gbt_ocp.studies.paper import fig5

with suppress(ImportError):
    import pyarrow.parquet  # noqa: F401

LOADED = (bands, comparison_figures, tables)
"""Loaded here, so that not every forked process loads them."""

KINDS = ("run", "sweep", "reproduce", "compare")
QUICK = ["duration_s=0.5", "guidance.kind=random"]
RUNS = 3


@contextmanager
def little_to_do():
    """Comparisons and studies with little in them."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sensitivity, "GAMMAS", (0.9,))
        patch.setattr(sensitivity, "NODES", (1,))
        patch.setattr("gbt_ocp.studies.limits.solves.STARTS", 2)
        patch.setattr(fig5, "CASES", ("case2",))
        patch.setattr(fig5, "COMPARED_PRESETS", ("default",))
        patch.setattr(fig5, "MOTIONS", {"static": "static", "random": "random"})
        patch.setattr(fig5, "SETTINGS", ("duration_s=3.0",))
        patch.setattr(fig5, "_findings", lambda *_: [])
        yield


def begin(kind: str, folder: Path) -> list[str]:
    """The command that makes such a folder, in one process."""
    one = ["--jobs", "1", "--quiet", "--out", str(folder)]
    return {
        "run": ["run", "case1", "--set", *QUICK, "--no-figures", "--quiet", "--out", str(folder)],
        "sweep": ["sweep", "case1", "--runs", str(RUNS), "--set", *QUICK, *one],
        "reproduce": ["reproduce", "fig5", "--runs", "1", *one],
        "compare": [
            "compare", "case2", "--formulations", "hard", "--solvers", "ipopt", "--runs", "1", "--problems", "2",
            "--full", "--set", "duration_s=0.4", "planner.pieces=2", *one,
        ],
    }[kind]  # fmt: skip


def go_on(kind: str, folder: Path) -> list[str]:
    """The command that goes on with it: what was begun is resumed, what was not is begun."""
    command = begin(kind, folder)
    if kind in ("sweep", "reproduce") and folder.is_dir() and any(folder.iterdir()):
        command[command.index("--out")] = "--resume"
    return command


def table(folder: Path) -> list[dict[str, str]]:
    """Rows of runs.csv without what a clock measured."""
    with (folder / "runs.csv").open(newline="", encoding="utf-8") as stream:
        return [{k: v for k, v in row.items() if k not in WALL_CLOCK_COLUMNS} for row in csv.DictReader(stream)]


def result(kind: str, folder: Path):
    """All that must be the same in two folders of the same command."""
    names = files(folder)
    if kind == "run":
        return names, (folder / "config.yaml").read_bytes(), _arrays(folder / "history.npz")
    if kind == "sweep":
        histories = [_arrays(path) for path in sorted(folder.glob("runs/*/history.npz"))]
        configurations = [path.read_bytes() for path in sorted(folder.glob("runs/*/config.yaml"))]
        return names, table(folder), configurations, histories
    if kind == "reproduce":
        return names, table(folder / "sweeps/fig5"), (folder / "fig5/report.md").read_text(encoding="utf-8")
    return [name for name in names if name != "costs.txt"], comparable(folder)


def finished(folder: Path) -> dict[str, bytes]:
    """Contents of the pieces that are finished for good: run folders, and parts of a comparison."""
    pieces = [name for name in files(folder) if "." not in {part[0] for part in Path(name).parts}]
    return {name: (folder / name).read_bytes() for name in pieces if {"runs", "parts"} & set(Path(name).parts[:-1])}


def _arrays(path: Path) -> dict[str, bytes]:
    history = History.load_npz(path)
    return {name: array.tobytes() for name, array in vars(history).items() if name not in WALL_CLOCK}
