"""A history as a table (pandas) or as labelled arrays (xarray), for notebooks."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import fields
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from pandas import DataFrame
    from xarray import Dataset

    from gbt_ocp.simulation.history import History

_AXES = ("x", "y", "z")
_BODY = {2: ("surge", "sway", "yaw"), 3: ("surge", "sway", "heave", "yaw")}

_UNITS = {
    "vehicle_pose": "m; yaw rad",
    "vehicle_velocity": "m/s; yaw rate rad/s",
    "thrust": "N; yaw moment N m",
    "piece_thrust_peak": "of the limit",
    "off_plan": "m",
    "target": "m",
    "forecast_mean": "m",
    "forecast_cov": "m2",
    "error": "m",
    "bound": "m",
    "length_scale": "s",
    "amplitude": "m",
    "nugget": "of the amplitude squared",
    "prior_cov": "m2",
    "violation": "of the limit",
    "solver_time": "s",
    "tracker_time": "s",
    "plan": "m; yaw rad",
}

# Names of the dimensions behind the first, which is t.
_DIMENSIONS: dict[str, tuple[str, ...]] = {
    "vehicle_pose": ("pose",),
    "vehicle_velocity": ("body",),
    "thrust": ("input",),
    "piece_thrust_peak": ("input",),
    "target": ("axis",),
    "bearing": ("axis",),
    "desired_bearing": ("axis",),
    "forecast_mean": ("ahead", "axis"),
    "forecast_cov": ("ahead", "axis", "axis_"),
    "error": ("ahead",),
    "bound": ("ahead",),
    "prior_cov": ("axis", "axis_"),
    "plan": ("piece", "pose"),
}

_SCALARS = (
    "off_plan",
    "condition_number",
    "length_scale",
    "amplitude",
    "nugget",
    "objective",
    "violation",
    "solver_status",
    "solver_iterations",
    "solver_time",
    "tracker_time",
    "fallback",
)


def dataframe(history: History) -> DataFrame:
    """One row a step, indexed by t in seconds: scalars, and each coordinate of position, velocity, thrust, bearing.

    Of the forecast, ``estimate_x`` … and ``estimate_std_x`` … are mean and standard deviation at t itself; ``error`` is
    the error there, ``error_mean`` and ``bound_mean`` the means over the forecast.

    Raises
    ------
    ImportError
        If pandas is not installed.
    """
    try:
        import pandas
    except ImportError:
        raise ImportError("to_dataframe() needs pandas; install it with: pip install pandas") from None
    return pandas.DataFrame(dict(_columns(history)), index=pandas.Index(history.t, name="t"))


def dataset(history: History, attributes: dict[str, Any]) -> Dataset:
    """Every array of a history under its own name, with named dimensions, coordinates and units.

    Parameters
    ----------
    history
        The run.
    attributes
        Of the dataset as a whole.

    Returns
    -------
    A dataset over ``t`` (s), ``axis`` (x, y, z), ``pose`` (and yaw), ``body`` (surge, sway, heave, yaw),
    ``input``, ``ahead`` (sampling periods after t) and ``piece``.

    Raises
    ------
    ImportError
        If xarray is not installed.
    """
    try:
        import xarray
    except ImportError:
        raise ImportError("to_xarray() needs xarray; install it with: pip install xarray") from None
    variables = {
        field.name: (
            ("t", *_DIMENSIONS.get(field.name, ())),
            getattr(history, field.name),
            {"units": _UNITS[field.name]} if field.name in _UNITS else {},
        )
        for field in fields(history)
        if field.name != "t"
    }
    axes = list(_AXES[: history.dimension])
    coordinates: dict[str, Any] = {
        "t": ("t", history.t, {"units": "s"}),
        "axis": axes,
        "axis_": axes,
        "pose": [*axes, "yaw"],
        "body": list(_BODY[history.dimension]),
        "input": _inputs(history),
        "ahead": np.arange(history.error.shape[1]),
        "piece": np.arange(1, history.plan.shape[1] + 1),
    }
    return xarray.Dataset(variables, coordinates, attributes)


def _inputs(history: History) -> list[str]:
    """Names of the thrust's axes; a vehicle of a problem's own may have any number."""
    count, names = history.thrust.shape[1], _BODY[history.dimension]
    return list(names) if count == len(names) else [str(number + 1) for number in range(count)]


def _columns(history: History) -> Iterator[tuple[str, NDArray[Any]]]:
    axes, body = _AXES[: history.dimension], _BODY[history.dimension]
    spread = np.sqrt(np.maximum(np.diagonal(history.forecast_cov[:, 0], axis1=1, axis2=2), 0.0))
    groups = (
        ("vehicle", (*axes, "yaw"), history.vehicle_pose),
        ("velocity", body, history.vehicle_velocity),
        ("thrust", _inputs(history), history.thrust),
        ("thrust_peak", _inputs(history), history.piece_thrust_peak),
        ("target", axes, history.target),
        ("bearing", axes, history.bearing),
        ("desired_bearing", axes, history.desired_bearing),
        ("estimate", axes, history.forecast_mean[:, 0]),
        ("estimate_std", axes, spread),
    )
    for group, names, values in groups:
        for name, column in zip(names, values.T, strict=True):
            yield f"{group}_{name}", column
    yield "detected", history.detected
    yield "error", history.error[:, 0]
    yield "error_mean", history.mean_error
    yield "bound_mean", history.bound.mean(axis=1)
    for name in _SCALARS:
        yield name, getattr(history, name)
