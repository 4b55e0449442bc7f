"""Members of an object that a user wrote, read with a message of one line that names the class and the member.

:mod:`gbt_ocp.models.model_checks` holds targets and vehicles against their protocols with these functions,
:mod:`gbt_ocp.ocp.term_checks` objectives and limits.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import casadi as ca
import numpy as np

from gbt_ocp.typing import Array

LONGEST = 80
"""Characters of a value that a message shows."""


class ContractError(ValueError):
    """A class of the user's lacks a member, or a member gives what the caller cannot use; the message is one line."""


def named(thing: object, name: str) -> str:
    """``Class.member``, as messages call it."""
    return f"{type(thing).__name__}.{name}"


def has(thing: object, name: str) -> bool:
    """Whether an object has a member, found without evaluating it where it is a property."""
    try:
        inspect.getattr_static(thing, name)
    except AttributeError:
        return hasattr(thing, name)  # what __getattr__ makes up
    return True


def member(thing: object, name: str, allowed: str) -> Any:
    """A member of an object.

    Parameters
    ----------
    thing
        The object.
    name
        Of the member.
    allowed
        What it should be, for the message.

    Raises
    ------
    ContractError
        If there is none, if reading it raises, or if ``thing`` is a class instead of an object of it.
    """
    if isinstance(thing, type):
        raise ContractError(
            f"{thing.__name__}: found the class; allowed: an object of it, as {thing.__name__}(...) makes"
        )
    if not has(thing, name):
        raise ContractError(f"{named(thing, name)}: found nothing of this name; allowed: {allowed}")
    try:
        return getattr(thing, name)
    except Exception as fault:
        raise ContractError(f"{named(thing, name)}: found {reason(fault)}; allowed: {allowed}") from fault


def method(thing: object, name: str, arguments: Sequence[str], allowed: str) -> Any:
    """A method of an object that can be called with these arguments, by position.

    Raises
    ------
    ContractError
        As :func:`member`, or if it cannot be called so.
    """
    found = member(thing, name, allowed)
    wanted = f"a method ({', '.join(arguments)}) that gives {allowed}"
    if not callable(found):
        raise ContractError(f"{named(thing, name)}: found {shown(found)}; allowed: {wanted}")
    try:
        signature = inspect.signature(found)
    except (TypeError, ValueError):  # written in C: calling it will tell
        return found
    try:
        signature.bind(*arguments)
    except TypeError:
        raise ContractError(f"{named(thing, name)}: found the arguments {signature}; allowed: {wanted}") from None
    return found


def called(thing: object, name: str, arguments: Mapping[str, Any], allowed: str) -> Any:
    """What a method gives for these arguments (their names are for the message).

    Raises
    ------
    ContractError
        As :func:`method`, or if it raises.
    """
    found = method(thing, name, list(arguments), allowed)
    try:
        return found(*arguments.values())
    except ContractError:
        raise
    except Exception as fault:
        raise ContractError(f"{named(thing, name)}: found {reason(fault)}; allowed: {allowed}") from fault


def made(name: str, factory: Callable[..., Any], *arguments: Any) -> Any:
    """What a function of the user's makes of these arguments; ``name`` is what messages call it.

    Raises
    ------
    ContractError
        If the function raises or returns nothing.
    """
    try:
        found = factory(*arguments)
    except ContractError as fault:
        raise ContractError(f"{name}: {fault}") from fault
    except Exception as fault:
        raise ContractError(f"{name}: found {reason(fault)}; allowed: a function that runs") from fault
    if found is None:
        raise ContractError(f"{name}: found nothing returned; allowed: a function that returns what it makes")
    return found


def array(where: str, value: Any, shape: tuple[int, ...], meaning: str = "") -> Array:
    """A value that is an array of numbers.

    Parameters
    ----------
    where
        Where it comes from, for the message.
    value
        What was found.
    shape
        That it must have.
    meaning
        Of the shape, ``(K, d)``.

    Raises
    ------
    ContractError
        If it is no array of numbers, or of another shape; infinite and undefined numbers pass.
    """
    allowed = f"a numpy array of shape {shape}{meaning and ', '}{meaning}"
    if not isinstance(value, np.ndarray) or value.dtype.kind not in "iuf":
        raise ContractError(f"{where}: found {shown(value)}; allowed: {allowed}")
    if value.shape != shape:
        raise ContractError(f"{where}: found shape {value.shape}; allowed: {allowed}")
    return np.asarray(value, dtype=float)


def finite(where: str, values: Array, *, positive: bool = False) -> Array:
    """The numbers, if all of them are finite, and above 0 where that is asked for.

    Raises
    ------
    ContractError
        If not.
    """
    wrong = ~np.isfinite(values) | ((values <= 0.0) if positive else False)
    if np.any(wrong):
        first = tuple(int(places[0]) for places in np.nonzero(wrong))
        entry = f"{values[first]} at {first if len(first) > 1 else first[0]} of" if values.size > 4 else ""
        found = f"{entry} shape {values.shape}" if entry else str(values.tolist())
        raise ContractError(f"{where}: found {found}; allowed: finite numbers{' > 0' * positive}")
    return values


def count(thing: object, name: str, least: int, meaning: str) -> int:
    """A member that is a whole number.

    Raises
    ------
    ContractError
        If it is none, or too small.
    """
    allowed = f"{meaning}, a whole number >= {least}"
    found = member(thing, name, allowed)
    if not isinstance(found, int | np.integer) or isinstance(found, bool) or found < least:
        raise ContractError(f"{named(thing, name)}: found {shown(found)}; allowed: {allowed}")
    return int(found)


def expression(where: str, value: Any, shape: tuple[int, int], symbols: Sequence[ca.SX], meaning: str = "") -> ca.SX:
    """A value as a CasADi expression of the symbols that it was computed from.

    Parameters
    ----------
    where, value, meaning
        As of :func:`array`.
    shape
        That it must have; -1 for any number of rows.
    symbols
        That it may depend on.

    Raises
    ------
    ContractError
        If it is no SX expression or number, of another shape, or depends on other symbols.
    """
    size = f"({'m' if shape[0] < 0 else shape[0]}, {shape[1]})"
    allowed = f"a CasADi expression (SX) of shape {size}{meaning and ', '}{meaning}"
    if not isinstance(value, ca.SX | ca.DM | int | float | np.number):
        raise ContractError(f"{where}: found {shown(value)}; allowed: {allowed}")
    found: ca.SX = ca.SX(value) if isinstance(value, ca.SX | ca.DM) else ca.SX(float(value))
    if found.shape[1] != shape[1] or found.shape[0] != (shape[0] if shape[0] >= 0 else max(found.shape[0], 1)):
        raise ContractError(f"{where}: found shape {found.shape}; allowed: {allowed}")
    free = ca.Function("expression", list(symbols), [found], {"allow_free": True}).free_sx()
    if free:
        raise ContractError(f"{where}: found the symbol {free[0]}; allowed: an expression of what the method is given")
    return found


def reason(fault: BaseException) -> str:
    """Kind and first line of an exception."""
    lines = str(fault).strip().splitlines()
    return f"{type(fault).__name__}{f': {lines[0].strip()}' if lines else ''}"


def shown(value: Any) -> str:
    """A short text of a value."""
    plain = value is None or isinstance(value, bool | int | float | str | list)
    text = " ".join((repr(value) if plain else f"a {type(value).__name__}, {value!r}").split())
    return text if len(text) <= LONGEST else f"{text[:LONGEST]}…"
