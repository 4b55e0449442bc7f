"""Held turn rates, and the mixture of them with interacting models, as generated pilots have them."""

from __future__ import annotations

import ctypes
from collections.abc import Mapping
from functools import cache
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from gbt_ocp.models.measurements import MeasurementKind, Sighting
from gbt_ocp.pilot.compiled_ekf import sighting_for_c
from gbt_ocp.pilot.pilot_source import UNLISTED
from gbt_ocp.pilot.state_in_c import StateInC
from gbt_ocp.pilot.tracker_source import TrackerInC, tracker_in_c
from gbt_ocp.tracking.held.held_turn import HeldTurnTracker
from gbt_ocp.tracking.mixture import MixtureTracker
from gbt_ocp.tracking.noise import BearingNoise
from gbt_ocp.tracking.polar import checked_sighting, is_bearing
from gbt_ocp.tracking.protocol import Forecast, Tracker, WeighedForecasts
from gbt_ocp.tracking.window import checked_sample
from gbt_ocp.typing import Array


class _InC(StateInC):
    """A tracker's state in C, and the calls on it; times have to increase."""

    def __init__(self, made: TrackerInC, dimension: int, start: Array) -> None:
        super().__init__(made, dimension, UNLISTED, ("begin", "forecast"), works=True)
        self._dimension = dimension
        self.latest: float | None = None
        self.taken = -np.inf
        self._sensors: dict[str, int] = {}
        self.own = np.array(start, dtype=float)
        self.call("begin", self.own)

    def update(self, time: float, bearing: ArrayLike, own_position: ArrayLike) -> None:
        """Take in a bearing."""
        direction, own = checked_sample(time, bearing, own_position, self.latest, since=self.taken)
        if not self.call_working("update", ctypes.c_double(float(time)), direction, own):
            raise ValueError(f"time: found {time}, one bearing more than a bin can hold; allowed: a lower rate")
        self.taken = self.latest = float(time)
        self.own = own

    def take(self, sighting: Sighting, takes: tuple[MeasurementKind, ...], name: str) -> None:
        """Take in a measurement of a kind that the tracker of this name takes."""
        checked_sighting(sighting, takes, name, self._dimension, self.taken)
        if sighting.platform:
            raise ValueError(
                f"platform: found '{sighting.platform}'; allowed with tracker.engine compiled: the own one"
            )
        if not self.call_working("take", ctypes.byref(sighting_for_c(sighting, self._sensors))):
            raise ValueError(
                f"time: found {sighting.time}, one measurement more than a bin can hold; allowed: a lower rate"
            )
        self.taken = sighting.time
        if sighting.kind == "position" or is_bearing(sighting):
            self.latest, self.own = sighting.time, sighting.position

    def forecast(self, times: ArrayLike) -> Forecast:
        """At the times ``(K,)``."""
        t, d = np.atleast_1d(np.asarray(times, dtype=float)), self._dimension
        mean, covariance = np.empty((len(t), d)), np.empty((len(t), d, d))
        self.call_working("forecast", t, ctypes.c_int(len(t)), mean, covariance)
        return Forecast(mean, covariance)

    def believed(self, member: int, times: Array) -> Forecast:
        """What a member says of the times ``(K,)``."""
        d = self._dimension
        mean, covariance = np.empty((len(times), d)), np.empty((len(times), d, d))
        self.call_working("ask", ctypes.c_double(float(times.max(initial=-np.inf))))
        for place, time in enumerate(times):
            self.call("believe", ctypes.c_int(member), ctypes.c_double(float(time)), mean[place], covariance[place])
        return Forecast(mean, covariance)


class CompiledHeldTurnTracker(HeldTurnTracker):
    """:class:`~gbt_ocp.tracking.held.held_turn.HeldTurnTracker` whose numbers are those of the C of a pilot.

    The library is compiled once and kept in the user's cache.

    Parameters
    ----------
    dimension, keys
        As for the tracker in numpy.

    Raises
    ------
    ValueError
        If a parameter is out of range.
    gbt_ocp.ocp.codegen.library.CompilerError
        If there is no working C compiler.
    """

    def __init__(self, dimension: int, **keys: Any) -> None:
        super().__init__(dimension, **keys)
        self._c = _InC(tracker_in_c(self), dimension, self._position.start)

    @property
    def _state(self) -> Any:
        return _held_turn(self.dimension).from_buffer(self._c.state)

    @property
    def new_tracks(self) -> int:
        """How often a gap of more than ten windows has ended and a new track has begun."""
        return int(self._state.gaps.count)

    @property
    def restarts(self) -> int:
        """How often the track was lost and begun again."""
        return int(self._state.restarts)

    @restarts.setter
    def restarts(self, value: int) -> None:
        """Set by the constructor alone."""

    def update(self, time: float, bearing: ArrayLike, own_position: ArrayLike) -> None:
        """As :meth:`HeldTurnTracker.update`."""
        self._c.update(time, bearing, own_position)

    def take(self, sighting: Sighting) -> None:
        """As :meth:`HeldTurnTracker.take`."""
        self._c.take(sighting, self.takes, "held_turn")

    @property
    def range_observable(self) -> bool:
        """Whether the range is known to a quarter; before, it is mostly the prior's."""
        return bool(self._state.observable)

    def predict(self, times: ArrayLike) -> Forecast:
        """As :meth:`HeldTurnTracker.predict`."""
        return self._c.forecast(times)


class CompiledMixtureTracker(MixtureTracker):
    """:class:`~gbt_ocp.tracking.mixture.MixtureTracker` whose numbers are those of the C of a pilot.

    The library is compiled once and kept in the user's cache. The members say what it is made of, they see nothing:
    they are part of what stays as it was built.

    Parameters
    ----------
    dimension, members, noise, keys
        As for the tracker in numpy; the members are one of held turn rates and one of interacting models in bins, named
        ``held_turn`` and ``imm_ekf``.

    Raises
    ------
    ValueError
        If a parameter is out of range, or a member does not exist in C.
    gbt_ocp.ocp.codegen.library.CompilerError
        If there is no working C compiler.
    """

    def __init__(self, dimension: int, members: Mapping[str, Tracker], noise: BearingNoise, **keys: Any) -> None:
        super().__init__(dimension, members, noise, **keys)
        held = self.members["held_turn"]
        made = tracker_in_c(self)
        self.members = MappingProxyType(self.members)
        assert isinstance(held, HeldTurnTracker), "it is refused otherwise"
        self._c = _InC(made, dimension, held.settings[4].start)

    @property
    def _state(self) -> Any:
        return _mixture(self.dimension, len(self.members)).from_buffer(self._c.state)

    @property
    def new_tracks(self) -> int:
        """How often a gap of more than ten windows has ended and a new track has begun."""
        return int(self._state.gaps.count)

    @property
    def restarts(self) -> int:
        """How often a track was lost and begun again, of all."""
        return self._c.counted("restarts")

    def update(self, time: float, bearing: ArrayLike, own_position: ArrayLike) -> None:
        """As :meth:`MixtureTracker.update`."""
        self._c.update(time, bearing, own_position)
        self._own = self._c.own

    def take(self, sighting: Sighting) -> None:
        """As :meth:`MixtureTracker.take`."""
        self._c.take(sighting, self.takes, "mixture")
        self._own = self._c.own

    @property
    def log_evidence(self) -> Array:
        """Of the members ``(M,)``, for the full bins until now, faded."""
        return np.array(self._state.evidence)

    @property
    def _latest(self) -> float | None:
        return self._c.latest

    def predict(self, times: ArrayLike) -> Forecast:
        """As :meth:`MixtureTracker.predict`."""
        return self._c.forecast(times)

    def hypotheses_at(self, times: ArrayLike) -> WeighedForecasts:
        """As :meth:`MixtureTracker.hypotheses_at`."""
        t, weights = np.atleast_1d(np.asarray(times, dtype=float)), np.array(self._state.weight)
        parts = [self._c.believed(int(member), t) for member in np.flatnonzero(weights)]
        means, covariances = (np.array(values) for values in zip(*parts, strict=True))
        return WeighedForecasts(weights[weights > 0.0], means, covariances)


_NUMBER, _WHOLE = ctypes.c_double, ctypes.c_int


class _Gaps(ctypes.Structure):
    _fields_ = [
        ("count", _WHOLE),
        *((name, _NUMBER) for name in ("span", "bearings", "unknown", "began", "latest")),
        ("taken", _WHOLE),
    ]


def _struct(*fields: tuple[str, Any]) -> Any:
    return type("Struct", (ctypes.Structure,), {"_fields_": list(fields)})


@cache
def _held_turn(d: int) -> Any:
    """The struct of C as far as it is read."""
    whole = [(name, _WHOLE) for name in ("known", "found", "count", "observable", "nodes", "restarts")]
    return _struct(("now", _NUMBER), ("first", _NUMBER), ("own", _NUMBER * d), *whole, ("gaps", _Gaps))


@cache
def _mixture(d: int, members: int) -> Any:
    """The struct of C as far as it is read."""
    whole = [(name, _WHOLE) for name in ("seen", "predicted", "told")]
    each = [(name, _NUMBER * members) for name in ("weight", "evidence")]
    said = [("mean", _NUMBER * (2 * members * d)), ("covariance", _NUMBER * (2 * members * d * d))]
    return _struct(("begins", _NUMBER), *whole, *each, ("own", _NUMBER * d), *said, ("gaps", _Gaps))
