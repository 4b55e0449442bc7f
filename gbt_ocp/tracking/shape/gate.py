"""Whether a bearing lies where it was expected."""

from __future__ import annotations

import numpy as np

from gbt_ocp.models.bearings import log_map, tangent_basis
from gbt_ocp.tracking.noise import BearingNoise
from gbt_ocp.tracking.protocol import Forecast
from gbt_ocp.typing import Array


def gated(
    forecast: Forecast, bearing: Array, own: Array, noise: BearingNoise, weight: float, gate: float
) -> tuple[Array | None, bool]:
    """Direction in which the target is expected ``(d,)``, and whether a bearing lies beyond the gate from it.

    Parameters
    ----------
    forecast
        Of the position at the time of the bearing, mean ``(1, d)`` and covariance ``(1, d, d)``.
    bearing, own
        Unit vector and own position ``(d,)``.
    noise
        Of the sensor.
    weight
        Number of ordinary bearings that it is worth.
    gate
        In standard deviations.

    Returns
    -------
    ``None`` and false where the target is expected at the vehicle.
    """
    mean, covariance = (values[0] for values in forecast)
    line = mean - own
    distance = float(np.linalg.norm(line))
    if not distance > 0.0:
        return None, False
    unit = line / distance
    basis = tangent_basis(unit)
    angle = log_map(unit, bearing, basis)
    single = noise.std**2 / weight + noise.correlated_std**2 + (noise.own_std / distance) ** 2
    spread = basis.T @ covariance @ basis / distance**2 + single * np.eye(len(angle))
    return unit, bool(angle @ np.linalg.solve(spread, angle) > gate**2)
