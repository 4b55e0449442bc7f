"""Objectives on bearings: the expected similarity of the paper, and a weak pull towards the target."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from gbt_ocp.models.sizes import not_negative, positive
from gbt_ocp.ocp.terms import Moments, needed
from gbt_ocp.ocp.trajectory import FlatPoint
from gbt_ocp.typing import Array

NEAR = 1.0e-6
"""Distance in metres below which a bearing is smoothed: it is undefined where a sigma point meets the vehicle."""


def sigma_weights(dimension: int, kappa: float) -> Array:
    """Weights w_0 … w_2d of the sigma points ``(2d+1,)``: κ/(d+κ), then 1/(2(d+κ)) each; they sum to one."""
    return np.array([kappa / (dimension + kappa)] + [0.5 / (dimension + kappa)] * (2 * dimension))


def sigma_points(mean: ArrayLike, covariance: ArrayLike, kappa: float) -> Array:
    """Sigma points χ_0 … χ_2d of the unscented transform (``eq27``).

    The square root is the symmetric one, by eigendecomposition, with negative round-off eigenvalues set to zero.

    Parameters
    ----------
    mean, covariance
        μ ``(..., d)`` and Σ ``(..., d, d)``.
    kappa
        κ > -d.

    Returns
    -------
    Points ``(..., 2d+1, d)``: the mean, then minus and plus each column of the root of (d+κ)Σ.
    """
    mu = np.asarray(mean, dtype=float)
    values, vectors = np.linalg.eigh(np.asarray(covariance, dtype=float))
    dimension = mu.shape[-1]
    size = np.sqrt((dimension + kappa) * np.maximum(values, 0.0))
    root = np.einsum("...ij,...j,...kj->...ik", vectors, size, vectors)
    columns = np.swapaxes(root, -1, -2)
    centre = mu[..., None, :]
    return np.concatenate([centre, centre - columns, centre + columns], axis=-2)


@dataclass(frozen=True)
class BearingSimilarity:
    """Expected similarity ``E⟨λ*, λ⟩`` of the desired and the future bearing, by the unscented transform (``eq28``).

    Needs ``forecast`` (:class:`Moments` at the endpoints) and ``desired`` (λ* at the endpoints, ``(>=p, d)``).

    Parameters
    ----------
    dimension
        d.
    kappa
        κ, the adjusting factor of the transform.
    axial
        Maximise ``E(⟨λ*, λ⟩²)`` instead: a bearing counts the same as its opposite, as it does in P (``eq20``), so the
        vehicle may be on either side of the target.

    Raises
    ------
    ValueError
        If κ is not above -d, where the weights of the transform have no meaning.
    """

    dimension: int
    kappa: float = 1.0
    axial: bool = False

    def __post_init__(self) -> None:
        positive("dimension + kappa", self.dimension + self.kappa)

    @property
    def shapes(self) -> Mapping[str, tuple[int, int]]:
        """Sigma points, one a column, and the desired bearing."""
        return {"sigma_points": (self.dimension, 2 * self.dimension + 1), "desired": (self.dimension, 1)}

    def value(self, point: FlatPoint, parameters: Mapping[str, Any]) -> Any:
        """``Σ_j w_j ⟨λ*, λ̂_j⟩`` at one endpoint, or the sum of squares."""
        own = point.z[: self.dimension]
        total = 0.0
        for j, weight in enumerate(sigma_weights(self.dimension, self.kappa)):
            line = parameters["sigma_points"][:, j] - own
            along, square = ca.dot(parameters["desired"], line), ca.sumsqr(line) + NEAR**2
            total += weight * (along**2 / square if self.axial else along / ca.sqrt(square))
        return total

    def bind(self, pieces: int, data: Mapping[str, Any]) -> dict[str, Array]:
        """Sigma points ``(p, d, 2d+1)`` and desired bearings ``(p, d, 1)``."""
        forecast: Moments = needed(data, "forecast", self)
        desired = np.asarray(needed(data, "desired", self), dtype=float)[:pieces]
        points = sigma_points(forecast.mean[:pieces], forecast.covariance[:pieces], self.kappa)
        return {"sigma_points": np.swapaxes(points, -1, -2), "desired": desired[..., None]}

    def from_moments(self, mean: Any, root: Any, desired: Any) -> Mapping[str, Any]:
        """Sigma points and desired bearing from the moments of the forecast."""
        columns = ca.horzsplit(np.sqrt(self.dimension + self.kappa) * root)
        points = [mean, *(mean - column for column in columns), *(mean + column for column in columns)]
        return {"sigma_points": ca.horzcat(*points), "desired": desired}


@dataclass(frozen=True)
class RangePull:
    """A weak pull towards the forecast from beyond a reference range, nearly none within it.

    At each endpoint minus ``weight · s · softplus((‖μ - P_A‖ - reference)/s)`` with s a tenth of the reference. The
    similarity of bearings does not see range; without a pull nothing keeps the vehicle near the target, and with one
    that acts at every range the vehicle ends up centimetres away. Needs ``forecast``.

    Parameters
    ----------
    dimension
        d.
    weight
        Reduction of the objective per metre of range and endpoint, beyond the reference.
    reference
        Range in metres at which the pull has half its strength.

    Raises
    ------
    ValueError
        If the weight is below 0, or the reference not above it.
    """

    dimension: int
    weight: float = 0.2
    reference: float = 1.0

    def __post_init__(self) -> None:
        not_negative("weight", self.weight)
        positive("reference", self.reference)

    @property
    def shapes(self) -> Mapping[str, tuple[int, int]]:
        """The predicted mean."""
        return {"mean": (self.dimension, 1)}

    def value(self, point: FlatPoint, parameters: Mapping[str, Any]) -> Any:
        """The (negative) pull at one endpoint."""
        softness = 0.1 * self.reference
        distance = ca.sqrt(ca.sumsqr(parameters["mean"] - point.z[: self.dimension]) + NEAR**2)
        excess = (distance - self.reference) / softness
        # softplus without overflow: max(x, 0) + log(1 + exp(-|x|))
        return -self.weight * softness * (ca.fmax(excess, 0.0) + ca.log1p(ca.exp(-ca.fabs(excess))))

    def bind(self, pieces: int, data: Mapping[str, Any]) -> dict[str, Array]:
        """Predicted means ``(p, d, 1)``."""
        forecast: Moments = needed(data, "forecast", self)
        return {"mean": np.asarray(forecast.mean[:pieces], dtype=float)[..., None]}

    def from_moments(self, mean: Any, root: Any, desired: Any) -> Mapping[str, Any]:
        """The mean of the forecast."""
        return {"mean": mean}
