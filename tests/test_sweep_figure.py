"""The distribution of a sweep."""

import numpy as np
import pytest

from gbt_ocp.reporting.sweep_figure import MOST_VARIANTS, distribution


def rows(values, **more):
    return [{"error_settled": value, **more} for value in values]


def test_every_run_is_a_point_beside_median_and_middle_of_its_variant():
    values = {"a: 1": [0.03, 0.01, 0.02], "a: 2": [0.5, None, 0.7, float("nan")]}
    figure = distribution({name: rows(found) for name, found in values.items()})
    (axes,) = figure.axes
    assert axes.get_xlabel() == "settled error [m]"
    assert [label.get_text() for label in axes.get_yticklabels()] == list(values)
    assert axes.get_xscale() == "log"
    bars, points, medians = axes.lines[0::3], axes.lines[1::3], axes.lines[2::3]
    for row, finite in enumerate(([0.03, 0.01, 0.02], [0.5, 0.7])):
        assert set(points[row].get_ydata()) == {row}
        np.testing.assert_allclose(points[row].get_xdata(), finite)
        np.testing.assert_allclose(medians[row].get_xdata(), np.median(finite))
        np.testing.assert_allclose(bars[row].get_xdata(), np.percentile(finite, [10.0, 90.0]))


def test_errors_of_the_range_are_shown_in_per_cent_where_there_are_any():
    figure = distribution({"all runs": rows([1.0, 1.1], relative_error=0.02, relative_error_10s=0.05)})
    settled, now, ahead = figure.axes
    assert now.get_xlabel() == "error now [% of range]"
    assert list(now.lines[1].get_xdata()) == [2.0, 2.0]
    assert list(ahead.lines[1].get_xdata()) == [5.0, 5.0]
    assert settled.get_xscale() == "linear"


def test_a_sweep_without_errors_has_none_and_one_of_many_variants_fits_a_page():
    assert distribution({"all runs": [{"status": "failed", "error_settled": None}]}) is None
    figure = distribution({f"seed: {number}": rows([1.0]) for number in range(MOST_VARIANTS + 5)})
    assert len(figure.axes[0].get_yticks()) == MOST_VARIANTS
    assert f"first {MOST_VARIANTS} of {MOST_VARIANTS + 5}" in figure.get_suptitle()


@pytest.mark.parametrize("lengths", [(3, 90)])
def test_long_names_leave_room_for_the_plot(lengths):
    figure = distribution({"x" * length: rows([1.0, 2.0]) for length in lengths})
    figure.canvas.draw()
    assert figure.axes[0].get_position().width > 0.4
