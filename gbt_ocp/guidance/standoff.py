"""A distance from a target that may do what its forecast does not say, or be in more than one place.

A forecast of one mean and one covariance has two gaps. What a tracker believes may be a few separate motions, and the
moments of them all together describe none. And the target may leave its forecast: until the next plan is executed, a
period later, it can be anywhere that its largest speed takes it from where it was.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import casadi as ca
import numpy as np

from gbt_ocp.guidance.target_limits import RangeLimits, moments_at_knots
from gbt_ocp.models.sizes import not_negative
from gbt_ocp.ocp.trajectory import FlatPoint
from gbt_ocp.tracking.protocol import WeighedForecasts, mixed
from gbt_ocp.typing import Array

PLACES = 4
"""Hypotheses that a plan keeps its distance from, at most; those beyond are kept together."""


def after(values: Array) -> Array:
    """Values at the knots ``(..., p+1, d)``, each that of the knot before; the first stays."""
    return np.concatenate([values[..., :1, :], values[..., :-1, :]], axis=-2)


@dataclass(frozen=True)
class ReachableRange:
    """:class:`RangeLimits` for wherever the target can be a planning period after it was where it is believed to be.

    At a knot the distance counts from the position expected at the knot before, less the ``reach``: a disc (a ball)
    that holds all that a target of that speed can do in a piece. At the present knot the reach is zero, and within the
    first piece it grows with time.

    Parameters
    ----------
    limits
        The limits.
    reach
        Largest speed of the target times the length of a piece, in metres.

    Raises
    ------
    ValueError
        If the reach is below 0.
    """

    limits: RangeLimits
    reach: float

    name: ClassVar[str] = RangeLimits.name

    def __post_init__(self) -> None:
        not_negative("reach", self.reach)

    @property
    def lower(self) -> Array:
        """As :attr:`RangeLimits.lower`."""
        return self.limits.lower

    @property
    def upper(self) -> Array:
        """As :attr:`RangeLimits.upper`."""
        return self.limits.upper

    @property
    def backoff(self) -> Array:
        """None."""
        return self.limits.backoff

    @property
    def scale(self) -> Array:
        """Units of the limits."""
        return self.limits.scale

    @property
    def shapes(self) -> Mapping[str, tuple[int, int]]:
        """The posterior's mean at the knot before and its covariance, and the reach."""
        return {**self.limits.shapes, "reach": (1, 1)}

    def value(self, point: FlatPoint, parameters: Mapping[str, Any]) -> Any:
        """As :meth:`RangeLimits.value`, with the reach taken off and added."""
        return self.limits.rows(point, parameters["mean"], parameters["covariance"], parameters["reach"])

    def bind(self, pieces: int, data: Mapping[str, Any]) -> dict[str, Array]:
        """Means ``(p+1, d, 1)``, covariances ``(p+1, d, d)`` and reaches ``(p+1, 1, 1)`` at the knots."""
        bound = self.limits.bind(pieces, data)
        reach = np.full((pieces + 1, 1, 1), self.reach)
        reach[0] = 0.0
        return {"mean": after(bound["mean"][..., 0])[..., None], "covariance": bound["covariance"], "reach": reach}

    def at_knot_after(self, mean: Any, covariance: Any, present: Any, before: Any, later: Any) -> Mapping[str, Any]:
        """See :class:`gbt_ocp.ocp.terms.LimitFromMotion`."""
        bound = self.limits.at_knot(before, covariance, present)
        return {"mean": bound["mean"], "covariance": bound["covariance"], "reach": self.reach * later}


@dataclass(frozen=True)
class RangeOfHypotheses:
    """:class:`RangeLimits` kept to each hypothesis of where the target is, instead of to their moments together.

    The hypotheses are ``hypotheses`` among the data of a solve (:class:`WeighedForecasts` at the knots); without them
    the moments of the forecast count as the only one. Those below the probability are left out; the likeliest always
    counts. Beyond :data:`PLACES` the least likely of them are taken together.

    Parameters
    ----------
    limits
        The limits; their confidence holds given each hypothesis.
    probability
        Of a hypothesis, from which on it counts; in (0, 1).
    reach
        As in :class:`ReachableRange`, in metres.

    Raises
    ------
    ValueError
        If the probability lies outside (0, 1), or the reach is below 0.
    """

    limits: RangeLimits
    probability: float
    reach: float = 0.0

    name: ClassVar[str] = RangeLimits.name

    def __post_init__(self) -> None:
        not_negative("reach", self.reach)
        if not 0.0 < self.probability < 1.0:
            raise ValueError(f"probability: found {self.probability}; allowed: a number in (0, 1)")

    @property
    def lower(self) -> Array:
        """Those of the limits, for each place."""
        return np.tile(self.limits.lower, PLACES)

    @property
    def upper(self) -> Array:
        """Those of the limits, for each place."""
        return np.tile(self.limits.upper, PLACES)

    @property
    def backoff(self) -> Array:
        """None."""
        return np.tile(self.limits.backoff, PLACES)

    @property
    def scale(self) -> Array:
        """Units of the limits."""
        return np.tile(self.limits.scale, PLACES)

    @property
    def shapes(self) -> Mapping[str, tuple[int, int]]:
        """Mean and covariance of each place, side by side, and the reach."""
        d = self.limits.dimension
        return {"mean": (d, PLACES), "covariance": (d, d * PLACES), "reach": (1, 1)}

    def value(self, point: FlatPoint, parameters: Mapping[str, Any]) -> Any:
        """The rows of the limits, place after place."""
        means = ca.horzsplit(parameters["mean"], 1)
        covariances = ca.horzsplit(parameters["covariance"], self.limits.dimension)
        reach = parameters["reach"]
        return ca.vertcat(*(self.limits.rows(point, *both, reach) for both in zip(means, covariances, strict=True)))

    def bind(self, pieces: int, data: Mapping[str, Any]) -> dict[str, Array]:
        """Means ``(p+1, d, H)``, covariances ``(p+1, d, H d)`` and reaches ``(p+1, 1, 1)`` at the knots."""
        given = data.get("hypotheses")
        if given is None:
            mean, covariance = moments_at_knots(pieces, data, self)
            given = WeighedForecasts(np.ones(1), mean[None], covariance[None])
        _, means, covariances = counted(given, self.probability)
        means, covariances = means[:, : pieces + 1], covariances[:, : pieces + 1]
        if not self.limits.foresee:
            covariances = np.tile(covariances[:, :1], (1, pieces + 1, 1, 1))
        reach = np.full((pieces + 1, 1, 1), self.reach)
        reach[0] = 0.0
        return {
            "mean": np.moveaxis(after(means) if self.reach > 0.0 else means, 0, -1),
            "covariance": np.concatenate(list(covariances), axis=-1),
            "reach": reach,
        }


def counted(given: WeighedForecasts, probability: float) -> WeighedForecasts:
    """The hypotheses that a plan keeps its distance from, :data:`PLACES` of them, likeliest first.

    Parameters
    ----------
    given
        All hypotheses.
    probability
        From which on one counts.

    Returns
    -------
    Those that count; a free place has the likeliest again. The weights are as given, zero at a free place.
    """
    order = np.argsort(-given.weights, kind="stable")
    order = order[: max(1, int(np.sum(given.weights >= probability)))]
    weights, means, covariances = (values[order] for values in given)
    if len(order) > PLACES:
        rest = weights[PLACES - 1 :]
        mean, covariance = mixed(
            np.tile((rest / rest.sum())[:, None], means.shape[1]), means[PLACES - 1 :], covariances[PLACES - 1 :]
        )
        means = np.concatenate([means[: PLACES - 1], mean[None]])
        covariances = np.concatenate([covariances[: PLACES - 1], covariance[None]])
        weights = np.append(weights[: PLACES - 1], rest.sum())
    free = PLACES - len(weights)
    return WeighedForecasts(
        np.concatenate([weights, np.zeros(free)]),
        np.concatenate([means, np.tile(means[:1], (free, 1, 1))]),
        np.concatenate([covariances, np.tile(covariances[:1], (free, 1, 1, 1))]),
    )
