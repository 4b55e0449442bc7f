"""The tracker by the shape of the motion that generated pilots have, in the place of the one in numpy."""

from __future__ import annotations

import ctypes
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from gbt_ocp.models.measurements import Sighting
from gbt_ocp.pilot.compiled_ekf import sighting_for_c
from gbt_ocp.pilot.pilot_source import UNLISTED
from gbt_ocp.pilot.state_in_c import StateInC
from gbt_ocp.pilot.tracker_source import tracker_in_c
from gbt_ocp.tracking.polar import checked_sighting
from gbt_ocp.tracking.protocol import Forecast, WeighedForecasts
from gbt_ocp.tracking.shape.hypotheses import MotionHypothesis
from gbt_ocp.tracking.shape.moments import motion_covariance
from gbt_ocp.tracking.shape.processes import SLOWER
from gbt_ocp.tracking.shape.tracker import MotionShapeTracker
from gbt_ocp.tracking.window import checked_sample
from gbt_ocp.typing import Array

STALE = 4.0
"""Updates by which an estimate may be old before forecasts of a whole horizon from now are extrapolated."""


class CompiledMotionTracker(MotionShapeTracker):
    """:class:`~gbt_ocp.tracking.shape.tracker.MotionShapeTracker` whose numbers are those of the C of a pilot.

    The library is compiled once and kept in the user's cache. Sensors have numbers in the order in which they come, of
    which there are eight; those beyond share the last. Of the past, positions are known as far back as one bin before
    the latest estimate; those before are held.

    Parameters
    ----------
    dimension, keys
        As for the tracker in numpy.
    horizon
        How far ahead of now forecasts are asked for, in seconds; with it ``reach`` is so far and :data:`STALE` updates.

    Raises
    ------
    ValueError
        If a parameter is out of range.
    gbt_ocp.ocp.codegen.library.CompilerError
        If there is no working C compiler.
    """

    takes_unstated = True

    def __init__(self, dimension: int, *, horizon: float | None = None, update: float = 1.0, **keys: Any) -> None:
        self._c: StateInC | None = None
        if horizon is not None:
            keys["reach"] = horizon + STALE * update
        super().__init__(dimension, update=update, **keys)
        made = tracker_in_c(self)
        nodes = 2 * SLOWER * self._shape.knots[3] + 1
        self._struct = _latest(dimension, nodes, made.sizes["HYPOTHESES"])
        self._c = StateInC(made, dimension, UNLISTED, ("begin", "predict", "believe"), works=True)
        self._sensors: dict[str, int] = {}
        self._c.call("begin", np.array(self._position.start, dtype=float))

    @property
    def _latest(self) -> Any:
        """The beginning of the state as the struct of C."""
        return self._struct.from_buffer(self._in_c.state)

    @property
    def _in_c(self) -> StateInC:
        assert self._c is not None, "made by the constructor"
        return self._c

    @property
    def new_tracks(self) -> int:
        """How often a gap of more than ten windows has ended and a new track has begun."""
        return int(self._latest.gaps.count) if self._c is not None else 0

    def update(self, time: float, bearing: ArrayLike, own_position: ArrayLike) -> None:
        """As :meth:`MotionShapeTracker.update`."""
        latest = self._latest
        direction, own = checked_sample(time, bearing, own_position, latest.bearing_at if latest.seen else None)
        self._taken(Sighting.of_bearing(float(time), direction, own))

    @property
    def restarts(self) -> int:
        """How often the track was lost and begun again."""
        return int(self._latest.restarts) if self._c is not None else 0

    @restarts.setter
    def restarts(self, value: int) -> None:
        """Set by the constructor alone."""

    def take(self, sighting: Sighting) -> None:
        """As :meth:`MotionShapeTracker.take`; a bearing without a deviation as :meth:`update`."""
        checked_sighting(sighting, self.takes, "motion_gp", self.dimension, None)
        self._taken(sighting)

    def _taken(self, sighting: Sighting) -> None:
        given = sighting_for_c(sighting, self._sensors)
        if not self._in_c.call_working("take", ctypes.byref(given)):
            raise ValueError(
                f"time: found {sighting.time}, which is before the latest measurement, or one of more than a bin can "
                "hold; allowed: times that do not decrease"
            )

    @property
    def estimated_at(self) -> float:
        """As :attr:`MotionShapeTracker.estimated_at`."""
        latest = self._latest
        return float(latest.now) if latest.found else float("nan")

    @property
    def log_evidence(self) -> float:
        """As :attr:`MotionShapeTracker.log_evidence`."""
        return float(self._latest.log_evidence)

    @property
    def hypotheses(self) -> list[MotionHypothesis]:
        """As :attr:`MotionShapeTracker.hypotheses`."""
        latest = self._latest
        found = latest.hypothesis[: latest.hypotheses] if latest.found else []
        return sorted(
            (MotionHypothesis(one.share, float(np.exp(one.log_range)), one.log_range_std) for one in found),
            reverse=True,
        )

    @property
    def range_std_over_range(self) -> float:
        """As :attr:`MotionShapeTracker.range_std_over_range`."""
        latest = self._latest
        return float(latest.relative_range_std) if latest.found else self._prior.range.log_std

    def predict(self, times: ArrayLike) -> Forecast:
        """As :meth:`MotionShapeTracker.predict`."""
        return Forecast(*self._moments("predict", np.atleast_1d(np.asarray(times, dtype=float))))

    def _moments(self, name: str, times: Array, *which: Any) -> tuple[Array, Array]:
        d = self.dimension
        mean, covariance = np.empty((len(times), d)), np.empty((len(times), d, d))
        for place, time in enumerate(times):
            self._in_c.call(name, *which, ctypes.c_double(float(time)), mean[place], covariance[place])
        return mean, covariance

    def motion_at(self, time: float) -> Array | None:
        """As :meth:`MotionShapeTracker.motion_at`."""
        latest = self._latest
        if not latest.found:
            return None
        both = 2 * self.dimension
        covariance = np.array(latest.covariance).reshape(both, both)
        return motion_covariance(self._shape.past_nodes[:2], covariance, time - latest.now)

    def hypotheses_at(self, times: ArrayLike) -> WeighedForecasts:
        """As :meth:`MotionShapeTracker.hypotheses_at`."""
        t, latest = np.atleast_1d(np.asarray(times, dtype=float)), self._latest
        if not latest.found:
            return WeighedForecasts(np.ones(1), *(values[None] for values in self._moments("predict", t)))
        parts = [self._moments("believe", t, ctypes.c_int(one)) for one in range(latest.likely)]
        means, covariances = (np.array(values) for values in zip(*parts, strict=True))
        weights = np.array([latest.hypothesis[one].weight for one in range(latest.likely)])
        return WeighedForecasts(weights, means, covariances)


@cache
def _latest(d: int, nodes: int, hypotheses: int) -> Any:
    """The struct of C as far as it is read."""
    number, whole = ctypes.c_double, ctypes.c_int

    def struct(*fields: tuple[str, Any]) -> Any:
        return type("Struct", (ctypes.Structure,), {"_fields_": list(fields)})

    def each(kind: Any, *names: str) -> list[tuple[str, Any]]:
        return [(name, kind) for name in names]

    hypothesis = struct(
        *each(number, "weight", "share", "log_range", "log_range_std"),
        ("mean", number * (nodes * d)),
        ("spread", number * (nodes * d * d)),
    )
    gaps = struct(("count", whole), *each(number, "span", "bearings", "unknown", "began", "latest"), ("taken", whole))
    return struct(
        *each(number, "now", "first", "bearing_at", "log_evidence", "relative_range_std"),
        ("own", number * d),
        ("position", number * (2 * d)),
        ("covariance", number * (4 * d * d)),
        *each(whole, "known", "seen", "found", "open", "estimates", "unfit", "restarts", "hypotheses", "likely"),
        ("gaps", gaps),
        ("hypothesis", hypothesis * hypotheses),
    )
