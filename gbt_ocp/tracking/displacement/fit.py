"""A target's motion fitted to linearised bearings under one set of hyperparameters, and averaged over many.

Hyperparameters θ = (scale of the motion, length scale, bearing noise) can be averaged over a small grid by evidence
instead of maximised: with some tens of noisy bearings the likelihood of θ is broad, and the posterior at its maximum is
too sure of itself.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.linalg import lapack

from gbt_ocp.models.measurements import Sighting
from gbt_ocp.tracking.bins import BinnedBearings
from gbt_ocp.tracking.displacement.kernels import DisplacementKernel
from gbt_ocp.tracking.displacement.rows import BearingRows, row_covariance, rows_with_others
from gbt_ocp.tracking.linalg import NotPositiveDefiniteError, cholesky
from gbt_ocp.tracking.noise import BearingNoise
from gbt_ocp.tracking.priors import LogNormal
from gbt_ocp.tracking.protocol import Forecast, mixed
from gbt_ocp.typing import Array

LEAST_SHARE = 1.0e-3
"""Weight relative to the largest below which a solution is left out of a mixture."""

SMALLEST_JITTER = 1.0e-14
JITTERS = 5
"""Share of its largest entry that is added to the diagonal of a covariance, and how often a hundred times more."""

SCALES = (-1.8, -0.6, 0.6, 1.8)
LENGTHS = (-2.0, -1.0, 0.0, 1.0, 2.0)
"""Nodes of the grid, in standard deviations of the priors' logarithms."""


@dataclass(frozen=True)
class Node:
    """One set of hyperparameters.

    Attributes
    ----------
    log_scale
        Logarithm of the standard deviation on each axis: of the velocity in m/s, or of the position in m.
    log_length
        Logarithm of the length scale in s.
    white_variance
        σ² in rad².
    log_prior
        Logarithm of the prior weight.
    """

    log_scale: float
    log_length: float
    white_variance: float
    log_prior: float


def grid(scale: LogNormal, length: LogNormal, variances: Sequence[tuple[float, float]]) -> list[Node]:
    """Nodes at 4 scales and 5 length scales, spread over two standard deviations of their priors to both sides.

    ``variances`` are values of σ² in rad² with the logarithms of their prior weights.
    """
    return [
        Node(
            float(np.log(scale.median) + i * scale.log_std),
            float(np.log(length.median) + j * length.log_std),
            variance,
            -0.5 * (i * i + j * j) + log_weight,
        )
        for i in SCALES
        for j in LENGTHS
        for variance, log_weight in variances
    ]


@dataclass(frozen=True)
class Anchor:
    """A Gaussian prior on the target's position at one time, from which the motion is counted.

    Attributes
    ----------
    time
        In seconds.
    mean, covariance
        ``(d,)`` in metres and ``(d, d)`` in m².
    """

    time: float
    mean: Array
    covariance: Array


@dataclass(frozen=True)
class NodePosterior:
    """The Gaussian conditional under one node.

    Attributes
    ----------
    node
        θ.
    factor
        Lower Cholesky factor of the rows' covariance ``(R, R)``.
    weights
        Its inverse times the values relative to the prior mean ``(R,)``.
    log_evidence
        Log density of the measured angles, in 1/rad a row, plus the node's log prior.
    """

    node: Node
    factor: Array
    weights: Array
    log_evidence: float


@dataclass(frozen=True)
class DisplacementFit:
    """Linearised bearings of a target that moves as ``P_T(t) = p_0 + D(t)``, D under a displacement kernel.

    Attributes
    ----------
    kernel, anchor, noise
        The prior: of D, of p_0, and the sensor.
    samples, rows
        What was measured, and its linearisation.
    trust
        Weight of each row ``(R,)``: 1, or less for a suspected outlier.
    others
        Measurements that are no bearings; their times and places stand behind the samples, their rows behind the rows.
    size
        The true size in metres, if there are angular sizes.
    """

    kernel: DisplacementKernel
    anchor: Anchor
    noise: BearingNoise
    samples: BinnedBearings
    rows: BearingRows
    trust: Array
    others: Sequence[Sighting] = ()
    size: LogNormal | None = None
    # what nodes share: displacement covariances by length scale, noise by σ
    _displacement: dict[float, Array] = field(default_factory=dict, repr=False)
    _rest: dict[float, Array] = field(default_factory=dict, repr=False)

    def solve(self, node: Node) -> NodePosterior:
        """Condition under θ.

        Raises
        ------
        NotPositiveDefiniteError
            If the rows' covariance has no Cholesky factor.
        """
        omega = np.exp(2.0 * node.log_scale) * self._displacements(node.log_length)
        omega += self._anchor_and_noise(node.white_variance)
        factor = _factor(omega)
        values = self.rows.values - self.rows.directions @ self.anchor.mean
        weights = np.asarray(lapack.dpotrs(factor, values, lower=1)[0])
        # a row divided by its range is an angle: so the densities of different linearisations can be compared
        evidence = (
            -0.5 * (values @ weights + len(values) * np.log(2.0 * np.pi))
            - np.log(factor.diagonal()).sum()
            + np.log(self.rows.ranges).sum()
        )
        return NodePosterior(node, factor, weights, float(evidence) + node.log_prior)

    @property
    def latest(self) -> float:
        """Time of the latest bearing in seconds."""
        return float(self.samples.times[len(self.samples) - len(self.others) - 1])

    def _displacements(self, log_length: float) -> Array:
        """Covariance of the rows' displacements at unit scale ``(R, R)``."""
        if log_length not in self._displacement:
            times, sample = self.samples.times - self.anchor.time, self.rows.sample
            unit = self.kernel(times, times, log_length)[np.ix_(sample, sample)]
            self._displacement[log_length] = unit * (self.rows.directions @ self.rows.directions.T)
        return self._displacement[log_length]

    def _anchor_and_noise(self, white_variance: float) -> Array:
        """Covariance of the rows that p_0 and the noise make ``(R, R)`` in m²."""
        if white_variance not in self._rest:
            h = self.rows.directions
            noise = row_covariance(self.rows, self.samples, self.noise, white_variance, self.trust)
            self._rest[white_variance] = h @ self.anchor.covariance @ h.T + noise
        return self._rest[white_variance]

    def predict(self, solution: NodePosterior, times: Array) -> Forecast:
        """Mean ``(K, d)`` and covariance ``(K, d, d)`` at the times ``(K,)`` in seconds under the solution's θ."""
        cross = self._cross(solution.node, times)
        count, steps, dimension = cross.shape
        solved = lapack.dtrtrs(solution.factor, cross.reshape(count, -1), lower=1)[0].reshape(count, steps, dimension)
        solved = solved.transpose(1, 2, 0)
        moved = np.exp(2.0 * solution.node.log_scale) * self.kernel.variance(
            times - self.anchor.time, solution.node.log_length
        )
        prior = moved[:, None, None] * np.eye(dimension) + self.anchor.covariance
        mean = self.anchor.mean + np.tensordot(solution.weights, cross, axes=1)
        return Forecast(mean, prior - solved @ solved.transpose(0, 2, 1))

    def mean(self, solution: NodePosterior, times: Array) -> Array:
        """The mean of :meth:`predict` alone ``(K, d)``."""
        return np.asarray(self.anchor.mean + np.tensordot(solution.weights, self._cross(solution.node, times), axes=1))

    def _cross(self, node: Node, times: Array) -> Array:
        """Covariance of the rows and the position at the times ``(R, K, d)``."""
        h, since = self.rows.directions, self.samples.times - self.anchor.time
        unit = np.exp(2.0 * node.log_scale) * self.kernel(since, times - self.anchor.time, node.log_length)
        return np.asarray(unit[self.rows.sample][:, :, None] * h[:, None, :] + (h @ self.anchor.covariance)[:, None, :])

    def misfit(self, solution: NodePosterior) -> float:
        """By how much half the χ² of the true angles exceeds that of the linearised ones, at the solution's mean.

        Taken off the evidence it makes it Laplace's, of the likelihood of the angles; a linearisation that has not
        settled, or whose target lies opposite to what was measured, is then seen for what it is.
        """
        variance = solution.node.white_variance
        noise = row_covariance(self.rows, self.samples, self.noise, variance, self.trust)
        mean = self.mean(solution, self.samples.times)
        again = rows_with_others(self.samples, self.others, mean, self.noise.std, self.size)
        angles = again.residuals * self.rows.ranges
        weights = solution.weights
        return float(0.5 * ((angles**2 / noise.diagonal()).sum() - weights**2 @ noise.diagonal()))


def _factor(omega: Array) -> Array:
    """Cholesky factor of Ω with the least that makes it one added to its diagonal.

    A path that runs through the vehicle has rows without noise, and a wide anchor hides them in the round-off.
    """
    diagonal = np.diag_indices_from(omega)
    added = SMALLEST_JITTER * float(omega[diagonal].max())
    for _ in range(JITTERS):
        omega[diagonal] += added
        try:
            return cholesky(omega)
        except NotPositiveDefiniteError:
            added *= 100.0
    raise NotPositiveDefiniteError


@dataclass(frozen=True)
class PosteriorMixture:
    """Solutions with their weights.

    Attributes
    ----------
    parts
        Fits, solutions and weights, which sum to one.
    log_evidence
        Logarithm of the summed evidence.
    """

    parts: tuple[tuple[DisplacementFit, NodePosterior, float], ...]
    log_evidence: float

    @classmethod
    def over(cls, fit: DisplacementFit, nodes: Sequence[Node]) -> PosteriorMixture:
        """The average over a grid; nodes whose covariance has no Cholesky factor count as impossible.

        Raises
        ------
        NotPositiveDefiniteError
            If no node has one.
        """
        found = []
        for node in nodes:
            try:
                found.append(fit.solve(node))
            except NotPositiveDefiniteError:
                continue
        if not found:
            raise NotPositiveDefiniteError
        return cls._weighted([(fit, solution, solution.log_evidence) for solution in found])

    @classmethod
    def of(cls, mixtures: Sequence[PosteriorMixture], log_priors: Sequence[float]) -> PosteriorMixture:
        """The mixture of mixtures by evidence, each with the logarithm of its prior weight."""
        return cls._weighted(
            [
                (fit, solution, mixture.log_evidence + log_prior + float(np.log(weight)))
                for mixture, log_prior in zip(mixtures, log_priors, strict=True)
                for fit, solution, weight in mixture.parts
            ]
        )

    @classmethod
    def _weighted(cls, parts: Sequence[tuple[DisplacementFit, NodePosterior, float]]) -> PosteriorMixture:
        logs = np.array([log for _, _, log in parts])
        largest = float(logs.max())
        weights = np.exp(logs - largest)
        kept = [int(i) for i in np.flatnonzero(weights > LEAST_SHARE)]
        share = weights[kept] / weights[kept].sum()
        chosen = tuple((*parts[i][:2], float(w)) for i, w in zip(kept, share, strict=True))
        return cls(chosen, largest + float(np.log(weights.sum())))

    @property
    def best(self) -> tuple[DisplacementFit, NodePosterior]:
        """The heaviest part."""
        fit, solution, _ = max(self.parts, key=lambda part: part[2])
        return fit, solution

    def predict(self, times: Array) -> Forecast:
        """Mean ``(K, d)`` and covariance ``(K, d, d)`` of the mixture at the times ``(K,)`` in seconds."""
        weights = np.array([weight for _, _, weight in self.parts])
        forecasts = [fit.predict(solution, times) for fit, solution, _ in self.parts]
        return Forecast(*mixed(weights, *map(np.array, zip(*forecasts, strict=True))))
