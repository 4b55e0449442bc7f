"""Mean and covariance of the position at nodes of time, of a mixture of Gaussians in the coordinates of a motion.

A position is linear in all coordinates but the logarithm of the range, along which the posterior may be as wide as its
prior. That one is integrated by Gauss-Hermite nodes, with the others conditioned on it and the motion linearised at
each node.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gbt_ocp.tracking.motion_shape import Motions, MotionShape
from gbt_ocp.tracking.shape_fit import Fit
from gbt_ocp.tracking.shape_processes import interpolation

Array = NDArray[np.float64]

NARROW = 0.03
"""Standard deviation of log range below which one node does."""

# of the weight exp(-x²/2)
_ROOTS, _SHARES = np.polynomial.hermite_e.hermegauss(5)
_SHARES = _SHARES / _SHARES.sum()


class Moments(NamedTuple):
    """Moments at evenly spaced nodes, relative to the own position now.

    Attributes
    ----------
    times
        ``(G,)`` in seconds relative to now.
    mean, covariance
        ``(G, d)`` in metres and ``(G, d, d)`` in m².
    """

    times: Array
    mean: Array
    covariance: Array

    def at(self, times: Array) -> tuple[Array, Array]:
        """Between the nodes, at times ``(K,)`` in seconds relative to now."""
        weights = interpolation(self.times, times)
        return weights @ self.mean, np.einsum("kg,gij->kij", weights, self.covariance)


def moments_ahead(shape: MotionShape, found: Fit, weights: Array, horizon: float) -> Moments:
    """Moments from now to at least ``horizon`` seconds ahead, under weights ``(B,)`` that sum to one."""
    motions, covariance, share = _along_range(shape, found, weights)
    times, nodes = shape.ahead(motions, horizon)
    known = shape.size
    spread = _spread(nodes.slopes[..., :known], covariance)
    beyond = nodes.slopes[..., known:]
    spread += np.einsum("bgik,bgjk->bgij", beyond, beyond)
    return _mixed(times, nodes.positions, spread, share)


def moments_behind(shape: MotionShape, found: Fit, weights: Array) -> Moments:
    """Moments over the past that the knots reach: the smoothed track."""
    motions, covariance, share = _along_range(shape, found, weights)
    nodes = shape.past(motions)
    return _mixed(shape.past_nodes, nodes.positions, _spread(nodes.slopes, covariance), share)


def _along_range(shape: MotionShape, found: Fit, weights: Array) -> tuple[Motions, Array, Array]:
    """The components, each split along its log range: motions, conditional covariances and weights."""
    deviation = np.sqrt(found.covariance[:, 0, 0])
    if np.all(shape.prior.range.log_std * deviation < NARROW):
        return found.motions, found.covariance, weights
    along = found.covariance[:, :, 0] / deviation[:, None]
    rest = found.covariance - along[:, :, None] * along[:, None, :]
    motions = Motions.joined([shape.moved(found.motions, root * along) for root in _ROOTS])
    count = len(_ROOTS)
    return motions, np.tile(rest, (count, 1, 1)), np.concatenate([share * weights for share in _SHARES])


def _spread(slopes: Array, covariance: Array) -> Array:
    """Covariance of the positions ``(B, G, d, d)``."""
    count, nodes, d, n = slopes.shape
    across = (slopes.reshape(count, nodes * d, n) @ covariance).reshape(slopes.shape)
    return np.asarray(np.einsum("bgik,bgjk->bgij", across, slopes))


def _mixed(times: Array, positions: Array, spread: Array, weights: Array) -> Moments:
    mean = np.einsum("b,bgi->gi", weights, positions)
    offset = positions - mean
    covariance = np.einsum("b,bgij->gij", weights, spread) + np.einsum("b,bgi,bgj->gij", weights, offset, offset)
    return Moments(times, mean, covariance)
