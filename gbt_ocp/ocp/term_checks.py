"""Objectives and limits checked where they are added to a problem: members, sizes, bounds, expressions.

Every term is evaluated once, on CasADi symbols of the sizes that it will meet. A fault is a
:class:`~gbt_ocp.models.contracts.ContractError` of one line that names the class and the method.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import casadi as ca
import numpy as np

from gbt_ocp.models.contracts import (
    ContractError,
    array,
    called,
    expression,
    finite,
    has,
    member,
    method,
    named,
    reason,
    shown,
)
from gbt_ocp.models.vehicles import DrivenVehicle
from gbt_ocp.ocp.terms import AnyObjective, Constraint, MissingDataError, MovingConstraint
from gbt_ocp.ocp.trajectory import FlatPoint
from gbt_ocp.typing import Array

BAND = "to hold a quantity give it a band, such as 0.001 on either side"


def check_objective(objective: AnyObjective, vehicle: DrivenVehicle, pieces: int) -> None:
    """Evaluate an objective once.

    Parameters
    ----------
    objective
        Of any of the three protocols.
    vehicle
        Gives the sizes of a point and of the moments of a forecast.
    pieces
        p, the endpoints that a joint objective couples.

    Raises
    ------
    ContractError
        If a member is missing or gives something else than the protocol says.
    """
    n = vehicle.flat_dimension
    _check_dimension(objective, vehicle)
    sums = has(objective, "accumulated")
    joint = has(objective, "total") and not sums
    shapes = _shapes(objective)
    method(objective, "bind", ("pieces", "data"), "numbers for the parameters, by name")
    points, parameters = zip(*(_symbols(n, shapes) for _ in range(pieces if joint else 1)), strict=True)
    name = "accumulated" if sums else "total" if joint else "value"
    given = (points, parameters) if joint else (points[0], parameters[0])
    arguments = dict(zip(("points", "parameters") if joint else ("point", "parameters"), given, strict=True))
    value = called(objective, name, arguments, "a CasADi column (m, 1)" if sums else "a CasADi scalar")
    symbols = [symbol for point in points for symbol in point]
    symbols += [symbol for each in parameters for symbol in each.values()]
    size, meaning = ((-1, 1), "one column") if sums else ((1, 1), "a scalar")
    found = expression(named(objective, name), value, size, symbols, meaning)
    if sums:
        _check_of_sums(objective, found.numel())
    if has(objective, "from_moments"):
        _check_moments(objective, "from_moments", {"mean": 1, "root": 0, "desired": 1}, shapes, vehicle)


def _check_of_sums(objective: object, count: int) -> None:
    """Evaluate what an objective makes of its sums."""
    sums = ca.SX.sym("sums", count)
    value = called(objective, "of_sums", {"sums": sums}, "a CasADi scalar")
    expression(named(objective, "of_sums"), value, (1, 1), [sums], "a scalar of the sums alone")


def check_constraint(constraint: Constraint, vehicle: DrivenVehicle) -> None:
    """Evaluate a constraint once, and hold the sizes of its bounds against what it gives.

    Parameters
    ----------
    constraint
        Of either protocol; one that has ``shapes`` or ``bind`` is a moving one.
    vehicle
        As of :func:`check_objective`.

    Raises
    ------
    ContractError
        If a member is missing or gives something else than the protocol says, bounds exclude each other or bound
        nothing, or lengths differ.
    """
    _check_dimension(constraint, vehicle)
    moving = has(constraint, "shapes") or has(constraint, "bind")
    shapes = _shapes(constraint) if moving else {}
    point, parameters = _symbols(vehicle.flat_dimension, shapes)
    arguments: dict[str, Any] = {"point": point}
    if moving:
        method(constraint, "bind", ("pieces", "data"), "numbers for the parameters, by name")
        arguments["parameters"] = parameters
    value = called(constraint, "value", arguments, "a CasADi expression (m, 1)")
    bounded = expression(named(constraint, "value"), value, (-1, 1), [*point, *parameters.values()], "one column")
    _check_bounds(constraint, bounded.numel())
    if has(constraint, "at_knot"):
        _check_moments(constraint, "at_knot", {"mean": 1, "covariance": 0, "present": 0}, shapes, vehicle)


def bound_numbers(
    term: AnyObjective | MovingConstraint, pieces: int, times: int, data: Mapping[str, Any]
) -> dict[str, Array]:
    """What a term makes of the data of a solve, checked: name to numbers ``(times, *shape)``.

    Parameters
    ----------
    term
        Whose ``bind`` is called.
    pieces
        p.
    times
        Endpoints or knots at which numbers are needed.
    data
        Of the solve.

    Raises
    ------
    MissingDataError
        If the term says that something is missing in the data.
    ContractError
        If ``bind`` raises anything else, or its numbers are missing, of another shape, or not finite.
    """
    where, shapes = named(term, "bind"), term.shapes
    try:
        found = term.bind(pieces, data)
    except MissingDataError:
        raise
    except Exception as fault:
        raise ContractError(f"{where}: found {reason(fault)}; allowed: numbers from {_given(data)}") from fault
    if not isinstance(found, Mapping):
        raise ContractError(f"{where}: found {shown(found)}; allowed: a mapping of {', '.join(shapes) or 'nothing'}")
    _check_names(where, found, shapes)
    numbers = {}
    for name, shape in shapes.items():
        here = f"{where}, {name!r}"
        numbers[name] = finite(here, array(here, found[name], (times, *shape)))
    return numbers


def _given(data: Mapping[str, Any]) -> str:
    """What of the data of a solve is there."""
    return ", ".join(sorted(name for name, value in data.items() if value is not None)) or "nothing"


def _check_dimension(term: object, vehicle: DrivenVehicle) -> None:
    """A term that says in how many dimensions it is must agree with the vehicle; its slices would miss otherwise."""
    if has(term, "dimension"):
        found, d = member(term, "dimension", "the dimension of the space"), vehicle.position_dimension
        if found != d:
            raise ContractError(f"{named(term, 'dimension')}: found {found!r}; allowed: {d}, the vehicle's")


def _shapes(term: object) -> dict[str, tuple[int, int]]:
    wanted = "a mapping of names to shapes, {'goal': (2, 1)}; {} where no numbers are needed"
    found = member(term, "shapes", wanted)
    if not isinstance(found, Mapping):
        raise ContractError(f"{named(term, 'shapes')}: found {shown(found)}; allowed: {wanted}")
    for name, shape in found.items():
        pair = isinstance(shape, tuple | list) and len(shape) == 2
        if not (isinstance(name, str) and pair and all(isinstance(k, int | np.integer) and k >= 1 for k in shape)):
            raise ContractError(
                f"{named(term, 'shapes')}: found {shape!r} for {name!r}; allowed: two whole numbers >= 1 for a name"
            )
    return {name: (int(shape[0]), int(shape[1])) for name, shape in found.items()}


def _symbols(size: int, shapes: Mapping[str, tuple[int, int]]) -> tuple[FlatPoint, dict[str, ca.SX]]:
    point = FlatPoint(*(ca.SX.sym(name, size) for name in ("z", "dz", "ddz")))
    return point, {name: ca.SX.sym(name, *shape) for name, shape in shapes.items()}


def _check_bounds(constraint: object, size: int) -> None:
    lower, upper, backoff, scale = (
        array(
            named(constraint, name),
            member(constraint, name, f"a numpy array of shape ({size},)"),
            (size,),
            f"one number for each of {named(constraint, 'value')}",
        )
        for name in ("lower", "upper", "backoff", "scale")
    )
    for name, bound in (("lower", lower), ("upper", upper)):
        if np.any(np.isnan(bound)):
            raise ContractError(f"{named(constraint, name)}: found {bound.tolist()}; allowed: numbers, or -inf and inf")
    finite(named(constraint, "scale"), scale, positive=True)
    if np.any(finite(named(constraint, "backoff"), backoff) < 0.0):
        raise ContractError(f"{named(constraint, 'backoff')}: found {backoff.tolist()}; allowed: numbers >= 0")
    if not np.any(np.isfinite(lower) | np.isfinite(upper)):
        raise ContractError(f"{named(constraint, 'upper')}: found no finite bound, nor in lower; allowed: at least one")
    for row in np.flatnonzero(~(lower < upper)):
        raise ContractError(
            f"{named(constraint, 'lower')}: found {lower[row]} beside upper {upper[row]} (entry {row}); "
            f"allowed: lower < upper; {BAND}"
        )
    for row in np.flatnonzero(~(lower + backoff < upper - backoff)):
        raise ContractError(
            f"{named(constraint, 'backoff')}: found {backoff[row]} beside {lower[row]} and {upper[row]} (entry {row}); "
            "allowed: less than half of what lies between the bounds"
        )


def _check_moments(
    term: object, name: str, inputs: Mapping[str, int], shapes: Mapping[str, tuple[int, int]], vehicle: DrivenVehicle
) -> None:
    """Evaluate what makes the parameters of moments; inputs are vectors (1) or matrices (0)."""
    d = vehicle.position_dimension
    symbols = {key: ca.SX.sym(key, d, 1 if vector else d) for key, vector in inputs.items()}
    found = called(term, name, symbols, "CasADi expressions of the parameters, by name")
    where = named(term, name)
    if not isinstance(found, Mapping):
        raise ContractError(f"{where}: found {shown(found)}; allowed: a mapping of {', '.join(shapes) or 'nothing'}")
    _check_names(where, found, shapes)
    for key, shape in shapes.items():
        expression(f"{where}, {key!r}", found[key], shape, list(symbols.values()), "as shapes says")


def _check_names(where: str, found: Mapping[str, Any], shapes: Mapping[str, tuple[int, int]]) -> None:
    missing: Sequence[str] = [name for name in shapes if name not in found]
    if missing:
        given = ", ".join(map(str, found)) or "nothing"
        raise ContractError(f"{where}: found {given}; allowed: {', '.join(shapes)}, the names of shapes")
