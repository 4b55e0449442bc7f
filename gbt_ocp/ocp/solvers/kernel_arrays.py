"""What the kernel is given: arrays in its coordinates, which are relative to where a trajectory begins."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
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


class KernelCoordinates:
    """The kernel's coordinates: relative to where a trajectory begins."""

    def __init__(self, kernel: ctypes.CDLL, dimension: int) -> None:
        self._kernel = kernel
        self._base = np.zeros(dimension)
        self._states = kernel.gbt_state_size()
        self._sizes = {name: getattr(kernel, f"gbt_{name}_size")() for name in ("ends", "knots")}

    def begin(self, start: Array) -> tuple[Array, Array]:
        """The origin ``(d,)``, and a start relative to it in a row, zero where it says nothing."""
        state = np.zeros(self._states)
        state[: start.size] = start.ravel()
        origin, begin = np.empty_like(self._base), np.empty_like(state)
        self._kernel.gbt_begin(*(ctypes.c_void_p(values.ctypes.data) for values in (self._base, state, origin, begin)))
        return origin, begin

    def placed(self, name: str, origin: Array, parameters: Array, count: int) -> Array:
        """The numbers of so many ``ends`` or ``knots`` from their parameters."""
        numbers = np.empty(self._sizes[name] * count)
        arrays = [ctypes.c_void_p(values.ctypes.data) for values in (origin, parameters, numbers)]
        getattr(self._kernel, f"gbt_place_{name}")(*arrays[:2], count, arrays[2])
        return numbers
