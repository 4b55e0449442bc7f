"""Figures, tables, animations and pages out of what runs leave."""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from gbt_ocp.reporting.animation import write_animation
    from gbt_ocp.reporting.figures import draw_figures
    from gbt_ocp.reporting.replay_figures import draw_replay
    from gbt_ocp.reporting.run_report import write_report
    from gbt_ocp.reporting.tables import Table

_HOMES = {
    "Table": "tables",
    "draw_figures": "figures",
    "draw_replay": "replay_figures",
    "write_animation": "animation",
    "write_report": "run_report",
}

__all__ = ["Table", "draw_figures", "draw_replay", "write_animation", "write_report"]


def __getattr__(name: str) -> Any:
    """Load on first use: matplotlib takes a second to import, which tables need not wait for."""
    if name in _HOMES:
        from importlib import import_module

        return getattr(import_module(f"gbt_ocp.reporting.{_HOMES[name]}"), name)
    raise AttributeError(f"module 'gbt_ocp.reporting' has no attribute {name!r}")
