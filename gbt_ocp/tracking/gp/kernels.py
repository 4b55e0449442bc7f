"""Covariance functions of time, of unit amplitude, with the derivatives that tuning needs.

A kernel is a function of the lag and of the logarithms of its parameters; the first parameter is always the length
scale in seconds. Source: Rasmussen and Williams (2006), chapter 4.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np

from gbt_ocp.typing import Array


def squared_exponential(lag: Array) -> Array:
    """``k = exp(-a²/2)`` at lags over the length scale, a (any shape, either sign)."""
    return np.asarray(np.exp(-0.5 * lag**2))


def matern32(lag: Array) -> Array:
    """``k = (1 + s) exp(-s)``, s = √3 |a|, at lags over the length scale, a (any shape, either sign)."""
    s = np.sqrt(3.0) * np.abs(lag)
    return np.asarray((1.0 + s) * np.exp(-s))


def ornstein_uhlenbeck(lag: Array) -> Array:
    """``k = exp(-|a|)`` at lags over the length scale, a (any shape, either sign)."""
    return np.asarray(np.exp(-np.abs(lag)))


class Kernel(Protocol):
    """A stationary covariance function with ``k(0) = 1``."""

    @property
    def names(self) -> tuple[str, ...]:
        """Parameter names; the first is ``length_scale``."""

    def __call__(self, lag: Array, log_parameters: Array) -> Array:
        """k at the lags (any shape, in seconds)."""

    def derivatives(self, lag: Array, log_parameters: Array) -> tuple[Array, list[Array]]:
        """k at the lags, and its derivative by the logarithm of each parameter."""


class SquaredExponential:
    """``k = exp(-r²/(2 l²))``, the paper's kernel."""

    names = ("length_scale",)

    def __call__(self, lag: Array, log_parameters: Array) -> Array:
        """k at the lags."""
        return squared_exponential(lag * np.exp(-log_parameters[0]))

    def derivatives(self, lag: Array, log_parameters: Array) -> tuple[Array, list[Array]]:
        """``∂k/∂log l = k r²/l²``."""
        scaled = lag * np.exp(-log_parameters[0])
        value = squared_exponential(scaled)
        return value, [value * scaled**2]


class Matern32:
    """Matérn 3/2: ``k = (1 + s) exp(-s)``, ``s = √3 r/l``."""

    names = ("length_scale",)

    def __call__(self, lag: Array, log_parameters: Array) -> Array:
        """k at the lags."""
        return matern32(lag * np.exp(-log_parameters[0]))

    def derivatives(self, lag: Array, log_parameters: Array) -> tuple[Array, list[Array]]:
        """``∂k/∂log l = s² exp(-s)``."""
        scaled = lag * np.exp(-log_parameters[0])
        s = np.sqrt(3.0) * np.abs(scaled)
        return matern32(scaled), [s * s * np.exp(-s)]


class Matern52:
    """Matérn 5/2: ``k = (1 + s + s²/3) exp(-s)``, ``s = √5 r/l``."""

    names = ("length_scale",)

    def __call__(self, lag: Array, log_parameters: Array) -> Array:
        """k at the lags."""
        return self.derivatives(lag, log_parameters)[0]

    def derivatives(self, lag: Array, log_parameters: Array) -> tuple[Array, list[Array]]:
        """``∂k/∂log l = s² (1 + s)/3 exp(-s)``."""
        s = np.sqrt(5.0) * np.abs(lag) * np.exp(-log_parameters[0])
        decay = np.exp(-s)
        return (1.0 + s + s * s / 3.0) * decay, [s * s * (1.0 + s) / 3.0 * decay]


class RationalQuadratic:
    """``k = (1 + r²/(2 α l²))^(-α)``: a mixture of squared exponentials of many length scales."""

    names = ("length_scale", "alpha")

    def __call__(self, lag: Array, log_parameters: Array) -> Array:
        """k at the lags."""
        return self.derivatives(lag, log_parameters)[0]

    def derivatives(self, lag: Array, log_parameters: Array) -> tuple[Array, list[Array]]:
        """Derivatives by log l and log α."""
        alpha = np.exp(log_parameters[1])
        square = (lag * np.exp(-log_parameters[0])) ** 2
        grown = square / (2.0 * alpha)
        log_base = np.log1p(grown)
        value = np.exp(-alpha * log_base)
        return value, [value * square / (1.0 + grown), value * alpha * (grown / (1.0 + grown) - log_base)]


KERNELS: dict[str, Kernel] = {
    "se": SquaredExponential(),
    "matern32": Matern32(),
    "matern52": Matern52(),
    "rq": RationalQuadratic(),
}
"""Kernels by their names in a configuration."""
