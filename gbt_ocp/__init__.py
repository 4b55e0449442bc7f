"""Trajectory optimisation for bearing-only target tracking: optimal control on CasADi with a Gaussian-process tracker.

In short::

    import gbt_ocp as gbt
    result = gbt.run("case2")
    result.summary["error_settled"]

The matrices are small, and threads slow small matrices down: set ``OPENBLAS_NUM_THREADS=1`` before numpy is imported
(``gbt-ocp`` does so by itself).
"""

from __future__ import annotations

TYPE_CHECKING = False  # not typing's: an interrupt while that is loaded would not be answered in one line
if TYPE_CHECKING:
    from typing import Any

    __version__: str
    from gbt_ocp.experiments.build.tracker_kinds import TrackerKind
    from gbt_ocp.experiments.config.faults import ConfigurationError
    from gbt_ocp.experiments.config.loading import load_config
    from gbt_ocp.experiments.config.schema import Configuration, register_tracker
    from gbt_ocp.experiments.config.tracker import TrackerSection
    from gbt_ocp.experiments.config.tracking_problem import TrackingProblem
    from gbt_ocp.experiments.pilot import Pilot
    from gbt_ocp.experiments.replay import replay
    from gbt_ocp.experiments.result import Result
    from gbt_ocp.experiments.run import run
    from gbt_ocp.experiments.sweep.carry_out import Sweep, sweep
    from gbt_ocp.models.measurements import Measurement
    from gbt_ocp.simulation.history import History
    from gbt_ocp.studies.limits.compare import Comparison, compare
    from gbt_ocp.studies.paper.reproduce import reproduce

_HOMES = {
    "Comparison": "studies.limits.compare",
    "Configuration": "experiments.config.schema",
    "ConfigurationError": "experiments.config.faults",
    "History": "simulation.history",
    "Measurement": "models.measurements",
    "Pilot": "experiments.pilot",
    "Result": "experiments.result",
    "Sweep": "experiments.sweep.carry_out",
    "TrackerKind": "experiments.build.tracker_kinds",
    "TrackerSection": "experiments.config.tracker",
    "TrackingProblem": "experiments.config.tracking_problem",
    "compare": "studies.limits.compare",
    "load_config": "experiments.config.loading",
    "register_tracker": "experiments.config.schema",
    "replay": "experiments.replay",
    "reproduce": "studies.paper.reproduce",
    "run": "experiments.run",
    "sweep": "experiments.sweep.carry_out",
}

__all__ = [
    "Comparison",
    "Configuration",
    "ConfigurationError",
    "History",
    "Measurement",
    "Pilot",
    "Result",
    "Sweep",
    "TrackerKind",
    "TrackerSection",
    "TrackingProblem",
    "compare",
    "load_config",
    "register_tracker",
    "replay",
    "reproduce",
    "run",
    "sweep",
]


def __getattr__(name: str) -> Any:
    """Load on first use: CasADi and SciPy take a second to import, which a schema or a fault need not wait for."""
    if name in _HOMES:
        from importlib import import_module

        return getattr(import_module(f"gbt_ocp.{_HOMES[name]}"), name)
    if name == "__version__":
        from importlib.metadata import PackageNotFoundError, version

        try:
            return version("gbt_ocp")
        except PackageNotFoundError:  # a checkout that was not installed
            return "0.0.0"
    raise AttributeError(f"module 'gbt_ocp' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted([*globals(), *_HOMES])
