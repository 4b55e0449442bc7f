"""A tracking problem: what moves, in how many dimensions, and which defaults and parts it replaces."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True)
class TrackingProblem:
    """What a module in ``problems/`` exports under the name ``problem``.

    Parameters
    ----------
    name
        Short name, as in ``problem: case2``.
    dimension
        d, 2 in the plane or 3 in space.
    description
        One line for ``gbt-ocp list``.
    target
        The target's motion: the mapping a file would write under ``target`` (``{"kind": "case2"}``; a relative track
        path is looked up beside the module), or a function without arguments that returns an object with
        ``dimension`` and ``position(times) -> (K, d)`` in metres.
    defaults
        Partial configuration, keys as in a file, that applies unless a preset or the file says otherwise.
    vehicle
        Function without arguments that returns a :class:`gbt_ocp.models.vehicles.Vehicle`, or with ``planner.form:
        shooting`` any object that :class:`gbt_ocp.models.vehicle_by_rates.VehicleByRates` takes; ``None`` for the
        Fossen model of the configuration.
    objective
        Function that returns the planner's objective; ``None`` for the expected bearing similarity.
    constrain
        Function that takes the :class:`gbt_ocp.ocp.TrajectoryProblem` and returns it subject to more; ``None`` where
        the limits of the configuration are all.

    Raises
    ------
    ValueError
        If the dimension is neither 2 nor 3, or a field is of the wrong kind.
    """

    name: str
    dimension: int
    description: str
    target: Mapping[str, Any] | Callable[[], object]
    defaults: Mapping[str, Any] = field(default_factory=dict)
    vehicle: Callable[[], object] | None = None
    objective: Callable[..., object] | None = None
    constrain: Callable[[Any], object] | None = None

    def __post_init__(self) -> None:
        if self.dimension not in (2, 3):
            raise ValueError(f"dimension: found {self.dimension!r}; allowed: 2, 3")
        if not (isinstance(self.target, Mapping) or callable(self.target)):
            raise ValueError(f"target: found {self.target!r}; allowed: a mapping, or a function without arguments")
        if not isinstance(self.defaults, Mapping):
            raise ValueError(f"defaults: found {self.defaults!r}; allowed: a mapping with the keys of a configuration")
        for key, value in (("vehicle", self.vehicle), ("objective", self.objective), ("constrain", self.constrain)):
            if not (value is None or callable(value)):
                raise ValueError(f"{key}: found {value!r}; allowed: a function, or None")
