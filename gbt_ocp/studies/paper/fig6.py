"""Figure 6: the error of all methods over time (section 5.4), from the runs of tables 2 and 3."""

from __future__ import annotations

from gbt_ocp.studies.paper.method_tables import compared
from gbt_ocp.studies.paper.methods import GBT, PLANE, POLYNOMIAL_SETTLED, SPACE
from gbt_ocp.studies.paper.workbench import Report, Workbench

LOWEST = 1.0e-5
"""Lower end of the axis in metres."""


def conduct(workbench: Workbench) -> Report:
    """Draw the median over the runs with a band between quantiles, one panel a case."""
    from gbt_ocp.reporting.bands import Curve, draw_bands

    panels: dict[str, dict[str, Curve]] = {}
    for name, cases in (("table2", PLANE), ("table3", SPACE)):
        done, _, _ = compared(workbench, name, cases)
        labels = list(dict.fromkeys([GBT, *(entry.overrides["method"] for entry in done.plan.variants)]))
        for case in cases:
            for method in labels:
                rows = done.matching(case=case, method=method)
                if rows and method != POLYNOMIAL_SETTLED:
                    t, error = done.arrays(rows, "t")[0], done.arrays(rows, "mean_error")
                    panels.setdefault(f"case {case[-1]}", {})[method] = Curve(t, error)
    text = [
        f"{len(workbench.seeds)} runs a curve, the runs of tables 2 and 3: per step the mean error over the forecast, "
        "median over the runs, with the band from the 10 % to the 90 % quantile. The axis ends at "
        f"{LOWEST:g} m; where the target goes straight, exact bearings take the filters down to round-off."
    ]
    figure = draw_bands(panels, "tracking error [m]", columns=2, lowest=LOWEST)
    return Report("Figure 6: error over time", text, figures={"fig6": figure})
