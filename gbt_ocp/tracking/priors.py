"""What is known of the target before the first bearing: its position, and positive quantities such as its range."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Self

import numpy as np

from gbt_ocp.models.bearings import tangent_basis
from gbt_ocp.tracking.protocol import Forecast
from gbt_ocp.typing import Array


@dataclass(frozen=True)
class PositionPrior:
    """The position when the first bearing is taken, known or unknown.

    Parameters
    ----------
    start
        The vehicle's first position ``(d,)``. It stands for the target's until a bearing is taken, if nothing is known.
    mean, covariance
        What is known: ``(d,)`` in metres and ``(d, d)`` in m², or ``None`` twice.

    Raises
    ------
    ValueError
        If one of mean and covariance is missing, or the covariance is not positive definite.
    """

    start: Array
    mean: Array | None = None
    covariance: Array | None = None

    def __post_init__(self) -> None:
        for name in ("start", "mean", "covariance"):
            value = getattr(self, name)
            object.__setattr__(self, name, None if value is None else np.array(value, dtype=float))
        if (self.mean is None) != (self.covariance is None):
            raise ValueError("a prior has both a mean and a covariance, or neither")
        if self.covariance is not None and not np.all(np.linalg.eigvalsh(self.covariance) > 0.0):
            raise ValueError("the prior's covariance must be positive definite")

    @property
    def unseen(self) -> Array:
        """Where an estimator puts the target before the first bearing ``(d,)``."""
        return self.start if self.mean is None else self.mean

    @property
    def known(self) -> tuple[Array, Array] | None:
        """Mean ``(d,)`` and covariance ``(d, d)``, or ``None``."""
        return None if self.mean is None or self.covariance is None else (self.mean, self.covariance)

    def elsewhere(self, own: Array) -> Self:
        """The prior of a new track, with the vehicle at ``own`` ``(d,)``: nothing is known any more."""
        return replace(self, start=own, mean=None, covariance=None)


@dataclass(frozen=True)
class RangedPrior(PositionPrior):
    """A prior position with a range for the first bearing: where a filter begins.

    Parameters
    ----------
    range
        Range in metres at which the first bearing puts the target if its position is not known.

    Raises
    ------
    ValueError
        If the range is not positive.
    """

    range: float = field(kw_only=True)

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.range > 0.0:
            raise ValueError(f"range: found {self.range}; allowed: a number > 0")

    def seen(self, bearing: Array, own: Array) -> Array:
        """The position on the first bearing ``(d,)``.

        The mean of the prior given that the target lies on the line of the bearing, or the point at :attr:`range`.
        """
        if self.known is None:
            return np.asarray(own + self.range * bearing)
        mean, covariance = self.known
        basis = tangent_basis(bearing)
        across = covariance @ basis
        return np.asarray(mean + across @ np.linalg.solve(basis.T @ across, basis.T @ (own - mean)))

    def gaussian(self, bearing: Array, own: Array, variance: float) -> tuple[Array, Array]:
        """Mean ``(d,)`` and covariance ``(d, d)`` with which a filter begins, before it takes in the first bearing.

        The prior itself, or the point at :attr:`range` on the bearing with ``variance`` (m²) on each axis.
        """
        if self.known is None:
            return np.asarray(own + self.range * bearing), variance * np.eye(len(own))
        return self.known

    def forecast(self, count: int) -> Forecast:
        """What a filter predicts before the first bearing at ``count`` times: :attr:`unseen`, without a covariance."""
        d = len(self.unseen)
        return Forecast(np.tile(self.unseen, (count, 1)), np.full((count, d, d), np.nan))


@dataclass(frozen=True)
class LogNormal:
    """What is known of a positive quantity: its logarithm is normal.

    Attributes
    ----------
    median
        In the quantity's unit.
    log_std
        Standard deviation of the logarithm.

    Raises
    ------
    ValueError
        If either is not positive.
    """

    median: float
    log_std: float

    def __post_init__(self) -> None:
        if not (self.median > 0.0 and self.log_std > 0.0):
            raise ValueError(f"median and log_std: found {self.median}, {self.log_std}; allowed: numbers > 0")

    def __call__(self, log_value: float) -> tuple[float, float]:
        """Log density at a logarithm, up to a constant, and its derivative."""
        excess = (float(log_value) - math.log(self.median)) / self.log_std
        return -0.5 * excess**2, -excess / self.log_std


def unseen(position: PositionPrior, range_: LogNormal, own: Array, count: int) -> Forecast:
    """The forecast at so many times before the first bearing, from a known position or the prior on the range alone.

    Parameters
    ----------
    position, range_
        The priors; that on the range in metres.
    own
        Position of the vehicle ``(d,)`` in metres.
    count
        K, the number of times.
    """
    if position.known is not None:
        mean, covariance = position.known
        return Forecast(np.tile(mean, (count, 1)), np.tile(covariance, (count, 1, 1)))
    second = range_.median**2 * np.exp(2.0 * range_.log_std**2) / len(own)
    return Forecast(np.tile(own, (count, 1)), np.tile(second * np.eye(len(own)), (count, 1, 1)))
