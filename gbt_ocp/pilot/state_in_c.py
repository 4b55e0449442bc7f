"""What all trackers in C have in Python: the library, the settings, the state, and calls of the one on the others."""

from __future__ import annotations

import ctypes
from typing import Any

import numpy as np

from gbt_ocp.ocp.codegen.library import load_library
from gbt_ocp.pilot.tracker_source import TrackerInC, called, laid_out


class StateInC:
    """A tracker's state in C, and the functions of its library on it.

    The library is compiled once and kept in the user's cache.

    Parameters
    ----------
    made
        The tracker as C.
    dimension
        d.
    sensors
        Numbers that sensors may have.
    silent
        Functions that answer nothing.
    works
        Whether its functions need memory to work in. That keeps nothing, and nothing of it is saved.

    Attributes
    ----------
    state
        The memory of the state, as numbers of eight bytes.

    Raises
    ------
    gbt_ocp.ocp.codegen.library.CompilerError
        If there is no working C compiler.
    """

    def __init__(
        self, made: TrackerInC, dimension: int, sensors: int, silent: tuple[str, ...], *, works: bool = False
    ) -> None:
        self._name = f"gbt_{made.name}"
        self._library = load_library(made.alone(dimension, sensors))
        self._numbers = np.frombuffer(laid_out(made.settings), dtype=float).copy()
        for name in silent:
            self._function(name).restype = None
        self.state = np.zeros(-(-self._size("bytes") // 8))
        if works:
            self._work = ctypes.create_string_buffer(self._size("work_bytes"))

    def _function(self, name: str) -> Any:
        return getattr(self._library, f"{self._name}_{name}")

    def _size(self, name: str) -> int:
        function = self._function(name)
        function.restype = ctypes.c_size_t
        return int(function())

    def call(self, name: str, *given: Any) -> int:
        """A function of the library on the state and the settings."""
        return called(self._function(name), self.state, self._numbers, *given)

    def call_working(self, name: str, *given: Any) -> int:
        """The same of a function that needs memory to work in."""
        return self.call(name, self._work, *given)

    def counted(self, name: str) -> int:
        """A function of the library on the state alone."""
        return called(self._function(name), self.state)
