"""Studies: the paper's tables and figures, each from one command (``gbt-ocp reproduce NAME``).

A study is a function of a module of this package::

    def conduct(workbench: Workbench) -> Report: ...

It asks the workbench for sweeps, and answers with a report: findings, tables and figures. To add one:

1. Describe the runs. :func:`~gbt_ocp.experiments.sweep.sweep_plan.variant` makes a checked variant out of a
   configuration and changed keys; ``labels`` are the columns by which the rows are found again::

       modes = [variant(case, {"guidance.kind": mode}, labels={"case": case, "mode": mode})
                for case in ("case2", "case5") for mode in ("static", "planner")]
       done = workbench.sweep("modes", modes, arrays=("t", "mean_error"))

   The sweep runs with ``workbench.seeds`` and lies in ``DIR/sweeps/modes``. What is finished there is not run again, so
   two studies that ask for the same sweep under the same name share it, and an interrupted study continues where it
   stopped. ``arrays`` names the attributes of a history that are kept; ``histories=True`` keeps all of it.

2. Sum up. ``done.matching(case="case2", mode="static")`` are the rows (mappings with the keys of ``summary.json``) of
   the runs that succeeded, ``workbench.column(rows, "error_settled")`` one of their numbers as an array, and
   ``done.arrays(rows, "mean_error")`` an array of their histories ``(runs, K, ...)``.

3. Report. Tables are :class:`gbt_ocp.reporting.tables.Table`, figures any matplotlib figure, for example of
   :func:`gbt_ocp.reporting.bands.draw_bands`; import ``gbt_ocp.reporting`` inside ``conduct``. A
   :class:`~gbt_ocp.studies.paper.workbench.Finding` holds a sentence of the paper against what was seen.

4. Add a line to :data:`STUDIES`.

``fig5.py`` is the shortest example. The workbench may have any number of runs (tests take two or three): a study must
not fail for a small number, and must not assume that every run succeeded.
"""

STUDIES = {
    "table2": "method_tables:table2",  # all methods in the plane, cases 1 to 3
    "table3": "method_tables:table3",  # all methods in space, cases 4 to 6
    "fig4": "fig4:conduct",  # effectiveness on the six cases: error, bounds, condition number, calibration
    "fig5": "fig5:conduct",  # motion modes: static, constant force, random, planner on cases 2 and 5
    "fig6": "fig6:conduct",  # error over time of all methods, from the runs of tables 2 and 3
    "fig7": "fig7:conduct",  # lengths of window and forecast on cases 1 and 5
    "fig8": "fig8:conduct",  # robustness of cases 3 and 6: noise, missed bearings, outliers, slow sampling, manoeuvres
    "fig9": "fig9:conduct",  # linear model of coregionalization on cases 2 and 6: error, cross-axis covariance, cost
}
"""Module and function of each study by its name on the command line, in the order of ``all``.

They are names because the command line lists them before anything is loaded.
"""
