"""Mean and covariance of the position at nodes of time, of a mixture of Gaussians in the coordinates of a motion.

Each component is mapped at its mode: the position there, and its covariance by the slopes there. Where the range is
hardly known this is a choice. In log range the posterior is about Gaussian, in metres it is skewed, and its mean lies
far beyond its median; a component is reported at its median range, with the deviation of log range times that range.
On recorded logs the mean of the skewed density has half as much error again (docs/sea.md).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from gbt_ocp.tracking.protocol import mixed
from gbt_ocp.tracking.shape.fit import LaplaceFit
from gbt_ocp.tracking.shape.motions import MotionShape
from gbt_ocp.tracking.shape.processes import interpolation
from gbt_ocp.typing import Array


class NodeMoments(NamedTuple):
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
        """Mean ``(K, d)`` and covariance ``(K, d, d)`` at times ``(K,)`` in seconds relative to now.

        Linear between the nodes. Beyond the last node ahead, H seconds from now, the mean goes straight on and the
        covariance grows with ``(t/H)³``. No term of the linearised motion grows faster: a heading that has diffused
        makes that power, an unknown speed the second. Before the oldest node of the past the values are held.
        """
        weights = interpolation(self.times, times)
        mean, covariance = weights @ self.mean, np.einsum("kg,gij->kij", weights, self.covariance)
        last = float(self.times[-1])
        beyond = times > max(last, 0.0) + 1e-9
        if np.any(beyond):
            velocity = (self.mean[-1] - self.mean[-2]) / (self.times[-1] - self.times[-2])
            mean[beyond] += (times[beyond] - last)[:, None] * velocity
            covariance[beyond] *= ((times[beyond] / last) ** 3)[:, None, None]
        return mean, covariance


def on_both_sides(
    lags: Array, ahead: Callable[[Array], tuple[Array, Array]], before: Callable[[Array], tuple[Array, Array]]
) -> tuple[Array, Array]:
    """Means ``(K, d)`` and covariances ``(K, d, d)`` at lags from now ``(K,)`` in seconds, each side by its own.

    Parameters
    ----------
    ahead, before
        Both moments at lags of at least 0, and at those below; asked only where there are some.
    """
    later = lags >= 0.0
    sides = [(chosen, side(lags[chosen])) for chosen, side in ((later, ahead), (~later, before)) if np.any(chosen)]
    d = sides[0][1][0].shape[1] if sides else 0
    mean, covariance = np.empty((len(lags), d)), np.empty((len(lags), d, d))
    for chosen, (means, covariances) in sides:
        mean[chosen], covariance[chosen] = means, covariances
    return mean, covariance


def moments_ahead(shape: MotionShape, found: LaplaceFit, weights: Array, horizon: float) -> NodeMoments:
    """Moments from now to ``horizon`` seconds ahead or a little further, under weights ``(B,)`` that sum to one."""
    times, nodes = shape.ahead(found.motions, horizon)
    known = shape.size
    spread = _spread(nodes.slopes[..., :known], found.covariance)
    beyond = nodes.slopes[..., known:]
    spread += np.einsum("bgik,bgjk->bgij", beyond, beyond)
    return NodeMoments(times, *mixed(weights, nodes.positions, spread))


def moments_behind(shape: MotionShape, found: LaplaceFit, weights: Array) -> NodeMoments:
    """Moments over the past that the knots reach: the smoothed track."""
    nodes = shape.past(found.motions)
    return NodeMoments(shape.past_nodes, *mixed(weights, nodes.positions, _spread(nodes.slopes, found.covariance)))


def moments_now(shape: MotionShape, found: LaplaceFit, weights: Array) -> tuple[Array, Array, Array]:
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


def motion_covariance(times: Array, covariance: Array, lag: float) -> Array:
    """Covariance of position and velocity ``(2d, 2d)`` a lag in seconds after now, on a straight way.

    Parameters
    ----------
    times, covariance
        Of two positions, as of :func:`moments_now`.
    lag
        In seconds.
    """
    # position = p_0 + (lag - t_0) v with v = (p_0 - p_1) / (t_0 - t_1)
    rate = np.array([1.0, -1.0]) / (times[0] - times[1])
    way = np.kron(np.array([np.array([1.0, 0.0]) + (lag - times[0]) * rate, rate]), np.eye(len(covariance) // 2))
    return np.asarray(way @ covariance @ way.T)


def _spread(slopes: Array, covariance: Array) -> Array:
    """Covariance of the positions ``(B, G, d, d)``."""
    count, nodes, d, n = slopes.shape
    across = (slopes.reshape(count, nodes * d, n) @ covariance).reshape(slopes.shape)
    return np.asarray(np.einsum("bgik,bgjk->bgij", across, slopes))
