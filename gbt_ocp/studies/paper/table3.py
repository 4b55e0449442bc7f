"""Table 3: the methods in space (section 5.4)."""

from __future__ import annotations

from gbt_ocp.studies.paper.method_tables import conduct_table
from gbt_ocp.studies.paper.methods import SPACE
from gbt_ocp.studies.paper.workbench import Report, Workbench


def conduct(workbench: Workbench) -> Report:
    """Run all methods on cases 4 to 6."""
    return conduct_table(workbench, "table3", "Table 3: methods in space", SPACE)
