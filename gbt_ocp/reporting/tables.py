"""Tables as Markdown, CSV and LaTeX."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike


@dataclass(frozen=True)
class Spread:
    """Mean and standard deviation of a sample: ``mean ± std`` where it is shown, two columns in CSV."""

    mean: float
    std: float
    digits: int = 3
    """Decimals shown."""

    @classmethod
    def of(cls, values: ArrayLike, digits: int = 3) -> Spread:
        """Mean and standard deviation (of the sample, n - 1) of the finite values; NaN without any."""
        sample = np.asarray(values, dtype=float).ravel()
        sample = sample[np.isfinite(sample)]
        if not sample.size:
            return cls(math.nan, math.nan, digits)
        return cls(float(sample.mean()), float(sample.std(ddof=1)) if sample.size > 1 else 0.0, digits)


Cell = str | int | float | Spread | None
"""``None`` and NaN are empty."""


@dataclass(frozen=True)
class Table:
    """A table: a caption, the heads of its columns, and rows of as many cells (see :meth:`add`)."""

    caption: str
    columns: Sequence[str]
    rows: list[tuple[Cell, ...]] = field(default_factory=list)

    def add(self, *cells: Cell) -> None:
        """Add a row.

        Raises
        ------
        ValueError
            If it has not one cell for each column.
        """
        if len(cells) != len(self.columns):
            raise ValueError(f"a row has {len(cells)} cells; allowed: {len(self.columns)}")
        self.rows.append(cells)

    def markdown(self) -> str:
        """A pipe table."""
        lines = [self.columns, ["---"] * len(self.columns), *([_shown(c, "±") for c in row] for row in self.rows)]
        return "\n".join(f"| {' | '.join(str(cell).replace('|', chr(92) + '|') for cell in line)} |" for line in lines)

    def csv(self) -> str:
        """Comma-separated with full precision; a mean is followed by a column of its standard deviation."""
        spread = [any(isinstance(row[i], Spread) for row in self.rows) for i in range(len(self.columns))]
        stream = io.StringIO()
        writer = csv.writer(stream, lineterminator="\n")
        heads = zip(self.columns, spread, strict=True)
        writer.writerow([name for head, two in heads for name in ([head, f"{head} std"] if two else [head])])
        for row in self.rows:
            writer.writerow([value for cell, two in zip(row, spread, strict=True) for value in _exact(cell, two)])
        return stream.getvalue()

    def latex(self) -> str:
        """A ``table`` environment with booktabs rules."""
        kinds = "".join(
            "l" if any(isinstance(row[i], str) for row in self.rows) else "r" for i in range(len(self.columns))
        )
        body = [" & ".join(_latex(cell) for cell in row) + r" \\" for row in self.rows]
        head = " & ".join(_escaped(column) for column in self.columns) + r" \\"
        return "\n".join(
            [
                r"\begin{table}",
                r"  \centering",
                rf"  \caption{{{_escaped(self.caption)}}}",
                rf"  \begin{{tabular}}{{{kinds}}}",
                r"    \toprule",
                f"    {head}",
                r"    \midrule",
                *(f"    {line}" for line in body),
                r"    \bottomrule",
                r"  \end{tabular}",
                r"\end{table}",
                "",
            ]
        )

    def write(self, folder: Path, name: str) -> None:
        """Write ``name.md``, ``name.csv`` and ``name.tex`` into a folder."""
        (folder / f"{name}.md").write_text(f"{self.caption}\n\n{self.markdown()}\n", encoding="utf-8")
        (folder / f"{name}.csv").write_text(self.csv(), encoding="utf-8")
        (folder / f"{name}.tex").write_text(self.latex(), encoding="utf-8")


def _shown(cell: Cell, between: str) -> str:
    if isinstance(cell, Spread):
        if math.isnan(cell.mean):
            return ""
        return f"{_number(cell.mean, cell.digits)} {between} {_number(cell.std, cell.digits)}"
    if cell is None or (isinstance(cell, float) and math.isnan(cell)):
        return ""
    return f"{cell:.4g}" if isinstance(cell, float) else str(cell)


def _number(value: float, digits: int) -> str:
    return f"{value:.{digits}f}" if abs(value) < 1e4 else f"{value:.3g}"


def _exact(cell: Cell, two: bool) -> list[str]:
    if isinstance(cell, Spread):
        return [_exact(cell.mean, False)[0], _exact(cell.std, False)[0]]
    text = "" if cell is None or (isinstance(cell, float) and math.isnan(cell)) else str(cell)
    return [text, ""] if two else [text]


def _latex(cell: Cell) -> str:
    if isinstance(cell, Spread):
        shown = _shown(cell, r"\pm")
        return f"${shown}$" if shown else ""
    return _escaped(_shown(cell, ""))


_SPECIAL = {
    "\\": r"\textbackslash{}",
    **{sign: f"\\{sign}" for sign in "&%$#_{}"},
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
    "±": r"$\pm$",
}


def _escaped(text: str) -> str:
    return "".join(_SPECIAL.get(sign, sign) for sign in text)
