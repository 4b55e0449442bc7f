"""The online loop (algorithm 2): measurements and the own state in, a forecast and a decision out.

It knows no world. A simulation gives it a target and a vehicle that moves; :class:`gbt_ocp.Pilot` gives it what any
other simulator, a vehicle or a log delivers.
"""

from __future__ import annotations

from dataclasses import dataclass
from time import perf_counter

import numpy as np

from gbt_ocp.guidance.strategy import BearingGuidance, Guidance, Placement
from gbt_ocp.guidance.water import InWater
from gbt_ocp.models.measurements import Sighting
from gbt_ocp.ocp.plan import Plan, ShootingPlan
from gbt_ocp.tracking.gaps import new_tracks
from gbt_ocp.tracking.intake import take_in
from gbt_ocp.tracking.polar import bearing_of
from gbt_ocp.tracking.protocol import Forecast, PositionTracker, Tracker
from gbt_ocp.typing import Array


@dataclass(frozen=True)
class Decided:
    """What one step of the online loop gave.

    Attributes
    ----------
    time
        t_k in seconds.
    times
        T_k = {t_k, …, t_{k+n}} in seconds ``(n+1,)``.
    forecast
        Posterior at T_k as the tracker gave it.
    held
        Whether that was not finite, so that the guidance was given the last finite one in its place.
    decision
        What the guidance answered.
    tracker_time
        Time in seconds that updates since the last step and the prediction took.
    """

    time: float
    times: Array
    forecast: Forecast
    held: bool
    decision: Plan | ShootingPlan | Placement | Array
    tracker_time: float

    @property
    def plan(self) -> Plan | ShootingPlan | None:
        """The plan, if the guidance made one."""
        return self.decision if isinstance(self.decision, Plan | ShootingPlan) else None


class OnlineLoop:
    """Tracker, guidance and planner, step by step.

    A forecast that is not finite is handed out as it is, but the guidance is given the last finite one in its place, a
    period further on; without any, the vehicle's own position.

    Parameters
    ----------
    tracker
        Takes the measurements.
    guidance
        Decides how the vehicle moves.
    forecast
        n, positions predicted ahead.
    forecast_period
        Seconds between them.

    Attributes
    ----------
    begun
        Times in seconds of the measurements with which the tracker began a new track after a long gap.
    held
        Steps in which the forecast was not finite.
    learns
        Whether the guidance learns the current from how the vehicle moves.
    """

    def __init__(
        self, tracker: Tracker | PositionTracker, guidance: Guidance, *, forecast: int, forecast_period: float
    ) -> None:
        self.tracker = tracker
        self.guidance = guidance
        self.begun: list[float] = []
        self.held = 0
        self._ahead = forecast_period * np.arange(forecast + 1)
        # isinstance with a protocol takes as long as a step of a cheap tracker, so it is asked once
        self._sees = guidance if isinstance(guidance, BearingGuidance) else None
        self.learns = isinstance(guidance, InWater)
        self._seen: Array | None = None
        self._usable: Forecast | None = None
        self._spent = 0.0

    def take(self, sighting: Sighting, bearing: Array | None = None) -> bool:
        """Give the tracker a measurement.

        Parameters
        ----------
        sighting
            Placed in the earth frame.
        bearing
            Unit vector ``(d,)`` that a guidance which steers by bearings sees of it; by default the sighting's own. It
            does not see what another vehicle measured.

        Returns
        -------
        Whether the tracker took it. One that refuses is unchanged.
        """
        began = perf_counter()
        try:
            take_in(self.tracker, sighting)
        except ValueError:  # refused, by the protocol of trackers
            return False
        finally:
            self._spent += perf_counter() - began
        if self._sees is not None and not sighting.platform:
            direction = bearing_of(sighting) if bearing is None else bearing
            self._seen = self._seen if direction is None else direction
        count = new_tracks(self.tracker)
        if count != len(self.begun):  # fewer where a tracker was set back for a measurement that came late
            self.begun = [*self.begun[: count - 1], sighting.time] if count > len(self.begun) else self.begun[:count]
        return True

    def decide(self, time: float, flat: Array) -> Decided:
        """Predict, and decide how the vehicle moves from ``time`` on.

        Parameters
        ----------
        time
            t_k in seconds.
        flat
            Derivatives 0 … L-1 of the flat output now ``(L, n)``, L at least 2.
        """
        times = np.asarray(time + self._ahead, dtype=float)
        began = perf_counter()
        forecast = self.tracker.predict(times)
        spent, self._spent = self._spent + perf_counter() - began, 0.0
        finite = _is_finite(forecast)
        self.held += not finite
        self._usable = forecast if finite else self._last_finite(flat[0, : forecast.mean.shape[1]])
        if self._sees is not None:
            self._sees.see(self._seen)
        self._seen = None
        decision = self.guidance.decide(time, flat, self._usable)
        return Decided(time, times, forecast, not finite, decision, spent)

    def learn(self, before: Array, after: Array, thrust: Array | None, duration: float) -> None:
        """Learn the current from how the vehicle moved: see :meth:`gbt_ocp.guidance.current.Current.observe`.

        Nothing is learnt where the guidance plans for still water, or the thrust is not known.
        """
        if thrust is not None and isinstance(self.guidance, InWater):
            self.guidance.current.observe(before, after, thrust, duration)

    def _last_finite(self, own: Array) -> Forecast:
        """The last usable forecast a period further on; without any, the vehicle's own position."""
        if self._usable is None:
            count = len(self._ahead)
            return Forecast(np.tile(own, (count, 1)), np.full((count, own.size, own.size), np.nan))
        return Forecast(*(np.concatenate([moments[1:], moments[-1:]]) for moments in self._usable))


def _is_finite(forecast: Forecast) -> bool:
    """Whether a plan can be made for it. A covariance of NaN means that the tracker has none."""
    return bool(np.all(np.isfinite(forecast.mean)) and not np.any(np.isinf(forecast.covariance)))
