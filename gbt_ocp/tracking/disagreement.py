"""Whether bearings agree with the noise that was configured: against a tracker's forecasts, and against each other.

Two measures, both about 1 where the noise is as configured:

- the angle of a bearing from the forecast made before it, over its deviation by the noise and the forecast's spread;
- the angle of a bearing from the line between the one before and the one after it, over its deviation by the noise.
  It needs no forecast. A tracker that widens its spread until anything fits, or that has none, does not hide what
  disagrees here: bearings of several contacts in turn.

Their upper quartile counts, so that outliers, a start and a few manoeuvres do not.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gbt_ocp.models.bearings import log_map, tangent_basis
from gbt_ocp.tracking.noise import BearingNoise
from gbt_ocp.tracking.protocol import Forecast
from gbt_ocp.typing import Array

MANY_TIMES = 6.0
"""Upper quartile above which bearings disagree with the noise: it is 1.15 for normal errors, at most 1.8 in the shipped
runs and 1.4 in logs of a single boat at sea."""

LEAST_COUNT = 20
"""Measures below which nothing is concluded."""


def standardised_innovations(forecast: Forecast, own: Array, bearings: Array, noise: BearingNoise) -> Array:
    """Angles of K bearings from their forecasts over their standard deviations ``(K,)``.

    They are root mean squares over the d-1 axes.

    Parameters
    ----------
    forecast
        Of the position at each bearing, made before it: ``(K, d)`` and ``(K, d, d)``.
    own, bearings
        ``(K, d)``; NaN where a bearing is missing.
    noise
        Of the sensor.

    Returns
    -------
    NaN where the bearing or the covariance is not known, or the forecast is at the vehicle.
    """
    found = np.full(len(bearings), np.nan)
    for k, (mean, covariance) in enumerate(zip(*forecast, strict=True)):
        line = mean - own[k]
        distance = float(np.linalg.norm(line))
        if not (distance > 0.0 and np.all(np.isfinite(covariance)) and np.all(np.isfinite(bearings[k]))):
            continue
        unit = line / distance
        basis = tangent_basis(unit)
        angle = log_map(unit, bearings[k], basis)
        single = noise.std**2 + noise.correlated_std**2 + (noise.own_std / distance) ** 2
        spread = basis.T @ covariance @ basis / distance**2 + single * np.eye(len(angle))
        found[k] = np.sqrt(angle @ np.linalg.solve(spread, angle) / len(angle))
    return found


def standardised_kinks(times: Array, bearings: Array, noise: BearingNoise) -> Array:
    """Angles of bearings from the line between their neighbours over their standard deviations ``(K-2,)``.

    Parameters
    ----------
    times, bearings
        ``(K,)`` in seconds and ``(K, d)``.
    noise
        Of the sensor; the own position is left out, since no range is known.
    """
    found = np.empty(max(len(times) - 2, 0))
    for k in range(len(found)):
        three = times[k : k + 3]
        share = (three[1] - three[0]) / (three[2] - three[0])
        weights = np.array([share - 1.0, 1.0, -share])
        between = (1.0 - share) * bearings[k] + share * bearings[k + 2]
        length = float(np.linalg.norm(between))
        if length < 1e-6:  # opposite neighbours have no line between them
            found[k] = np.inf
            continue
        angle = log_map(between / length, bearings[k + 1])
        covariance = noise.std**2 * np.eye(3) + noise.correlated(three)
        found[k] = np.linalg.norm(angle) / np.sqrt(len(angle) * (weights @ covariance @ weights))
    return found


def disagreement(measures: Sequence[Array]) -> float | None:
    """Largest upper quartile of measures if it is far above 1, otherwise ``None``."""
    finite = [values[~np.isnan(values)] for values in measures]
    quartiles = [float(np.quantile(values, 0.75, method="lower")) for values in finite if len(values) >= LEAST_COUNT]
    largest = max(quartiles, default=0.0)
    return largest if largest > MANY_TIMES else None
