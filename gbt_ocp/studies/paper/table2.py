"""Table 2: the methods in the plane (section 5.4)."""

from __future__ import annotations

from gbt_ocp.studies.paper.method_tables import conduct_table
from gbt_ocp.studies.paper.methods import PLANE
from gbt_ocp.studies.paper.workbench import Report, Workbench


def conduct(workbench: Workbench) -> Report:
    """Run all methods on cases 1 to 3."""
    return conduct_table(workbench, "table2", "Table 2: methods in the plane", PLANE)
