"""A history as a table (pandas) or as labelled arrays (xarray), for notebooks."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from gbt_ocp.simulation.columns import columns

if TYPE_CHECKING:
    from pandas import DataFrame
    from xarray import Dataset

    from gbt_ocp.simulation.history import History

_AXES = ("x", "y", "z")
_BODY = {2: ("surge", "sway", "yaw"), 3: ("surge", "sway", "heave", "yaw")}


def dataframe(history: History, inputs: Sequence[str] | None = None) -> DataFrame:
    """One row a step, indexed by t in seconds: scalars, and each coordinate of position, velocity, thrust, bearing.

    Of the forecast, ``estimate_x`` … and ``estimate_std_x`` … are mean and standard deviation at t itself; ``error`` is
    the error there, ``error_mean`` and ``bound_mean`` the means over the forecast.

    Parameters
    ----------
    history
        The run.
    inputs
        What the inputs are called, ``m`` names; by default after the axes, or numbered.

    Raises
    ------
    ImportError
        If pandas is not installed.
    """
    try:
        import pandas
    except ImportError:
        raise ImportError("to_dataframe() needs pandas; install it with: pip install pandas") from None
    return pandas.DataFrame(dict(_columns(history, inputs)), index=pandas.Index(history.t, name="t"))


def dataset(history: History, attributes: dict[str, Any], inputs: Sequence[str] | None = None) -> Dataset:
    """Every array of a history under its own name, with named dimensions, coordinates and units.

    Parameters
    ----------
    history
        The run.
    attributes
        Attributes of the dataset.
    inputs
        As of :func:`dataframe`.

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
        one.name: (one.axes, getattr(history, one.name), {"units": one.units} if one.units else {})
        for one in columns(history)
        if one.name != "t"
    }
    coordinates: dict[str, Any] = {
        "t": ("t", history.t, {"units": "s"}),
        **_names(history, inputs),
        "ahead": np.arange(history.error.shape[1]),
        "piece": np.arange(1, history.plan.shape[1] + 1),
    }
    return xarray.Dataset(variables, coordinates, attributes)


def _names(history: History, named: Sequence[str] | None) -> dict[str, list[str]]:
    """Names of the entries along each axis that has them; the inputs of a problem's own vehicle are numbered."""
    axes, body = list(_AXES[: history.dimension]), list(_BODY[history.dimension])
    count = history.thrust.shape[1]
    inputs = body if count == len(body) else [str(number + 1) for number in range(count)]
    if named is not None and len(named) == count:
        inputs = list(named)
    return {"axis": axes, "axis_": axes, "pose": [*axes, "yaw"], "body": body, "input": inputs}


def _columns(history: History, inputs: Sequence[str] | None) -> Iterator[tuple[str, NDArray[Any]]]:
    names = _names(history, inputs)
    for one in columns(history):
        if one.name == "t":
            continue
        for label, compute in one.table.items():
            values = compute(getattr(history, one.name))
            if values.ndim == 1:
                yield label or one.name, values
            else:
                for name, column in zip(names[one.axes[-1]], values.T, strict=True):
                    yield f"{label or one.name}_{name}", column
