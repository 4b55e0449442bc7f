"""The extended Kalman filter that generated pilots have, in the place of the one in numpy."""

from __future__ import annotations

import ctypes
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from gbt_ocp.models.measurements import MeasurementKind, Sighting
from gbt_ocp.pilot.pilot_source import UNLISTED
from gbt_ocp.pilot.state_in_c import StateInC
from gbt_ocp.pilot.tracker_source import extended_in_c
from gbt_ocp.tracking.filters.ekf import ExtendedKalmanFilter, FirstGuess
from gbt_ocp.tracking.filters.motion_models import size_estimate
from gbt_ocp.tracking.polar import checked_sighting, is_bearing
from gbt_ocp.tracking.priors import LogNormal
from gbt_ocp.tracking.protocol import Forecast
from gbt_ocp.tracking.window import checked_sample

KINDS_IN_C: tuple[MeasurementKind, ...] = ("azimuth", "azimuth_elevation", "elevation", "range", "size", "position")
"""Kinds of measurements by their numbers in C."""


class CompiledExtendedKalmanFilter(ExtendedKalmanFilter):
    """:class:`~gbt_ocp.tracking.filters.ekf.ExtendedKalmanFilter` whose numbers are those of the C of a pilot.

    The library is compiled once and kept in the user's cache. Sensors have numbers in the order in which they come, of
    which there are eight; those beyond share the last.

    Parameters
    ----------
    guess, process_noise, bearing_std, size
        As for the filter in numpy.

    Raises
    ------
    ValueError
        If a parameter is out of range.
    gbt_ocp.ocp.codegen.library.CompilerError
        If there is no working C compiler.
    """

    takes_unstated = True

    def __init__(
        self, guess: FirstGuess, *, process_noise: float, bearing_std: float, size: LogNormal | None = None
    ) -> None:
        made = extended_in_c(guess, process_noise, bearing_std, size)
        self._c = StateInC(made, len(guess.prior.start), UNLISTED, ("begin", "predict"))
        self._sensors: dict[str, int] = {}
        super().__init__(guess, process_noise=process_noise, bearing_std=bearing_std, size=size)

    def _begin(self, guess: FirstGuess) -> None:
        super()._begin(guess)
        self._c.call("begin", np.array(guess.prior.start, dtype=float))

    @property
    def _state(self) -> Any:
        """The memory as the struct of C."""
        return _structure(len(self._guess.prior.start), self._size_prior is not None).from_buffer(self._c.state)

    @property
    def new_tracks(self) -> int:
        """How often a gap of more than ten windows has ended and a new track has begun."""
        return int(self._state.count)

    @property
    def size(self) -> LogNormal | None:
        """What is known of the target's true size in metres; ``None`` where it is not estimated."""
        state = self._state
        mean = np.array(state.mean)
        covariance = np.array(state.covariance).reshape(len(mean), len(mean))
        return size_estimate(self._size_prior, mean, covariance) if state.begun else self._size_prior

    def update(self, time: float, bearing: ArrayLike, own_position: ArrayLike) -> None:
        """As :meth:`ExtendedKalmanFilter.update`."""
        state = self._state
        direction, own = checked_sample(time, bearing, own_position, state.time if state.begun else None)
        self._taken(Sighting.of_bearing(float(time), direction, own))

    def take(self, sighting: Sighting) -> None:
        """As :meth:`ExtendedKalmanFilter.take`."""
        state = self._state
        d = len(self._guess.prior.start)
        checked_sighting(sighting, self.takes, "ekf", d, state.time if state.begun else None)
        unstated = is_bearing(sighting) and bool(np.all(np.isnan(sighting.std)))
        if unstated and state.begun and not sighting.time > state.time:
            raise ValueError(f"time must increase, found {sighting.time} after {state.time}")
        if not state.begun:
            self._guess.sighted(sighting, self._deviation)
        self._taken(sighting)

    def _taken(self, sighting: Sighting) -> None:
        given = sighting_for_c(sighting, self._sensors)
        if not self._c.call("take", ctypes.byref(given)):
            raise ValueError(f"measurement: found one of kind '{sighting.kind}' that leaves no track; allowed: others")

    def predict(self, times: ArrayLike) -> Forecast:
        """As :meth:`ExtendedKalmanFilter.predict`."""
        asked = np.asarray(times, dtype=float)
        d = len(self._guess.prior.start)
        mean, covariance = np.empty((len(asked), d)), np.empty((len(asked), d, d))
        for place, time in enumerate(asked):
            self._c.call("predict", ctypes.c_double(float(time)), mean[place], covariance[place])
        return Forecast(mean, covariance)


def sighting_for_c(sighting: Sighting, sensors: dict[str, int]) -> Any:
    """A measurement as the struct of C.

    Parameters
    ----------
    sighting
        The measurement.
    sensors
        Numbers of sensors by their names. One that is not among them is added; those beyond the eighth share a number.
    """
    given = _sighting_struct(sighting.position.size)(
        time=sighting.time,
        kind=KINDS_IN_C.index(sighting.kind),
        sensor=sensors.setdefault(sighting.sensor, min(len(sensors), UNLISTED - 1)),
        stated=not bool(np.all(np.isnan(sighting.std))),
    )
    given.value[: sighting.value.size] = sighting.value.tolist()
    given.std[: sighting.std.size] = np.nan_to_num(sighting.std).tolist()
    given.position[:] = sighting.position.tolist()
    return given


@cache
def _sighting_struct(d: int) -> Any:
    fields = [("time", ctypes.c_double), *((name, ctypes.c_int) for name in ("kind", "sensor", "stated"))]
    fields += [(name, ctypes.c_double * d) for name in ("value", "std", "position")]
    return type("Sighting", (ctypes.Structure,), {"_fields_": fields})


@cache
def _structure(d: int, sized: bool) -> Any:
    """The struct of C: the beginning of a filter."""
    number, whole, n = ctypes.c_double, ctypes.c_int, 2 * d + sized
    gaps = [(name, number) for name in ("span", "measurements", "unknown", "began", "latest")]
    state = [("count", whole), *gaps, ("taken", whole), ("_fill", whole), ("begun", whole), ("time", number)]
    state += [("known", whole), ("start", number * d), ("mean", number * n), ("covariance", number * (n * n))]
    return type("State", (ctypes.Structure,), {"_fields_": state})
