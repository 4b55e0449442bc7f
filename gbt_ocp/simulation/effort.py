"""What a run costs: energy, and how often the thrusters turn round."""

from __future__ import annotations

from typing import Any

import numpy as np

from gbt_ocp.simulation.history import History

IDLE = 0.01
"""Thrust over the largest of its axis in the run below which its sign does not count."""


def effort_numbers(history: History, period: float, hotel_w: float = 0.0) -> dict[str, Any]:
    """Energy and reversals of thrust, ``None`` where the inputs are no forces or the vehicle is placed.

    Parameters
    ----------
    history
        The run.
    period
        Sampling period T, s.
    hotel_w
        Power in W that the vehicle takes besides its thrusters.

    Returns
    -------
    ``energy_j``, ``power_mean_w`` and ``thrust_reversals_per_min``, the last the sum over the axes.
    """
    power, thrust = history.power[:-1], history.thrust[:-1]
    time = period * len(power)
    known = len(power) > 0 and bool(np.isfinite(power).all())
    mean = float(power.mean()) + hotel_w if known else None
    reversals = sum(_reversals(axis) for axis in thrust.T) if np.isfinite(thrust).all() and time > 0.0 else None
    return {
        "energy_j": None if mean is None else mean * time,
        "power_mean_w": mean,
        "thrust_reversals_per_min": None if reversals is None else reversals / time * 60.0,
    }


def _reversals(thrust: np.ndarray) -> int:
    """Changes of sign of the thrust of one axis ``(K,)``, those about zero left out."""
    signs = np.sign(thrust[np.abs(thrust) > IDLE * np.max(np.abs(thrust), initial=0.0)])
    return int(np.count_nonzero(np.diff(signs)))
