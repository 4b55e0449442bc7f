"""What the kernel is given: arrays in its coordinates, which are relative to where a trajectory begins."""

from __future__ import annotations

import ctypes
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from gbt_ocp.ocp.objective_total import stacked_size
from gbt_ocp.ocp.problem_data import PosedProblem
from gbt_ocp.ocp.transcription import limit_size
from gbt_ocp.typing import Array


def stacked_parameters(parameters: Sequence[Array]) -> Array:
    """Parameters of all terms, one time after the other."""
    return np.ascontiguousarray(np.vstack(list(parameters)).T, dtype=float).ravel() if parameters else np.zeros(0)


class SolveArrays:
    """The arrays of a solve, at addresses that stay: to find that of an array takes longer than to fill a short one."""

    def __init__(self, kernel: ctypes.CDLL, problem: PosedProblem) -> None:
        p, d, ends = problem.pieces, problem.vehicle.position_dimension, kernel.gbt_ends_size()
        state, knots = kernel.gbt_state_size(), kernel.gbt_knots_size()
        sizes = {
            "base": d,
            "origin": d,
            "state": state,
            "begin": state,
            "ends": (p, sum(stacked_size(term.shapes) for term in problem.objectives)),
            "knots": (p + 1, sum(limit_size(constraint) for constraint in problem.constraints)),
            "numbers": p * ends + (p + 1) * knots,
            "inside": len(problem.constraints) + 1,
            "variables": (p, problem.freedoms),
        }
        self.arrays = {name: np.zeros(size) for name, size in sizes.items()}
        at = {name: ctypes.c_void_p(values.ctypes.data) for name, values in self.arrays.items()}
        second = ctypes.c_void_p(self.arrays["numbers"].ctypes.data + 8 * p * ends)
        self._steps: list[tuple[Any, tuple[Any, ...]]]
        self._steps = [(kernel.gbt_begin, (at["base"], at["state"], at["origin"], at["begin"]))]
        self._steps += [(kernel.gbt_place_ends, (at["origin"], at["ends"], p, at["numbers"]))] * (ends > 0)
        self._steps += [(kernel.gbt_place_knots, (at["origin"], at["knots"], p + 1, second))] * (knots > 0)

    def fill(self, start: Array, objectives: Sequence[Array], limits: Sequence[Array]) -> None:
        """The start and the numbers relative to where it is, from the parameters."""
        self.arrays["state"][:] = 0.0  # nothing acts where a start does not say what does
        self.arrays["state"][: np.size(start)] = np.ravel(start)
        for name, parameters in (("ends", objectives), ("knots", limits)):
            into, first = self.arrays[name], 0
            for values in parameters:
                into[:, first : first + len(values)] = values.T
                first += len(values)
        for function, arguments in self._steps:
            function(*arguments)


class MomentsOfStep:
    """``mean``, ``covariance`` and ``desired`` as the generated step takes them, at addresses that stay.

    Where limits depend on the target, the present moments come before those at the endpoints.

    Attributes
    ----------
    arrays
        By name.
    addresses
        Theirs.
    read
        The data of a solve that they are made of, where it is sound.
    """

    def __init__(self, problem: PosedProblem) -> None:
        p, d = problem.pieces, problem.vehicle.position_dimension
        self._first = first = int(any(limit_size(constraint) for constraint in problem.constraints))
        shapes = {"mean": (p + first, d), "covariance": (p + first, d, d), "desired": (p, d)}
        sizes = [int(np.prod(shape)) for shape in shapes.values()]
        self._numbers = np.zeros(sum(sizes))
        parts = np.split(self._numbers, np.cumsum(sizes)[:-1])
        self.arrays = {name: part.reshape(shape) for part, (name, shape) in zip(parts, shapes.items(), strict=True)}
        self.addresses = [array.ctypes.data for array in self.arrays.values()]
        self.read: Mapping[str, Any] | None = None

    def take(self, data: Mapping[str, Any]) -> bool:
        """Read the data of a solve; whether all is there, of the right shape and finite. What is not is zero."""
        forecast, present, desired = (data.get(name) for name in ("forecast", "present", "desired"))
        sound = self._filled("desired", 0, desired)
        for name in ("mean", "covariance"):
            sound &= self._filled(name, self._first, getattr(forecast, name, None))
            if self._first:
                now = getattr(present, name, None)
                sound &= self._filled(name, 0, None if now is None else [now])
        finite = np.isfinite(self._numbers)
        if not finite.all():
            sound = False
            self._numbers[~finite] = 0.0
        self.read = data if sound else None
        return sound

    def _filled(self, name: str, first: int, values: Any) -> bool:
        """Whether rows of an array from a first one on were found; the present comes alone."""
        into = self.arrays[name]
        into = into[first:] if first or name == "desired" or not self._first else into[:1]
        found = None if values is None else np.asarray(values, dtype=float)[: len(into)]
        if found is None or found.shape != into.shape:
            into[:] = 0.0
            return False
        into[:] = found
        return True


class KernelCoordinates:
    """The kernel's coordinates: relative to where a trajectory begins."""

    def __init__(self, kernel: ctypes.CDLL, dimension: int) -> None:
        self._kernel = kernel
        arrays = [np.zeros(dimension), np.zeros(kernel.gbt_state_size()), np.zeros(dimension)]
        self._arrays = [*arrays, np.zeros(kernel.gbt_state_size())]
        self._addresses = [ctypes.c_void_p(values.ctypes.data) for values in self._arrays]
        self._sizes = {name: getattr(kernel, f"gbt_{name}_size")() for name in ("ends", "knots")}

    def begin(self, start: Array) -> tuple[Array, Array]:
        """The origin ``(d,)``, and a start relative to it in a row, zero where it says nothing."""
        _, state, origin, begin = self._arrays
        state[:] = 0.0
        state[: start.size] = start.ravel()
        self._kernel.gbt_begin(*self._addresses)
        return origin.copy(), begin.copy()

    def placed(self, name: str, origin: Array, parameters: Array, count: int) -> Array:
        """The numbers of so many ``ends`` or ``knots`` from their parameters."""
        numbers = np.empty(self._sizes[name] * count)
        arrays = [ctypes.c_void_p(values.ctypes.data) for values in (origin, parameters, numbers)]
        getattr(self._kernel, f"gbt_place_{name}")(*arrays[:2], count, arrays[2])
        return numbers
