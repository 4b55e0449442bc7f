"""Where a track of bearings begins: hypotheses of the range, and what else is known before any bearing."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from gbt_ocp.tracking.bins import BinnedBearings
from gbt_ocp.tracking.displacement.fit import Node, PosteriorMixture, grid
from gbt_ocp.tracking.noise import BearingNoise
from gbt_ocp.tracking.priors import LogNormal
from gbt_ocp.typing import Array

LADDER = 2.0
"""Ratio of one range hypothesis to the next."""

RUNG = 0.42
"""Standard deviation of a hypothesis's range over its range: neighbouring ones overlap."""

CANDIDATES = np.log(1.4) * np.arange(-2, 3)
"""Logarithms of the factors on σ that are compared where it is estimated."""

FIRST = 5
"""Bearings whose mean points the hypotheses."""


@dataclass(frozen=True)
class MotionPriors:
    """What is known of the target before any bearing.

    Attributes
    ----------
    scale
        Standard deviation on each axis: of the velocity in m/s under a ``velocity_`` kernel, else of the position in m.
    length
        Length scale in s.
    range
        Range in m at the first bearing.
    position_std
        Standard deviation in m on each axis of the target's position about the vehicle's, once range is observable.
    """

    scale: LogNormal = field(default_factory=lambda: LogNormal(1.0, 0.7))
    length: LogNormal = field(default_factory=lambda: LogNormal(4.0, 0.8))
    range: LogNormal = field(default_factory=lambda: LogNormal(5.0, 1.0))
    position_std: float = 100.0

    def __post_init__(self) -> None:
        if not self.position_std > 0.0:
            raise ValueError(f"position_std: found {self.position_std}; allowed: a number > 0")

    def nodes(self, noise: BearingNoise, log_factor: float) -> list[Node]:
        """The grid of hyperparameters; where σ is estimated, about its factor so far, whose logarithm is given."""
        variance = noise.std**2
        if not noise.estimated:
            return grid(self.scale, self.length, [(variance, 0.0)])
        # σ as given is a weak prior: a factor of e is one standard deviation
        factors = log_factor + CANDIDATES
        return grid(
            self.scale,
            self.length,
            [(variance * float(np.exp(2.0 * f)), -0.5 * float(f) ** 2) for f in factors],
        )


@dataclass
class RangeHypothesis:
    """A prior position with the posterior that follows from it."""

    mean: Array
    covariance: Array
    log_prior: float
    mixture: PosteriorMixture | None = None


def range_hypotheses(samples: BinnedBearings, prior: LogNormal) -> list[RangeHypothesis]:
    """Hypotheses along the first bearings, one for each doubling of the range over two deviations to both sides."""
    line = samples.bearings[:FIRST].mean(axis=0)
    size = np.linalg.norm(line)
    # bearings to all sides have no mean direction
    line = line / size if size > 0.1 else samples.bearings[0]
    along = np.outer(line, line)
    reach = int(np.ceil(2.0 * prior.log_std / np.log(LADDER)))
    found = []
    for k in range(-reach, reach + 1):
        distance = prior.median * LADDER**k
        covariance = distance**2 * (RUNG**2 * along + np.eye(len(line)) - along)
        log_prior = -0.5 * (k * np.log(LADDER) / prior.log_std) ** 2
        found.append(RangeHypothesis(samples.own_positions[0] + distance * line, covariance, float(log_prior)))
    return found
