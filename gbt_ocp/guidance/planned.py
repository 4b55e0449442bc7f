"""The planner as an observer strategy: trajectory optimisation over the forecast (algorithm 2)."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from gbt_ocp.guidance.others import OtherVehicles
from gbt_ocp.guidance.pacing import PacedBearing
from gbt_ocp.guidance.past import PastBearings
from gbt_ocp.guidance.swept import DesiredTurn, SweptBearing
from gbt_ocp.models.bearings import inner
from gbt_ocp.models.sizes import at_least
from gbt_ocp.ocp.binding import Binding
from gbt_ocp.ocp.plan import Plan, ShootingPlan
from gbt_ocp.ocp.planner import AnyPlanner
from gbt_ocp.ocp.shooting import ShootingPlanner
from gbt_ocp.tracking.path_belief import PathForecast
from gbt_ocp.tracking.protocol import Forecast, JointForecast, WeighedForecasts
from gbt_ocp.typing import Array

ON_SCHEDULE = 1.0e-6
"""Deviation in seconds up to which a step counts as one on time."""


class PlannedMotion:
    """Solves the trajectory problem whenever a piece is through, for the forecast and the desired bearings at its ends.

    With pieces of one sampling period that is at every step, as in the paper; with longer ones the plan is followed on
    in between. Steps need not come on time: the next plan is made at the one nearest to the end of a piece.

    Parameters
    ----------
    planner
        The compiled problem, or multiple shooting of it.
    desired
        λ*(t).
    steps
        Sampling periods that a piece lasts.
    stride
        Predicted positions that a piece lasts; by default as many as ``steps``.
    begin_at_sight
        Whether each plan turns its desired bearing on from the present line of sight, instead of from where the turn
        would be by the clock: a vehicle that falls behind need not catch up. Legs of a turn that reverses then begin
        with the first plan, in the sense in which the line of sight turns already.
    past
        Where bearings are kept for an objective that counts those of the window.
    joint
        What the tracker knows of the positions at the endpoints together, for an objective that needs it.
    hypotheses
        What each of the tracker's hypotheses predicts, for a limit that needs it.
    path
        What the tracker believes at a time of the positions at later times together, for an objective that needs it.
    others
        Other vehicles with the same target, whose bearings an information objective counts, and from which a limit
        keeps apart.

    Raises
    ------
    ValueError
        If ``steps`` or ``stride`` is not a whole number from 1 on.
    """

    def __init__(
        self,
        planner: AnyPlanner | ShootingPlanner,
        desired: DesiredTurn,
        steps: int = 1,
        *,
        stride: int | None = None,
        begin_at_sight: bool = False,
        past: PastBearings | None = None,
        joint: Callable[[ArrayLike], Any] | None = None,
        hypotheses: Callable[[ArrayLike], WeighedForecasts] | None = None,
        path: PathForecast | None = None,
        others: OtherVehicles | None = None,
    ) -> None:
        self.planner = planner
        self.desired = desired
        self._steps = at_least("steps", steps, 1)
        self._stride = at_least("stride", steps if stride is None else stride, 1)
        self._begin_at_sight = begin_at_sight
        self._past = past
        self._joint = joint
        self._hypotheses = hypotheses
        self._path = path
        self._others = others
        self._seen: Array | None = None
        self._plan: Plan | ShootingPlan | None = None
        self._planned_at = 0.0
        self._legs_begun = False

    @property
    def schedule(self) -> tuple[int, int, bool]:
        """Sampling periods and predicted positions that a piece lasts, and whether plans begin at the line of sight."""
        return self._steps, self._stride, self._begin_at_sight

    def see(self, bearing: Array | None) -> None:
        """Take note of the bearing ``(d,)`` measured now, before the decision."""
        self._seen = bearing

    def remember(self, time: float, flat: Array, forecast: Forecast) -> None:
        """Keep the bearing measured now, with the range at which the target is believed."""
        if self._past is not None and self._seen is not None:
            line = forecast.mean[0] - flat[0, : forecast.mean.shape[1]]
            self._past.add(time, self._seen, float(np.linalg.norm(line)))

    def restart(self) -> None:
        """Begin as at the first plan: what was planned is no longer where the vehicle is."""
        self._plan = None
        self._legs_begun = False
        self.planner.reset()

    def rehearse(self) -> None:
        """Have every term of the problem take its numbers from a forecast that is made up.

        A term that asks for something it will not be given, or gives numbers of a wrong shape, is found before a run.

        Raises
        ------
        ValueError
            As :meth:`gbt_ocp.ocp.binding.Binding.objective_parameters`.
        """
        problem = self.planner.problem
        d, p = problem.vehicle.position_dimension, problem.pieces
        times = np.arange(p * self._stride + 1)
        mean, covariance = 1.0 + 0.1 * np.outer(times, np.ones(d)), np.tile(np.eye(d), (len(times), 1, 1))
        data, binding = self._data(0.0, Forecast(mean, covariance)), Binding(problem)
        if self._joint is not None:
            data["joint"] = _nothing_seen(p, d)
        if self._path is not None:
            data["path"] = _nothing_seen(2 * p, d)
        binding.objective_parameters(data)
        binding.limit_parameters(data)

    def _data(self, time: float, forecast: Forecast) -> dict[str, Any]:
        """What a plan at a time is made from, by the names that objectives and limits know it by.

        What only the tracker can say is not there.
        """
        # an estimator without a covariance is taken at its word
        covariance = forecast.covariance
        if not np.isfinite(covariance).all():
            covariance = np.nan_to_num(covariance, nan=0.0)
        data: dict[str, Any] = {
            "forecast": Forecast(forecast.mean[self._stride :: self._stride], covariance[self._stride :: self._stride]),
            "desired": self.desired(self._ends(time)),
            "present": Forecast(forecast.mean[0], covariance[0]),
        }
        if self._past is not None:
            data["past"] = self._past.information
        if self._others is not None:
            knots = np.concatenate([[time], self._ends(time)])
            data["others"], data["apart"] = self._others.places(time, knots), self._others.apart(time, knots)
        return data

    def _ends(self, time: float) -> Array:
        """Times of the endpoints of a plan ``(p,)`` in seconds."""
        return np.asarray(time + self.planner.problem.period * np.arange(1, self.planner.problem.pieces + 1))

    def decide(self, time: float, flat: Array, forecast: Forecast) -> Plan | ShootingPlan:
        """The plan from ``time`` on."""
        self.remember(time, flat, forecast)
        problem = self.planner.problem
        elapsed, steps = self._elapsed(time)
        if self._plan is not None and steps < self._steps:
            return replace(
                self._plan,
                elapsed=elapsed,
                status="",
                fallback="",
                iterations=0,
                solve_time=0.0,
                tightened=0,
            )
        self._turn_desired(time, flat, forecast)
        data = self._data(time, forecast)
        if self._joint is not None:
            data["joint"] = self._joint(self._ends(time))
        if self._path is not None:
            data["path"] = self._path(time, self._ends(time))
        if self._hypotheses is not None:
            data["hypotheses"] = self._around(time, forecast, self._hypotheses)
        plan = self.planner.solve(_continued(flat, problem.joined), **data)
        self._plan, self._planned_at = plan, time
        return plan

    def _turn_desired(self, time: float, flat: Array, forecast: Forecast) -> None:
        """Turn the desired bearing to where a plan begins."""
        line = forecast.mean[0] - flat[0, : forecast.mean.shape[1]]
        if isinstance(self.desired, PacedBearing):
            self.desired.pace(time, math.sqrt(inner(line, line)))
        elif self._begin_at_sight:
            if not self._legs_begun:
                self._legs_begun = True
                self.desired = self.desired.reversing_from(time, line, self._relative_velocity(flat, forecast))
            if isinstance(self.desired, SweptBearing):
                knots = forecast.mean[:: self._stride][: self.planner.problem.pieces + 1]
                self.desired = self.desired.sweeping_from(time, line, knots, self.planner.problem.period)
            else:
                self.desired = self.desired.beginning_at(time, line)

    def _elapsed(self, time: float) -> tuple[float, int]:
        """Seconds since the last plan, and how many steps they are."""
        since, period = time - self._planned_at, self.planner.problem.period
        count = round(since * self._steps / period)
        on_time = count * period / self._steps  # a time k T is rounded
        return (on_time if abs(since - on_time) <= ON_SCHEDULE else since), count

    def _around(
        self, time: float, forecast: Forecast, predict: Callable[[ArrayLike], WeighedForecasts]
    ) -> WeighedForecasts:
        """The hypotheses at the knots, moved to where the forecast is: it may be in a frame of its own."""
        knots = self.planner.problem.pieces + 1
        weights, means, covariances = predict(time + self.planner.problem.period * np.arange(knots))
        moved = forecast.mean[:: self._stride][:knots] - np.einsum("m,mkd->kd", weights, means)
        return WeighedForecasts(weights, means + moved, covariances)

    def _relative_velocity(self, flat: Array, forecast: Forecast) -> Array:
        """Of the target relative to the vehicle, over the first piece ``(d,)`` in m/s."""
        moved = forecast.mean[min(self._stride, len(forecast.mean) - 1)] - forecast.mean[0]
        return np.asarray(moved / self.planner.problem.period - flat[1, : forecast.mean.shape[1]])


def _nothing_seen(times: int, dimension: int) -> JointForecast:
    """Positions at several times that have nothing to do with each other."""
    size = times * dimension
    return JointForecast(np.eye(size).reshape(times, dimension, times, dimension), 1.0, 0.0)


def _continued(flat: Array, joined: int) -> Array:
    """Derivatives 0 … joined-1 of the flat output ``(joined, n)``, with zeros for those that are not known."""
    missing = max(0, joined - len(flat))
    return np.vstack([flat[:joined], np.zeros((missing, flat.shape[1]))])
