"""The linear model of coregionalization (section 3.3): ``P_T(t) = centre + A P_u(t)``, latent functions independent.

``k_f(t, t') = A diag(k_1, …, k_Q) Aᵀ = Σ_q a_q a_qᵀ k_q(t, t')``. Scaling a latent function and its column a_q the
other way changes nothing, so every k_q has unit variance and A is in metres. What stays free changes no covariance and
needs no remedy: the sign of each column, the order of the latent functions with their columns, and, among latent
functions that share kernel and parameters, any rotation of their columns. The matrices ``B_q = a_q a_qᵀ`` (summed where
kernels coincide) are what the data can tell.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gbt_ocp.tracking.gp.kernels import Kernel
from gbt_ocp.tracking.gp.likelihood import gaussian_expansion
from gbt_ocp.tracking.gp.posterior import Conditional
from gbt_ocp.tracking.gp.root import Root, root_of
from gbt_ocp.tracking.priors import LogNormal
from gbt_ocp.tracking.window import Measurements
from gbt_ocp.typing import Array


@dataclass(frozen=True)
class CoregionalizedHyperparameters:
    """θ of a coregionalised process.

    Attributes
    ----------
    log_kernels
        Logarithms of each latent function's kernel parameters; the first is that of its length scale in seconds.
    weights
        A ``(d, Q)`` in metres.
    nugget
        Variance of a measurement relative to the amplitude squared.
    """

    log_kernels: tuple[Array, ...]
    weights: Array
    nugget: float

    @property
    def length_scales(self) -> Array:
        """l_q in seconds ``(Q,)``."""
        return np.exp([parameters[0] for parameters in self.log_kernels])

    @property
    def length_scale(self) -> float:
        """Length scale in seconds of the latent function that moves the target most."""
        return float(self.length_scales[np.argmax(np.sum(self.weights**2, axis=0))])

    @property
    def amplitude(self) -> float:
        """Root mean square over the coordinates of their standard deviations, in metres."""
        return amplitude_of(self.weights)

    @property
    def coregionalization(self) -> Array:
        """B_q = a_q a_qᵀ ``(Q, d, d)`` in m²."""
        columns = self.weights.T
        return np.asarray(columns[:, :, None] * columns[:, None, :])


def amplitude_of(weights: Array) -> float:
    """``√(tr(A Aᵀ)/d)``: a where A = a I."""
    return float(np.sqrt(np.sum(weights**2) / len(weights)))


class CoregionalizedPosterior(Conditional):
    """Conditions the coregionalised process on measurements.

    Parameters
    ----------
    kernels
        k_q, one a latent function.
    hyperparameters
        θ.
    measurements
        What was measured.
    centre
        Prior mean ``(d,)``.
    rounding
        As of :class:`~gbt_ocp.tracking.gp.posterior.Posterior`.

    Raises
    ------
    NotPositiveDefiniteError
        If Ω_yy has no Cholesky factor.
    """

    def __init__(
        self,
        kernels: Sequence[Kernel],
        hyperparameters: CoregionalizedHyperparameters,
        measurements: Measurements,
        centre: Array,
        rounding: float = 0.0,
    ) -> None:
        self._kernels = kernels
        self._theta = hyperparameters
        t = measurements.times
        self._seen = measurements.directions @ hyperparameters.weights
        process: Array | Root | None = root_of(
            kernels, measurements, centre, hyperparameters.length_scales, hyperparameters.weights,
            hyperparameters.nugget, rounding,
        )  # fmt: skip
        if process is None:
            k = self._latent(t[:, None] - t[None, :])
            process = np.einsum("rq,sq,qrs->rs", self._seen, self._seen, k)
        super().__init__(measurements, centre, process, hyperparameters.amplitude**2 * hyperparameters.nugget)
        if not len(t):  # the row that stands for none
            self._seen = np.zeros((1, len(kernels)))

    def _latent(self, lag: Array) -> Array:
        """k_q at the lags ``(Q, ...)``."""
        pairs = zip(self._kernels, self._theta.log_kernels, strict=True)
        return np.array([kernel(lag, parameters) for kernel, parameters in pairs])

    @property
    def hyperparameters(self) -> CoregionalizedHyperparameters:
        """θ with the nugget that was needed."""
        return self._theta

    @property
    def prior_covariance(self) -> Array:
        """k_f(t, t) = A Aᵀ ``(d, d)`` in m²; its off-diagonal entries are R_xy, R_xz, R_yz."""
        return np.asarray(self._theta.weights @ self._theta.weights.T)

    def covariances(self, times: Array, others: Array) -> Array:
        """k_f between two sets of times ``(K,)``, ``(N,)``: ``(K, N, d, d)`` in m²."""
        weights = self._theta.weights
        k = self._latent(times[:, None] - others[None, :])
        return np.asarray(np.einsum("aq,qij,bq->ijab", weights, k, weights))

    def _among(self, times: Array) -> Array:
        return self.covariances(times, times).transpose(0, 2, 1, 3)

    def _cross(self, times: Array) -> Array:
        k = self._latent(self._data.times[:, None] - times[None, :])
        return np.asarray(np.einsum("rq,qrk,dq->rkd", self._seen, k, self._theta.weights))


class CoregionalizedLikelihood:
    """Log likelihood of the pseudo-linear measurements by θ, with its gradient and Fisher information.

    The parameters are a vector: the logarithms of all kernels' parameters, latent function by latent function, then A
    in units of ``unit`` row by row, then the logarithm of the nugget where it is tuned.

    Parameters
    ----------
    kernels
        k_q, one a latent function.
    measurements
        Rows of the window.
    centre
        Prior mean ``(d,)``.
    nugget
        Variance relative to the amplitude squared; ``None`` makes its logarithm the last parameter.
    unit
        Metres in which A counts, about its size: steps of the search are then relative.
    amplitude_prior
        Weak prior on the amplitude ``√(tr(A Aᵀ)/d)``, added to the likelihood.
    """

    def __init__(
        self,
        kernels: Sequence[Kernel],
        measurements: Measurements,
        centre: Array,
        nugget: float | None,
        *,
        unit: float = 1.0,
        amplitude_prior: LogNormal | None = None,
    ) -> None:
        self._kernels = kernels
        self._lag = measurements.times[:, None] - measurements.times[None, :]
        self._directions = measurements.directions
        self._values = measurements.relative_to(centre)
        self._variances = measurements.variances
        self._nugget = nugget
        self._unit = unit
        self._amplitude_prior = amplitude_prior

    def pack(self, theta: CoregionalizedHyperparameters) -> Array:
        """θ as a vector."""
        last = [np.log([theta.nugget])] if self._nugget is None else []
        return np.concatenate([*theta.log_kernels, theta.weights.ravel() / self._unit, *last])

    def unpack(self, parameters: Array) -> CoregionalizedHyperparameters:
        """θ of a vector."""
        ends = np.cumsum([len(kernel.names) for kernel in self._kernels])
        log_kernels = tuple(np.split(parameters[: ends[-1]], ends[:-1]))
        dimension, count = self._directions.shape[1], len(self._kernels)
        weights = self._unit * parameters[ends[-1] : ends[-1] + dimension * count].reshape(dimension, count)
        return CoregionalizedHyperparameters(log_kernels, weights, self.nugget(parameters))

    def nugget(self, parameters: Array) -> float:
        """The nugget of a vector, tuned or not."""
        return float(np.exp(parameters[-1])) if self._nugget is None else self._nugget

    def __call__(self, parameters: Array) -> tuple[float, Array]:
        """Value and gradient by the parameters; see :meth:`expand`."""
        return self.expand(parameters)[:2]

    def expand(self, parameters: Array) -> tuple[float, Array, Array]:
        """Value, gradient, and Fisher information by the parameters.

        With ``u_q`` the rows' directions times a_q, ``∂Ω/∂A_iq = (h_i u_qᵀ + u_q h_iᵀ) ∘ K_q``, h_i the i-th
        coordinate of the directions, and on the diagonal what the nugget gains with the amplitude.

        Raises
        ------
        NotPositiveDefiniteError
            If Ω has no Cholesky factor.
        """
        theta, h = self.unpack(parameters), self._directions
        dimension, rows = h.shape[1], len(h)
        noise = theta.amplitude**2 * theta.nugget
        seen = h @ theta.weights
        diagonal = np.arange(rows)
        omega = np.zeros((rows, rows))
        kernel_slopes: list[Array] = []
        weight_slopes = np.empty((dimension, len(self._kernels), rows, rows))
        for q, (kernel, log_kernel) in enumerate(zip(self._kernels, theta.log_kernels, strict=True)):
            k, derivatives = kernel.derivatives(self._lag, log_kernel)
            outer = np.outer(seen[:, q], seen[:, q])
            omega += outer * k
            kernel_slopes += [outer * dk for dk in derivatives]
            half = self._unit * h.T[:, :, None] * (seen[:, q] * k)
            weight_slopes[:, q] = half + np.swapaxes(half, 1, 2)
        growth = 2.0 * self._unit * theta.nugget / dimension * theta.weights
        weight_slopes[:, :, diagonal, diagonal] += growth[:, :, None]
        omega[diagonal, diagonal] += noise + self._variances
        slopes = [*kernel_slopes, *weight_slopes.reshape(-1, rows, rows)]
        if self._nugget is None:
            slopes.append(np.diag(np.full(rows, noise)))
        expansion = gaussian_expansion(self._values, omega, np.array(slopes))
        return self._with_prior(theta, len(kernel_slopes), *expansion)

    def _with_prior(
        self, theta: CoregionalizedHyperparameters, first: int, value: float, gradient: Array, information: Array
    ) -> tuple[float, Array, Array]:
        """Add the prior on the amplitude; A begins at the entry ``first``."""
        prior = self._amplitude_prior
        if prior is not None:
            part = slice(first, first + theta.weights.size)
            density, slope = prior(float(np.log(theta.amplitude)))
            # of the logarithm of the amplitude by A
            turn = self._unit * theta.weights.ravel() / np.sum(theta.weights**2)
            value += density
            gradient[part] += slope * turn
            information[part, part] += np.outer(turn, turn) / prior.log_std**2
        return value, gradient, information
