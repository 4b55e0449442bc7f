import csv
import io
import shutil
import subprocess

import numpy as np
import pytest

from gbt_ocp.experiments.sweep.table import write_table
from gbt_ocp.reporting.bands import Curve, draw_bands
from gbt_ocp.reporting.tables import Spread, Table
from gbt_ocp.studies.limits.tables import read_rows, write_rows


@pytest.fixture
def table():
    made = Table("Errors, 50 % of_them", ["method", "error [m]", "rank"])
    made.add("PR & co", Spread.of([0.1, 0.3], 2), 1)
    made.add("none | lost", Spread.of([np.nan]), None)
    return made


def test_spread_is_that_of_the_sample():
    values = np.random.default_rng(0).normal(size=20)
    found = Spread.of([*values, np.nan, np.inf])
    assert found.mean == pytest.approx(values.mean())
    assert found.std == pytest.approx(np.sqrt(((values - values.mean()) ** 2).sum() / 19))
    assert Spread.of([2.0]) == Spread(2.0, 0.0)


def test_markdown(table):
    assert table.markdown().splitlines() == [
        "| method | error [m] | rank |",
        "| --- | --- | --- |",
        "| PR & co | 0.20 ± 0.14 | 1 |",
        "| none \\| lost |  |  |",
    ]


def test_csv_has_full_precision_and_a_column_for_the_deviation(table):
    rows = list(csv.reader(io.StringIO(table.csv())))
    assert rows[0] == ["method", "error [m]", "error [m] std", "rank"]
    assert [float(rows[1][1]), float(rows[1][2])] == [0.2, float(np.std([0.1, 0.3], ddof=1))]
    assert rows[2] == ["none | lost", "", "", ""]


def test_latex_escapes_what_it_must(table):
    text = table.latex()
    assert r"\caption{Errors, 50 \% of\_them}" in text
    assert r"PR \& co & $0.20 \pm 0.14$ & 1 \\" in text
    assert r"\begin{tabular}{lrr}" in text


@pytest.mark.skipif(shutil.which("pdflatex") is None, reason="no LaTeX")
def test_latex_compiles(table, tmp_path):
    page = r"\documentclass{article}\usepackage{booktabs}\begin{document}" + table.latex() + r"\end{document}"
    (tmp_path / "page.tex").write_text(page)
    subprocess.run(["pdflatex", "-halt-on-error", "page.tex"], cwd=tmp_path, check=True, capture_output=True)


def test_a_row_has_one_cell_a_column(table):
    with pytest.raises(ValueError, match="a row has 1 cells; allowed: 3"):
        table.add("alone")


def test_files(table, tmp_path):
    table.write(tmp_path, "errors")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["errors.csv", "errors.md", "errors.tex"]


def test_bands_are_the_quantiles_over_the_runs():
    t = np.linspace(0.0, 1.0, 5)
    values = np.random.default_rng(1).lognormal(size=(40, 5))
    values[3, 2] = np.nan
    figure = draw_bands(
        {"one": {"a": Curve(t, values)}, "two": {"a": Curve(t, values), "b": Curve(t, values)}}, "e [m]"
    )
    axes = figure.axes[0]
    (line,) = axes.lines
    np.testing.assert_allclose(line.get_ydata(), np.nanmedian(values, axis=0))
    corners = axes.collections[0].get_paths()[0].vertices
    for index, time in enumerate(t):
        column = np.sort(values[np.isfinite(values[:, index]), index])
        ends = corners[np.isclose(corners[:, 0], time), 1]
        assert ends.min() == pytest.approx(np.quantile(column, 0.1))
        assert ends.max() == pytest.approx(np.quantile(column, 0.9))
    assert figure.axes[1].lines[0].get_color() == line.get_color()
    with pytest.raises(ValueError, match="at most 8"):
        draw_bands({"all": {str(n): Curve(t, values) for n in range(9)}}, "e [m]")


LONG = [1_700_000_000.123456, 7_034_567.891_234_5, 0.1 + 0.2, 1e-300, -(2.0**53)]
"""An absolute time, a northing, and numbers that have no short text."""


def test_every_table_in_csv_holds_its_numbers_in_full(tmp_path):
    table = Table("numbers", ["name", "value"])
    for value in LONG:
        table.add("a", value)
    table.add("b", np.float64(LONG[1]))
    table.add("c", Spread(LONG[1], LONG[0]))
    rows = list(csv.reader(io.StringIO(table.csv())))[1:]
    assert [float(row[1]) for row in rows] == [*LONG, LONG[1], LONG[1]]
    assert float(rows[-1][2]) == LONG[0]

    write_table(tmp_path, [{"run": k, "value": value} for k, value in enumerate(LONG)])
    with (tmp_path / "runs.csv").open(newline="", encoding="utf-8") as stream:
        assert [float(row["value"]) for row in csv.DictReader(stream)] == LONG

    write_rows(tmp_path / "rows.csv", [{"value": value} for value in (*LONG, np.float64(LONG[0]))])
    assert [row["value"] for row in read_rows(tmp_path / "rows.csv")] == [*LONG, LONG[0]]
