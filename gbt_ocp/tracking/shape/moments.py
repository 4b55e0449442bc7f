"""Mean and covariance of the position at nodes of time, of a mixture of Gaussians in the coordinates of a motion.

Each component is mapped at its mode: the position there, and its covariance by the slopes there. Where the range is
hardly known this is a choice. In log range the posterior is about Gaussian, in metres it is skewed, and its mean lies
far beyond its median; a component is reported at its median range, with the deviation of log range times that range.
On recorded logs the mean of the skewed density has half as much error again (docs/sea.md).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from gbt_ocp.tracking.protocol import mixed
from gbt_ocp.tracking.shape.fit import Fit
from gbt_ocp.tracking.shape.motions import MotionShape
from gbt_ocp.tracking.shape.processes import interpolation
from gbt_ocp.typing import Array


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
    times, nodes = shape.ahead(found.motions, horizon)
    known = shape.size
    spread = _spread(nodes.slopes[..., :known], found.covariance)
    beyond = nodes.slopes[..., known:]
    spread += np.einsum("bgik,bgjk->bgij", beyond, beyond)
    return Moments(times, *mixed(weights, nodes.positions, spread))


def moments_behind(shape: MotionShape, found: Fit, weights: Array) -> Moments:
    """Moments over the past that the knots reach: the smoothed track."""
    nodes = shape.past(found.motions)
    return Moments(shape.past_nodes, *mixed(weights, nodes.positions, _spread(nodes.slopes, found.covariance)))


def moments_now(shape: MotionShape, found: Fit, weights: Array) -> tuple[Array, Array, Array]:
    """What is known of position and velocity now, as the joint moments of the positions at the two latest nodes.

    Returns
    -------
    Times ``(2,)`` in seconds, mean ``(2, d)`` in metres and covariance ``(2d, 2d)`` in m², relative to now and to the
    own position now.
    """
    nodes = shape.past(found.motions, 2)
    count, _, d = nodes.positions.shape
    both = nodes.positions.reshape(count, 1, 2 * d)
    mean, covariance = mixed(weights, both, _spread(nodes.slopes.reshape(count, 1, 2 * d, -1), found.covariance))
    return shape.past_nodes[:2], mean.reshape(2, d), covariance[0]


def _spread(slopes: Array, covariance: Array) -> Array:
    """Covariance of the positions ``(B, G, d, d)``."""
    count, nodes, d, n = slopes.shape
    across = (slopes.reshape(count, nodes * d, n) @ covariance).reshape(slopes.shape)
    return np.asarray(np.einsum("bgik,bgjk->bgij", across, slopes))
