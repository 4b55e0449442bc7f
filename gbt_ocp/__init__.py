"""Trajectory optimisation for bearing-only target tracking: optimal control on CasADi with a Gaussian-process tracker.

In short::

    import gbt_ocp as gbt
    result = gbt.run("case2")
    result.summary["error_settled"]

The matrices are small, and threads slow small matrices down: set ``OPENBLAS_NUM_THREADS=1`` before numpy is imported
(``gbt-ocp`` does so by itself).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    __version__: str
    from gbt_ocp.experiments.comparison.compare import Comparison, compare
    from gbt_ocp.experiments.configuration import Configuration
    from gbt_ocp.experiments.faults import ConfigurationError
    from gbt_ocp.experiments.history import History
    from gbt_ocp.experiments.loading import load_config
    from gbt_ocp.experiments.problem import TrackingProblem
    from gbt_ocp.experiments.result import Result
    from gbt_ocp.experiments.run import run
    from gbt_ocp.experiments.studies.reproducing import reproduce
    from gbt_ocp.experiments.sweep.sweeping import Sweep, sweep

_HOMES = {
    "Comparison": "comparison.compare",
    "Configuration": "configuration",
    "ConfigurationError": "faults",
    "History": "history",
    "Result": "result",
    "Sweep": "sweep.sweeping",
    "TrackingProblem": "problem",
    "compare": "comparison.compare",
    "load_config": "loading",
    "reproduce": "studies.reproducing",
    "run": "run",
    "sweep": "sweep.sweeping",
}

__all__ = [
    "Comparison",
    "Configuration",
    "ConfigurationError",
    "History",
    "Result",
    "Sweep",
    "TrackingProblem",
    "compare",
    "load_config",
    "reproduce",
    "run",
    "sweep",
]


def __getattr__(name: str) -> Any:
    """Load on first use: CasADi and SciPy take a second to import, which a schema or a fault need not wait for."""
    if name in _HOMES:
        from importlib import import_module

        return getattr(import_module(f"gbt_ocp.experiments.{_HOMES[name]}"), name)
    if name == "__version__":
        from importlib.metadata import PackageNotFoundError, version

        try:
            return version("gbt_ocp")
        except PackageNotFoundError:  # a checkout that was not installed
            return "0.0.0"
    raise AttributeError(f"module 'gbt_ocp' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted([*globals(), *_HOMES])
