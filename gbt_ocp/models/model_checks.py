"""Targets and vehicles that a user wrote, evaluated once against their protocols.

A fault is a :class:`~gbt_ocp.models.contracts.ContractError` of one line that names the class and the member.
"""

from __future__ import annotations

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from gbt_ocp.models.contracts import ContractError, array, called, count, expression, finite, member, named, shown
from gbt_ocp.models.targets import Target
from gbt_ocp.models.vehicles import Vehicle
from gbt_ocp.typing import Array

SINGULAR = 1.0e9
"""Condition number of inputs by accelerations, both in their units, beyond which one does not fix the other."""


def check_target(target: Target, dimension: int) -> None:
    """Evaluate a target at one time and at two.

    Parameters
    ----------
    target
        Any object with the members of :class:`~gbt_ocp.models.targets.Target`.
    dimension
        d of the problem.

    Raises
    ------
    ContractError
        If a member is missing or gives something else than positions.
    """
    found = count(target, "dimension", 2, "the dimension of the space")
    if found != dimension:
        raise ContractError(f"{named(target, 'dimension')}: found {found}; allowed: {dimension}, the problem's")
    times: tuple[tuple[ArrayLike, tuple[int, ...], str], ...] = (
        (np.zeros(2), (2, dimension), "(K, d) for times (K,)"),
        (0.0, (dimension,), "(d,) for one time"),
    )
    for given, shape, meaning in times:
        where = f"{named(target, 'position')} at {'2 times' if shape[1:] else '1 time'}"
        position = called(target, "position", {"times": given}, f"positions in m, {meaning}")
        finite(where, array(where, position, shape, meaning))


def check_flatness(vehicle: Vehicle) -> None:
    """Check what the trajectory problem reads of a vehicle: sizes, scales and the inverse dynamics.

    Parameters
    ----------
    vehicle
        Any object with the first members of :class:`~gbt_ocp.models.vehicles.Vehicle`.

    Raises
    ------
    ContractError
        If one of them is missing or gives something of a wrong size, or an input cannot be turned into an acceleration.
    """
    d = count(vehicle, "position_dimension", 2, "the dimension of the space")
    if d > 3:
        raise ContractError(f"{named(vehicle, 'position_dimension')}: found {d}; allowed: 2, 3")
    n = count(vehicle, "flat_dimension", d, "the number of flat outputs, the position among them")
    for name, meaning in (("thrust_max", "as many inputs as flat outputs"), ("acceleration_scale", "(n,)")):
        where = named(vehicle, name)
        finite(where, array(where, member(vehicle, name, f"{n} numbers > 0"), (n,), meaning), positive=True)
    point = {name: ca.SX.sym(name, n) for name in ("z", "dz", "ddz")}
    where = named(vehicle, "inputs")
    value = called(vehicle, "inputs", point, f"a CasADi expression ({n}, 1)")
    inputs = expression(where, value, (n, 1), list(point.values()), "as many inputs as flat outputs")
    slope = ca.jacobian(inputs, point["ddz"])
    if ca.depends_on(slope, point["ddz"]):
        raise ContractError(
            f"{where}: found inputs that are not linear in ddz; allowed: a matrix times ddz, and the rest"
        )
    here = _generic_point(vehicle)
    weights = (
        np.asarray(ca.Function("slope", list(point.values())[:2], [slope])(*here[:2])) * vehicle.acceleration_scale
    )
    weights /= vehicle.thrust_max[:, None]
    if np.all(np.isfinite(weights)) and np.linalg.cond(weights) > SINGULAR:
        raise ContractError(
            f"{where}: found inputs that do not fix ddz; allowed: as many independent ones as flat outputs"
        )


def check_vehicle(vehicle: Vehicle) -> None:
    """Check all that a simulation reads of a vehicle: :func:`check_flatness`, and the forward dynamics at one state.

    Raises
    ------
    ContractError
        If a member is missing or gives something of a wrong size, or :meth:`flat` is not the inverse of :meth:`state`.
    """
    check_flatness(vehicle)
    n, d = vehicle.flat_dimension, vehicle.position_dimension
    z, dz, _ = _generic_point(vehicle)
    state = called(vehicle, "state", {"z": z, "dz": dz}, "the state, a vector of numbers")
    size = np.size(state)
    state = array(named(vehicle, "state"), state, (size,), "a vector")
    wanted = f"z and dz, numpy arrays of shape ({n},) each"
    flat = called(vehicle, "flat", {"state": state}, wanted)
    if not isinstance(flat, tuple) or len(flat) != 2:
        raise ContractError(f"{named(vehicle, 'flat')}: found {shown(flat)}; allowed: {wanted}")
    for name, found, given in zip(("z", "dz"), flat, (z, dz), strict=True):
        where = f"{name} of {named(vehicle, 'flat')}"
        array(where, found, (n,))
        if np.all(np.isfinite(found)) and not np.allclose(found, given, rtol=1e-3, atol=1e-6):
            allowed = f"{given.tolist()}, of which {named(vehicle, 'state')} made the state"
            raise ContractError(f"{where}: found {found.tolist()}; allowed: {allowed}")
    for name in ("pose", "velocity"):
        array(named(vehicle, name), called(vehicle, name, {"state": state}, f"({d + 1},)"), (d + 1,), "(d+1,)")
    thrust = 0.5 * vehicle.thrust_max
    rates = called(vehicle, "rates", {"state": state, "thrust": thrust}, f"({size},)")
    array(named(vehicle, "rates"), rates, (size,), "the state's")


def dynamics_gap(vehicle: Vehicle) -> float:
    """How far forward and inverse dynamics differ at one point: an acceleration, over its scale.

    The inputs of an acceleration are applied for a short time; what the vehicle then does should be that acceleration.

    Parameters
    ----------
    vehicle
        One that passes :func:`check_vehicle`.
    """
    z, dz, ddz = _generic_point(vehicle)
    point = [ca.SX.sym(name, vehicle.flat_dimension) for name in ("z", "dz", "ddz")]
    thrust = np.asarray(ca.Function("inputs", point, [vehicle.inputs(*point)])(z, dz, ddz)).ravel()
    state, step = vehicle.state(z, dz), 1e-5
    rates = vehicle.rates(state, thrust)
    after, before = vehicle.flat(state + step * rates)[1], vehicle.flat(state - step * rates)[1]
    return float(np.max(np.abs((after - before) / (2.0 * step) - ddz) / vehicle.acceleration_scale))


def _generic_point(vehicle: Vehicle) -> tuple[Array, Array, Array]:
    """z, ż and z̈ ``(n,)`` with no component equal to another or to zero: slow, and far from full thrust."""
    each = np.linspace(1.0, 1.5, vehicle.flat_dimension)
    scale: Array = vehicle.acceleration_scale
    return 0.1 * each, 0.02 * each * scale, 0.1 * each * scale
