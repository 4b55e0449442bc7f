"""How a vehicle was steered: its least speed ahead through the water, and its tightest turn."""

from __future__ import annotations

from typing import Any

import numpy as np

from gbt_ocp.simulation.history import History

STRAIGHT_RATE = 1.0e-3
"""Yaw rate in rad/s below which a vehicle goes straight on."""


def steering_numbers(history: History) -> dict[str, Any]:
    """``speed_ahead_min`` in m/s and ``turn_radius_min_m``, over all samples.

    The radius is the speed ahead over the yaw rate, ``None`` where the vehicle never turns.
    """
    d, yaw = history.dimension, history.vehicle_pose[:, history.dimension]
    water = np.nan_to_num(history.current, nan=0.0)  # NaN where it stands still
    ahead = history.vehicle_velocity[:, 0] - (np.cos(yaw) * water[:, 0] + np.sin(yaw) * water[:, 1])
    rate = np.abs(history.vehicle_velocity[:, d])
    turns = rate > STRAIGHT_RATE
    radius = float(np.min(ahead[turns] / rate[turns])) if np.any(turns) else None
    return {"speed_ahead_min": float(np.min(ahead)), "turn_radius_min_m": radius}
