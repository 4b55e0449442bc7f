"""What a study works with: a place for its sweeps, an engine to carry them out, and the form of its report."""

from __future__ import annotations

import math
import shutil
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from gbt_ocp.experiments.sweep.carry_out import Sweep, begin, carry_out, resumed_plan
from gbt_ocp.experiments.sweep.engines import Engine
from gbt_ocp.experiments.sweep.plan import SweepPlan, Variant
from gbt_ocp.experiments.sweep.table import Row
from gbt_ocp.files import temporary_beside, whole_folder
from gbt_ocp.typing import Array

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from gbt_ocp.reporting.tables import Table

SWEEPS = "sweeps"
REPORT = "report.md"


@dataclass(frozen=True)
class Finding:
    """A statement held against what was measured."""

    statement: str
    holds: bool
    seen: str


@dataclass(frozen=True)
class Report:
    """What a study answers.

    Attributes
    ----------
    title
        One line.
    text
        Paragraphs in Markdown: how it was measured.
    findings
        Statements and whether they hold.
    tables, figures
        By the names of their files.
    files
        Further texts, by the names of their files with suffix.
    """

    title: str
    text: Sequence[str] = ()
    findings: Sequence[Finding] = ()
    tables: Mapping[str, Table] = field(default_factory=dict)
    figures: Mapping[str, Figure] = field(default_factory=dict)
    files: Mapping[str, str] = field(default_factory=dict)

    def markdown(self) -> str:
        """The report as Markdown."""
        parts = [f"# {self.title}", *self.text]
        if self.findings:
            lines = [
                f"- **{'holds' if f.holds else 'does not hold'}**: {f.statement} Seen: {f.seen}" for f in self.findings
            ]
            parts += ["## Findings", "\n".join(lines)]
        for name, table in self.tables.items():
            parts += [f"## {table.caption}", table.markdown(), f"([{name}.csv]({name}.csv), [{name}.tex]({name}.tex))"]
        parts += [f"![{name}]({name}.png)" for name in self.figures]
        return "\n\n".join(parts) + "\n"

    def write(self, folder: Path) -> None:
        """Write ``report.md``, the tables and the figures into a folder; an older report there is replaced.

        Raises
        ------
        FileExistsError
            If something else is there.
        """
        with self._aside(folder):
            self._write(folder)

    @contextmanager
    def _aside(self, folder: Path) -> Iterator[None]:
        """Move an older report, or what is left of it, out of the way; it comes back if there is no new one."""
        names = {REPORT, *self.files, *(f"{name}.png" for name in self.figures)}
        names |= {f"{name}.{kind}" for name in self.tables for kind in ("csv", "md", "tex")}
        there = {entry.name for entry in folder.iterdir()} if folder.is_dir() else set()
        if not there or not ((folder / REPORT).is_file() or there <= names):
            yield
            return
        # a rename, so that there is never half of a report
        older = temporary_beside(folder)
        folder.rename(older)
        try:
            yield
        finally:
            if folder.exists():
                shutil.rmtree(older, ignore_errors=True)
            else:
                older.rename(folder)

    def _write(self, folder: Path) -> None:
        from gbt_ocp.reporting import style

        with whole_folder(folder) as temporary:
            (temporary / REPORT).write_text(self.markdown(), encoding="utf-8")
            for name, table in self.tables.items():
                table.write(temporary, name)
            for name, text in self.files.items():
                (temporary / name).write_text(text, encoding="utf-8")
            with style.styled():
                for name, figure in self.figures.items():
                    figure.savefig(temporary / f"{name}.png", dpi=style.DPI)


@dataclass(frozen=True)
class Workbench:
    """Where a study does its work.

    Attributes
    ----------
    folder
        Of the study; sweeps lie in ``folder/sweeps``.
    seeds
        Of every run that counts.
    engine
        Carries out the runs.
    tune
        Whether to search for parameters instead of taking the shipped ones.
    progress
        Whether to show progress bars.
    """

    folder: Path
    seeds: tuple[int, ...]
    engine: Engine
    tune: bool = False
    progress: bool = False

    def sweep(
        self,
        name: str,
        variants: Sequence[Variant],
        *,
        seeds: Sequence[int] | None = None,
        arrays: Sequence[str] = (),
        histories: bool = False,
    ) -> Sweep:
        """Run every variant with every seed, as far as that is not done yet.

        Parameters
        ----------
        name
            Of the sweep, unique among all studies.
        variants
            See :func:`gbt_ocp.experiments.sweep.plan.variant`.
        seeds
            Other seeds than the study's, for example to tune on.
        arrays
            Attributes of the history to keep.
        histories
            Whether to keep all of it.

        Raises
        ------
        ConfigurationError
            If the folder holds another sweep of this name.
        SweepInterrupted
            If Ctrl-C was pressed.
        """
        plan = SweepPlan(tuple(variants), tuple(self.seeds if seeds is None else seeds), histories, tuple(arrays))
        folder = self.folder / SWEEPS / name
        if folder.exists():
            plan = resumed_plan(folder, plan)
        else:
            begin(folder, plan)
        return carry_out(plan, folder, self.engine, progress=self.progress, title=name)

    @staticmethod
    def column(rows: Sequence[Row], key: str) -> Array:
        """One number of each row ``(runs,)``; NaN where it does not exist."""
        return np.array([math.nan if row.get(key) is None else row[key] for row in rows], dtype=float)
