"""Tracker of noisy bearings with a Gaussian process on the shape of the motion, for ranges that may not be observable.

Every estimate starts from the last one, seen from the new now, and competes with starts at several ranges. What remains
is a mixture: the distinct motions that fit (near and far), each averaged over the grid of hyperparameters, weighed by
Laplace's approximation of the evidence.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from gbt_ocp.models.measurements import MeasurementKind, Sighting
from gbt_ocp.tracking.bins import BearingBins, BinnedBearings
from gbt_ocp.tracking.decomposed import BY_ITSELF, SightingParts, SingleNumbers, parts_of
from gbt_ocp.tracking.gaps import Gaps
from gbt_ocp.tracking.noise import BearingNoise
from gbt_ocp.tracking.polar import ALL_KINDS, WITHOUT_SIZE, checked_sighting
from gbt_ocp.tracking.priors import LogNormal, PositionPrior
from gbt_ocp.tracking.shape.fit import Known, Sightings, fit, sightings_root
from gbt_ocp.tracking.shape.further import further_sightings
from gbt_ocp.tracking.shape.gate import gated
from gbt_ocp.tracking.shape.hypotheses import MotionHypotheses, cold_starts, competed
from gbt_ocp.tracking.shape.memory import TrackMemory, precision_root
from gbt_ocp.tracking.shape.moments import moments_now
from gbt_ocp.tracking.shape.motions import Motions, MotionShape
from gbt_ocp.tracking.shape.outlook import MotionOutlook
from gbt_ocp.tracking.shape.processes import ShapePrior
from gbt_ocp.typing import Array

RECENT_BINS = 8
"""Bins over which the reset test looks."""

LOST_RESIDUAL = 6.0
"""Mean squared standardised residual of the recent bins above which a track counts as lost."""


class MotionSettings(NamedTuple):
    """What a :class:`MotionShapeTracker` was made with, beside its bins."""

    shape: MotionShape
    noise: BearingNoise
    update: float
    starts: Array
    hypotheses: int
    memory: float
    iterations: int
    gate: float
    size: LogNormal | None
    position: PositionPrior


class MotionShapeTracker(MotionOutlook):
    """Tracks a target by the shape of its motion; see :mod:`~gbt_ocp.tracking.shape.motions`.

    Parameters
    ----------
    dimension
        d.
    noise
        Of the sensor.
    prior
        Of the motion.
    bin_width, window
        Width of a bin and age of the oldest, in seconds.
    update
        Least time between two estimates in seconds; in between, the last one is predicted.
    knot
        Time between the knots of the processes in seconds; by default two bins.
    starts
        Ranges in metres at which a track is begun; by default four around the prior's median.
    hypotheses
        Largest number of distinct motions kept.
    memory
        Factor on the deviations of the position and velocity that are remembered from before the window (see
        :class:`~gbt_ocp.tracking.shape.memory.TrackMemory`). Infinity remembers nothing.
    iterations
        Largest number of Gauss-Newton steps of an estimate that starts from the last one.
    gate
        Standardised residual from which a bearing counts as a stray one (see
        :class:`~gbt_ocp.tracking.bins.BearingBins`); infinity trusts all of them.
    position
        What is known of the position at the first bearing; by default nothing, with the vehicle at the origin.
    size
        The true size of the target in metres, if angular sizes are measured.
    reach
        How far ahead of an estimate motions are computed, in seconds, before they are extrapolated; ``None`` for
        :data:`~gbt_ocp.tracking.shape.motions.AHEAD` windows.

    Attributes
    ----------
    bins
        The bearings of the window.
    restarts
        How often the track was lost and begun again.
    settings
        What it was made with.
    takes
        Kinds of measurements that :meth:`take` takes.

    Raises
    ------
    ValueError
        If a parameter is out of range.
    """

    def __init__(
        self,
        dimension: int,
        *,
        noise: BearingNoise,
        prior: ShapePrior | None = None,
        bin_width: float = 1.5,
        window: float = 60.0,
        update: float = 1.0,
        knot: float | None = None,
        starts: Sequence[float] | None = None,
        hypotheses: int = 3,
        memory: float = np.inf,
        iterations: int = 3,
        gate: float = np.inf,
        position: PositionPrior | None = None,
        size: LogNormal | None = None,
        reach: float | None = None,
    ) -> None:
        if not (update >= 0.0 and hypotheses >= 1 and iterations >= 1 and gate > 0.0 and memory > 0.0):
            raise ValueError(
                "update must be >= 0, hypotheses and iterations >= 1, memory and gate > 0; "
                f"found {update}, {hypotheses}, {iterations}, {memory}, {gate}"
            )
        self.dimension = dimension
        # the lasting part of the error is the same all over a bin
        self.bins = BearingBins(bin_width, window, gate * noise.std)
        self._prior = prior if prior is not None else ShapePrior()
        # what is remembered may be older than the oldest bin by two updates and the time between two nodes
        knot = knot or 2.0 * bin_width
        span = window + bin_width + (2.0 * update + knot if np.isfinite(memory) else 0.0)
        self._shape = MotionShape(dimension, self._prior, span=span, knot=knot, reach=reach)
        self._noise = noise
        self._update = update
        p = self._prior.range
        self._starts = np.array(starts if starts else p.median * np.exp(p.log_std * np.array([-1.2, -0.3, 0.6, 1.5])))
        self._most = hypotheses
        self._iterations = iterations
        self._gate = gate
        self._remembers = np.isfinite(memory)
        self._memory = TrackMemory(memory, span)
        position = PositionPrior(np.zeros(dimension)) if position is None else position
        self.settings = MotionSettings(
            self._shape, noise, update, self._starts, hypotheses, memory, iterations, gate, size, position
        )
        self._gaps, self._size = Gaps(span=window), size
        self._others = SingleNumbers(bin_width)
        self.takes: tuple[MeasurementKind, ...] = WITHOUT_SIZE if size is None else ALL_KINDS
        self.restarts = 0
        self._begin(position)

    def _begin(self, position: PositionPrior) -> None:
        self.bins.clear()
        self._memory.clear()
        self._others.clear()
        self._position = position
        self._own = position.start
        self._first: float | None = None
        self._now = np.nan
        self._found = self._ahead = self._behind = None
        self._reach = self._asked = 0.0
        self._estimates = self._unfit = 0
        self._open, self._news = True, False

    def _restart(self, own: Array) -> None:
        self._begin(self._position.elsewhere(own))

    def update(self, time: float, bearing: ArrayLike, own_position: ArrayLike) -> None:
        """Take in a bearing ``(d,)`` measured at ``own_position`` ``(d,)``; estimate again when it is time.

        Raises
        ------
        ValueError
            If numbers are not finite, the bearing is no unit vector, or time does not increase; the tracker is then
            unchanged.
        """
        self._seen(float(time), *self.bins.checked(float(time), bearing, own_position))

    def take(self, sighting: Sighting) -> None:
        """Take in a measurement of any kind in :attr:`takes`, with its own noise, at or after the latest time.

        Measurements that are no bearings count from the first bearing of the window on.

        Raises
        ------
        ValueError
            If the kind is not taken or the measurement is out of order; the tracker is then unchanged.
        """
        times = [self.bins.latest, self._others.latest]
        latest = max([time for time in times if time is not None], default=None)
        checked_sighting(sighting, self.takes, "motion_gp", self.dimension, latest)
        parts = parts_of(sighting, self._noise.std)
        if parts.bearing is not None:
            self._seen(sighting.time, parts.bearing, sighting.position, parts)
            return
        self._others.extend(parts.singles)
        if self._found is not None and sighting.time - self._now >= self._update - 1e-9:
            self._estimate(sighting.time, sighting.position)

    def _seen(self, time: float, bearing: Array, own: Array, parts: SightingParts = BY_ITSELF) -> None:
        """Take in a bearing with its own noise, and what came with it."""
        if self._gaps.ended(time):
            self._restart(own)
        self._others.extend(parts.singles)
        weight, platform = parts.worth(self._noise.std), parts.platform
        expected, suspect = self._expected(time, bearing, own, weight)
        self.bins.append(
            time, bearing, own, expected=expected, suspect=suspect, weight=weight, same_time=True, platform=platform
        )
        self._others.forget_before(self.bins.begins)
        if self._first is None:
            self._first = time
        # coordinates are those seen from the own vehicle: what another one saw waits for the next own bearing, and for
        # the next estimate where the range is known
        self._news = self._news or (bool(platform) and self._open)
        if self._found is None or (not platform and (self._news or time - self._now >= self._update - 1e-9)):
            self._estimate(time, own)

    def _expected(self, time: float, bearing: Array, own: Array, weight: float) -> tuple[Array | None, bool]:
        """Direction in which the target is expected ``(d,)``, and whether a bearing lies beyond the gate from it."""
        if self._found is None or not np.isfinite(self._gate):
            return None, False
        return gated(self.predict([time]), bearing, own, self._noise, weight, self._gate)

    def _estimate(self, now: float, own: Array) -> None:
        means, found, self._news = self.bins.means(), self._found, False
        if found is not None:
            motions = self._shape.advanced(found.fit.motions, now - self._now, own - self._own)
            self._now, self._own = now, own
            fitted = fit(self._shape, motions, self._sightings(means, motions), self._iterations)
            found = replace(found, fit=fitted)
        self._now, self._own = now, own
        self._ahead = self._behind = None
        self._reach, self._asked = self._asked, 0.0
        self._estimates += 1
        # at every estimate while it is open where the target is, now and then afterwards
        if found is None or self._unfit or self._estimates % 5 == 0 or self._open:
            cold = cold_starts(self._shape, self._starts, means.own, now, own)

            def sight(motions: Motions) -> Sightings:
                return self._sightings(means, motions)

            found = competed(self._shape, found, cold, sight, self._most, self._iterations)
        self._found = found.distinct(self._most)
        self._open = not self.range_observable
        if not self._open and self._remembers:
            times, mean, covariance = moments_now(self._shape, *self._found.likely)
            self._memory.keep(now, now + times, own + mean, covariance)
        self._check(self._found)

    def _sightings(self, means: BinnedBearings, motions: Motions) -> Sightings:
        times, own = means.times - self._now, means.own_positions - self._own
        n = self._noise
        if n.own_std > 0.0:
            nodes = self._shape.past(motions)
            ranges = np.linalg.norm(self._shape.at(times) @ nodes.positions - own, axis=-1)
        else:
            ranges = np.ones((1, len(times)))
        covariance = n.covariance(means, np.maximum(ranges, 1e-2), n.white_variance(self.bins))
        root, log_determinant = sightings_root(covariance, n.correlated_std == 0.0)
        known = self._memory.recall(self.bins.begins, self._now)
        assert self._first is not None, "there is a bearing"
        if known is None and self._position.known is not None and means.times[0] <= self._first + self.bins.width:
            position, spread = self._position.known
            known = Known(np.array([self._first]), position[None], precision_root(spread))
        seen = None if known is None else known.seen_from(self._now, self._own)
        others = [one for one in self._others if one.time <= self._now]
        further = further_sightings(others, self._size, self._now, self._own)
        return Sightings(times, means.bearings, own, root, log_determinant, seen, further)

    def _check(self, found: MotionHypotheses) -> None:
        """Reset test: bearings that no motion of the prior explains mean that the track is lost."""
        recent = found.fit.residuals[int(np.argmax(found.fit.log_evidence)), -RECENT_BINS:]
        self._unfit = self._unfit + 1 if np.mean(recent**2) > LOST_RESIDUAL else 0
        if self._unfit >= 3:
            self.restarts += 1
            self._unfit = 0
            self._found = None
            self._memory.clear()
            self.bins.forget_before(self._now - 0.4 * self.bins.window)
            self._estimate(self._now, self._own)
