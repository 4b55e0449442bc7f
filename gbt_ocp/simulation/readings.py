"""What an array of a history reads of a step, and what its tables read of an array."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from gbt_ocp.models.bearings import cumulative_bearing_matrix
from gbt_ocp.models.fossen import FossenVehicle
from gbt_ocp.ocp.plan import Plan, ShootingPlan
from gbt_ocp.simulation.step import Step
from gbt_ocp.tracking.protocol import GaussianProcess
from gbt_ocp.typing import Array


def planned(read: Callable[[Plan | ShootingPlan], Any], otherwise: Any = np.nan) -> Callable[[Step], Any]:
    """Read something of the plan; ``otherwise`` where nothing was planned."""
    return lambda step: otherwise if step.plan is None else read(step.plan)


def tuned(read: Callable[[GaussianProcess], float]) -> Callable[[Step], Any]:
    """Read something of a tracker that has hyperparameters; NaN from any other."""
    return lambda step: np.nan if step.process is None else read(step.process)


def prior_covariance(step: Step) -> Array:
    """Prior covariance ``(d, d)`` under the hyperparameters; NaN from a tracker without."""
    d = step.target.shape[1]
    return np.full((d, d), np.nan) if step.process is None else step.process.prior_covariance


def bound(step: Step) -> Array:
    """The theorem's bound ``(n+1,)``; NaN from a tracker without one."""
    if step.process is None:
        return np.full(len(step.times), np.nan)
    return step.process.bound(step.times, step.bound_delta)


def bearing(step: Step) -> Array:
    """The measured bearing ``(d,)``; NaN where it was missed."""
    return np.full(step.target.shape[1], np.nan) if step.bearing is None else step.bearing


def bearing_matrix(step: Step) -> Array:
    """Cumulative bearing matrix of the window ``(d, d)``, zero without any bearing."""
    return cumulative_bearing_matrix(step.window) if step.window else np.zeros((step.target.shape[1],) * 2)


def planned_poses(step: Step) -> ArrayLike:
    """The ends of the pieces as poses: the flat output of a vehicle need not be one."""
    if step.plan is None:
        return np.zeros((0, step.vehicle.position_dimension + 1))
    ends = step.plan.knots[1:]
    if type(step.vehicle) is FossenVehicle:
        return ends[:, 0]  # the same, without a state for each
    return [step.vehicle.pose(step.vehicle.state(end[0], end[1])) for end in ends]


def unknown_axes(step: Step) -> Array:
    """NaN for each axis ``(d,)``."""
    return np.full(step.target.shape[1], np.nan)


def same(values: Array) -> Array:
    """The array itself."""
    return values


def now(ahead: Array) -> Array:
    """What stands at t_k of what stands at T_k."""
    return np.asarray(ahead[:, 0])


def mean_ahead(ahead: Array) -> Array:
    """The mean over T_k."""
    return np.asarray(ahead.mean(axis=1))


def std_now(covariance: Array) -> Array:
    """Standard deviations at t_k from covariances at T_k."""
    return np.asarray(np.sqrt(np.maximum(np.diagonal(covariance[:, 0], axis1=1, axis2=2), 0.0)))
