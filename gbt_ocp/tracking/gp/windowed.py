"""What the Gaussian-process trackers share (algorithm 1): the window, the prior mean, the prior position."""

from __future__ import annotations

from abc import abstractmethod
from typing import Generic, Literal

import numpy as np
from numpy.typing import ArrayLike

from gbt_ocp.models.measurements import MeasurementKind
from gbt_ocp.tracking.gaps import Gaps, RestartingTracker
from gbt_ocp.tracking.gp.breaks import Break, BreakWatch
from gbt_ocp.tracking.gp.posterior import AnyPosterior
from gbt_ocp.tracking.polar import BEARINGS
from gbt_ocp.tracking.priors import PositionPrior
from gbt_ocp.tracking.protocol import Forecast, JointForecast
from gbt_ocp.tracking.window import Measurements, Window
from gbt_ocp.typing import Array


class WindowedTracker(RestartingTracker, Generic[AnyPosterior]):
    """Conditions a process on the bearings of a window, after tuning its hyperparameters on them.

    What the process is, a subclass says by :meth:`_tune` and :meth:`_conditioned`. Missed and irregular samples need no
    special case.

    Parameters
    ----------
    dimension
        d.
    window
        N_c, capacity of the window.
    centre
        Prior mean: the earth-fixed ``origin`` as in the paper, or the ``vehicle``'s latest position.
    prior
        What is known of the position when the first bearing is taken; by default nothing, with the vehicle at the
        origin. It counts as a measurement for as long as that bearing is in the window.
    breaks
        Whether the window is cut where the motion breaks (see :mod:`~gbt_ocp.tracking.gp.breaks`). The position at the
        break then takes the place of the prior's.

    Attributes
    ----------
    nugget_retries
        How often the nugget had to be multiplied by ten before a factorisation succeeded.

    Raises
    ------
    ValueError
        If a parameter is out of range.
    """

    takes: tuple[MeasurementKind, ...] = BEARINGS
    """Kinds of measurements that it takes."""

    def __init__(
        self,
        dimension: int,
        *,
        window: int = 20,
        centre: Literal["origin", "vehicle"] = "vehicle",
        prior: PositionPrior | None = None,
        breaks: bool = False,
    ) -> None:
        self.dimension = dimension
        self._breaks = breaks
        self._capacity = window
        self._centre_on_vehicle = centre == "vehicle"
        self.nugget_retries = 0
        self._gaps = Gaps(bearings=window)
        self._begin(PositionPrior(np.zeros(dimension)) if prior is None else prior)

    def _begin(self, prior: PositionPrior) -> None:
        self.window = Window(self._capacity)
        self._watch = BreakWatch()
        self._waits = False
        self._prior = prior
        self._prior_rows = _rows_of(prior)
        self._centre = np.zeros(self.dimension)
        if self._centre_on_vehicle or prior.known is not None:
            self._centre = prior.unseen
        self._prior_time: float | None = None
        self._posterior: AnyPosterior | None = None
        self._forget_tuning()

    def _restart(self, own: Array) -> None:
        self._begin(self._prior.elsewhere(own))

    @abstractmethod
    def _forget_tuning(self) -> None:
        """Have the search for θ begin where it begins for the first bearing."""

    @abstractmethod
    def _tune(self, measurements: Measurements) -> None:
        """Choose θ for the measurements."""

    @abstractmethod
    def _conditioned(self, measurements: Measurements) -> tuple[AnyPosterior, int]:
        """The posterior under θ, and how often the nugget had to be raised for it."""

    def _measurements(self) -> Measurements:
        """Rows of the window, with those of the prior position while its time is in it."""
        if not len(self.window):
            rows = Measurements(np.zeros(0), np.zeros((0, self.dimension)), np.zeros(0), np.zeros(0))
        else:
            rows = self.window.measurements()
        prior = self._prior_rows
        if prior is None or not self._prior_in_window():
            return rows
        return Measurements(
            np.concatenate([rows.times, prior.times + (self._prior_time or 0.0)]),
            np.concatenate([rows.directions, prior.directions]),
            np.concatenate([rows.values, prior.values]),
            np.concatenate([rows.variances, prior.variances]),
        )

    def _prior_in_window(self) -> bool:
        """Whether the first bearing, to which the prior position belongs, is still in the window."""
        return self._prior_time is None or bool(self.window.times[0] <= self._prior_time)

    def update(self, time: float, bearing: ArrayLike, own_position: ArrayLike) -> None:
        """Take in a bearing ``(d,)`` measured at ``own_position`` ``(d,)``, tune θ and condition on the window.

        Raises
        ------
        ValueError
            If numbers are not finite, the bearing is no unit vector, or time does not increase; the tracker is then
            unchanged.
        """
        b, own = self.window.checked(time, bearing, own_position)
        if self._gaps.ended(float(time)):
            self._restart(own)
        elif self._breaks and self._prior_time is not None:
            suspected = self._waits
            found, self._waits = self._judged(float(time), b, own)
            if found is not None:
                self._cut(found)
            elif suspected:
                self.window.leave_out_latest()  # a stray
        self.window.keep(time, b, own)
        if self._waits:
            return  # until the next bearing says whether this one is a stray, the old motion is the better guess
        if self._prior_time is None:
            self._prior_time = float(time)
        if self._prior.mean is not None and self._prior_in_window():
            self._centre = self._prior.mean
        elif self._centre_on_vehicle:
            self._centre = own
        else:
            self._centre = np.zeros(self.dimension)
        self._fit()

    def _fit(self) -> None:
        """Choose θ for the window, and condition on it."""
        measurements = self._measurements()
        self._tune(measurements)
        self._condition(measurements)

    def _judged(self, time: float, bearing: Array, own: Array) -> tuple[Break | None, bool]:
        """The break before the last bearing, if there is one, and whether this bearing waits for the next one."""
        found = self._watch.judge(self.posterior, time, bearing, own)
        return found, self._watch.suspects

    def _cut(self, found: Break) -> None:
        """Keep the latest bearing, the first after a break, and where the target was then."""
        latest, own = self.window.latest, self.window.latest[2]
        self.window = Window(self._capacity)
        self.window.append(*latest)
        self._prior = PositionPrior(own, found.mean, found.std**2 * np.eye(self.dimension))
        self._prior_rows = _rows_of(self._prior)
        self._prior_time = latest[0]
        self._forget_tuning()

    def _condition(self, measurements: Measurements) -> AnyPosterior:
        self._posterior, retries = self._conditioned(measurements)
        self.nugget_retries += retries
        return self._posterior

    @property
    def posterior(self) -> AnyPosterior:
        """The posterior given the window; before the first bearing, the prior."""
        return self._posterior if self._posterior is not None else self._condition(self._measurements())

    def predict(self, times: ArrayLike) -> Forecast:
        """Posterior mean ``(K, d)`` and covariance ``(K, d, d)`` at the times ``(K,)`` in seconds."""
        return self.posterior.predict(np.asarray(times, dtype=float))

    @property
    def prior_covariance(self) -> Array:
        """Prior covariance of the position at any time under θ ``(d, d)`` in m²."""
        return self.posterior.prior_covariance

    def joint(self, times: ArrayLike) -> JointForecast:
        """Posterior covariance of the positions at the times ``(K,)`` with each other, and the nugget's variance."""
        t = np.asarray(times, dtype=float)
        return JointForecast(self.posterior.joint_covariance(t), self.posterior.noise, 0.0)


def _rows_of(prior: PositionPrior) -> Measurements | None:
    """The known position as measurements at time zero."""
    if prior.known is None:
        return None
    position, covariance = prior.known
    values, axes = np.linalg.eigh(covariance)
    # along its own axes the covariance is diagonal, one row each
    return Measurements(np.zeros(len(values)), axes.T, axes.T @ position, values)
