"""Paths between the samples: pieces of a flat trajectory from the positions and velocities at their ends."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from gbt_ocp.simulation.history import History
from gbt_ocp.typing import Array

BETWEEN = 8
"""Points drawn for each sampling period."""

AGREEMENT = 0.1
"""Share of a period's way by which its ends may differ from what their velocities say; beyond it is drawn straight."""


def vehicle_path(history: History) -> Array:
    """Positions of the vehicle between the samples too ``((K - 1) BETWEEN + 1, d)``, m.

    Each period is the cubic through both positions with both velocities over ground: for the pieces of degree 2 of the
    paper, and for those of degree 3, the trajectory itself. Where positions and velocities contradict each other, as
    where a vehicle has no yaw or is put somewhere, the period is a straight line.

    Parameters
    ----------
    history
        The run; velocities are body-frame, over ground, and yaw is that of the pose.
    """
    t, position = history.t, history.vehicle_pose[:, : history.dimension]
    if len(t) < 2:
        return position
    velocity = _over_ground(history)
    steps = np.diff(t)[:, None]
    way = np.diff(position, axis=0)
    wrong = np.linalg.norm(way - 0.5 * steps * (velocity[1:] + velocity[:-1]), axis=1)
    smooth = np.asarray(wrong <= AGREEMENT * np.linalg.norm(way, axis=1))
    share = np.arange(BETWEEN) / BETWEEN
    found = position[:-1, None] + share[:, None] * way[:, None]
    known = np.asarray(np.isfinite(position).all(axis=1) & np.isfinite(velocity).all(axis=1))
    for k in np.flatnonzero(smooth & known[1:] & known[:-1]):
        ends = slice(k, k + 2)
        found[k] = CubicHermiteSpline(t[ends], position[ends], velocity[ends])(t[k] + share * steps[k])
    return np.concatenate([found.reshape(-1, history.dimension), position[-1:]])


def _over_ground(history: History) -> Array:
    """Velocities of the vehicle in the earth frame ``(K, d)``, m/s."""
    yaw = history.vehicle_pose[:, -1]
    surge, sway = history.vehicle_velocity[:, 0], history.vehicle_velocity[:, 1]
    level = [np.cos(yaw) * surge - np.sin(yaw) * sway, np.sin(yaw) * surge + np.cos(yaw) * sway]
    return np.stack([*level, *([history.vehicle_velocity[:, 2]] if history.dimension == 3 else [])], axis=-1)
