"""Limits with respect to the target, as far as it is known: its range, and its place in the field of view.

They depend on the posterior at the boundaries of the pieces: ``present`` (at the start) and ``forecast`` (at the
endpoints), both with ``mean`` and ``covariance``.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import casadi as ca
import numpy as np
from scipy.special import ndtri

from gbt_ocp.guidance.objectives import NEAR
from gbt_ocp.models.sizes import positive
from gbt_ocp.ocp.terms import Moments, needed
from gbt_ocp.ocp.trajectory import FlatPoint
from gbt_ocp.typing import Array


def moments_at_knots(pieces: int, data: Mapping[str, Any], reader: object) -> tuple[Array, Array]:
    """Mean ``(p+1, d)`` and covariance ``(p+1, d, d)`` at the boundaries of the pieces.

    Raises
    ------
    ValueError
        If ``present`` or ``forecast`` is missing.
    """
    present: Moments = needed(data, "present", reader)
    forecast: Moments = needed(data, "forecast", reader)
    mean = np.vstack([np.asarray(present.mean)[None], np.asarray(forecast.mean)[:pieces]])
    covariance = np.concatenate([np.asarray(present.covariance)[None], np.asarray(forecast.covariance)[:pieces]])
    return mean, covariance


@dataclass(frozen=True)
class RangeLimits:
    """Keep a distance from the target that holds with a stated probability: ``P(range >= nearest) >= confidence``.

    The posterior's spread along the line of sight, ``σ = √(gᵀΣg)``, is taken off and added: with ρ the distance to the
    mean and q the normal quantile of the confidence, ``ρ - qσ >= nearest`` and ``ρ + qσ <= farthest``. That is exact
    to first order in the spread over the range.

    Parameters
    ----------
    dimension
        d.
    nearest, farthest
        In metres; ``None`` for no limit. Violations are reported in units of them.
    confidence
        Probability in [0.5, 1) of each of the two.
    foresee
        Whether later knots have the spread of the forecast, which no further bearing narrows; or else that of the
        present, since only the first piece of a plan is executed before the next plan is made.

    Raises
    ------
    ValueError
        If there is no limit at all, one is not above 0, they exclude each other, or the confidence lies outside
        [0.5, 1).
    """

    name: ClassVar[str] = "range"

    dimension: int
    nearest: float | None = None
    farthest: float | None = None
    confidence: float = 0.95
    foresee: bool = True

    def __post_init__(self) -> None:
        if self.nearest is None and self.farthest is None:
            raise ValueError("nearest: found None beside farthest None; allowed: a number for one of them")
        for name in ("nearest", "farthest"):
            if getattr(self, name) is not None:
                positive(name, getattr(self, name))
        if self.nearest is not None and self.farthest is not None and not self.nearest < self.farthest:
            raise ValueError(f"nearest: found {self.nearest}; allowed: a number below farthest, {self.farthest}")
        if not 0.5 <= self.confidence < 1.0:
            raise ValueError(f"confidence: found {self.confidence}; allowed: a number in [0.5, 1)")

    @property
    def lower(self) -> Array:
        """One for the nearest, none for the farthest range."""
        return self._rows(1.0, -np.inf)

    @property
    def upper(self) -> Array:
        """One for the farthest, none for the nearest range."""
        return self._rows(np.inf, 1.0)

    def _rows(self, nearest: float, farthest: float) -> Array:
        pairs = ((self.nearest, nearest), (self.farthest, farthest))
        return np.array([bound for given, bound in pairs if given is not None])

    @property
    def backoff(self) -> Array:
        """None: the spread of the posterior is one."""
        return np.zeros(len(self.lower))

    @property
    def scale(self) -> Array:
        """Units of the limits."""
        return np.ones(len(self.lower))

    @property
    def shapes(self) -> Mapping[str, tuple[int, int]]:
        """The posterior's mean and covariance."""
        return {"mean": (self.dimension, 1), "covariance": (self.dimension, self.dimension)}

    def value(self, point: FlatPoint, parameters: Mapping[str, Any]) -> Any:
        """Range less its spread over the nearest, range plus its spread over the farthest."""
        return self.rows(point, parameters["mean"], parameters["covariance"])

    def rows(self, point: FlatPoint, mean: Any, covariance: Any, reach: Any = 0.0) -> Any:
        """The same of a mean and a covariance, for a target that may be as far as ``reach`` (m) from where it is."""
        line = mean - point.z[: self.dimension]
        range_ = ca.sqrt(ca.sumsqr(line) + NEAR**2)
        sight = line / range_
        spread = ca.sqrt(ca.mtimes([sight.T, covariance, sight]) + NEAR**2)
        margin = float(ndtri(self.confidence)) * spread + reach
        rows = []
        if self.nearest is not None:
            rows.append((range_ - margin) / self.nearest)
        if self.farthest is not None:
            rows.append((range_ + margin) / self.farthest)
        return ca.vertcat(*rows)

    def bind(self, pieces: int, data: Mapping[str, Any]) -> dict[str, Array]:
        """Means ``(p+1, d, 1)`` and covariances ``(p+1, d, d)`` at the knots."""
        mean, covariance = moments_at_knots(pieces, data, self)
        if not self.foresee:
            covariance = np.tile(covariance[:1], (pieces + 1, 1, 1))
        return {"mean": mean[..., None], "covariance": covariance}

    def at_knot(self, mean: Any, covariance: Any, present: Any) -> Mapping[str, Any]:
        """The moments themselves, or the present spread around the mean."""
        return {"mean": mean, "covariance": covariance if self.foresee else present}


@dataclass(frozen=True)
class FieldOfView:
    """Keep the expected target within an angle of the bow, for vehicles whose flat output carries the yaw.

    The bow is level: in 3D the angle is the one between the horizontal heading and the line of sight.

    Parameters
    ----------
    dimension
        d.
    half_angle
        In radians, in (0, π).

    Raises
    ------
    ValueError
        If the angle lies outside (0, π).
    """

    dimension: int
    half_angle: float

    name: ClassVar[str] = "bow_angle"
    upper: ClassVar[Array] = np.full(1, np.inf)
    backoff: ClassVar[Array] = np.zeros(1)

    def __post_init__(self) -> None:
        if not 0.0 < self.half_angle < np.pi:
            raise ValueError(f"half_angle: found {self.half_angle}; allowed: a number in (0, pi)")

    @property
    def lower(self) -> Array:
        """The cosine of the angle."""
        return np.array([np.cos(self.half_angle)])

    @property
    def scale(self) -> Array:
        """How fast the cosine changes at the edge of the view: violations are reported in radians."""
        return np.array([np.sin(self.half_angle)])

    @property
    def shapes(self) -> Mapping[str, tuple[int, int]]:
        """The posterior's mean."""
        return {"mean": (self.dimension, 1)}

    def value(self, point: FlatPoint, parameters: Mapping[str, Any]) -> Any:
        """Cosine of the angle between bow and line of sight."""
        line = parameters["mean"] - point.z[: self.dimension]
        yaw = point.z[self.dimension]
        return (ca.cos(yaw) * line[0] + ca.sin(yaw) * line[1]) / ca.sqrt(ca.sumsqr(line) + NEAR**2)

    def bind(self, pieces: int, data: Mapping[str, Any]) -> dict[str, Array]:
        """Means ``(p+1, d, 1)`` at the knots."""
        return {"mean": moments_at_knots(pieces, data, self)[0][..., None]}

    def at_knot(self, mean: Any, covariance: Any, present: Any) -> Mapping[str, Any]:
        """The mean."""
        return {"mean": mean}
