"""Fossen's equations of a marine vehicle and their flatness map (``eq2``, ``eq30``)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from gbt_ocp.models.sizes import not_negative, vector
from gbt_ocp.typing import Array

DRAG_SMOOTHING = 1.0e-4
"""ε in m²/s² (rad²/s² in yaw) of the smoothed drag ``sqrt(u² + ε) u``: ``|u| u`` has no second derivative at rest,
which Newton's method needs there. The force differs from ``|u| u`` by at most ε/2 times the coefficient."""


def rotation(yaw: float, size: int) -> Array:
    """J(η): body to earth frame, a turn about the vertical; identity on heave and yaw. Returns ``(size, size)``."""
    c, s = np.cos(yaw), np.sin(yaw)
    if size == 3:
        return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    turn = np.eye(size)
    turn[0, 0] = turn[1, 1] = c
    turn[1, 0], turn[0, 1] = s, -s
    return turn


@dataclass(frozen=True)
class FossenParameters:
    """Rigid-body and hydrodynamic coefficients of a 3-DOF or 4-DOF Fossen model.

    Sequences run over (surge, sway, yaw) or (surge, sway, heave, yaw). Added mass is given with Fossen's sign
    (negative), drag with positive sign.

    Parameters
    ----------
    mass
        m in kg.
    inertia
        I about the vertical in kg m².
    added_mass
        X_u̇, Y_v̇, (Z_ẇ,) N_ṙ in kg, kg, (kg,) kg m².
    linear_drag
        X_u, Y_v, (Z_w,) N_r in N s/m and N m s.
    quadratic_drag
        D_u, D_v, (D_w,) D_r in N s²/m² and N m s².

    Raises
    ------
    ValueError
        If the sequences differ in length, a number is not finite, a drag is below 0, or mass less added mass is not
        above it.
    """

    mass: float
    inertia: float
    added_mass: Sequence[float]
    linear_drag: Sequence[float]
    quadratic_drag: Sequence[float]

    def __post_init__(self) -> None:
        sizes = {len(self.added_mass), len(self.linear_drag), len(self.quadratic_drag)}
        if sizes not in ({3}, {4}):
            raise ValueError(
                f"added_mass, linear_drag and quadratic_drag must all have 3 or all 4 entries, found {sorted(sizes)}"
            )
        for name in ("linear_drag", "quadratic_drag"):
            for value in getattr(self, name):
                not_negative(name, value)
        if not np.all((self.inertia_diagonal > 0.0) & np.isfinite(self.inertia_diagonal)):
            raise ValueError(f"mass minus added mass must be positive, found {self.inertia_diagonal.tolist()}")

    @property
    def inertia_diagonal(self) -> Array:
        """Diagonal of M, rigid body plus added mass ``(n,)``."""
        rigid = np.full(len(self.added_mass), self.mass)
        rigid[-1] = self.inertia
        return np.asarray(rigid - np.asarray(self.added_mass, dtype=float))


FALCON_2D = FossenParameters(116.0, 13.1, (-167.6, -477.2, -15.9), (26.9, 35.8, 3.5), (241.3, 503.8, 76.9))
"""The Falcon in the plane: section 5.1 of the paper, after Shen, Shi and Buckham (2016)."""

FALCON_3D = FossenParameters(
    116.0, 13.1, (-167.6, -477.2, -235.7, -15.9), (26.9, 35.8, 6.19, 3.5), (241.3, 503.8, 119.1, 76.9)
)
"""The Falcon with heave: section 5.1 of the paper."""


def along_body(c: Any, s: Any, dz: Any) -> list[Any]:
    """Components of an earth-frame vector ``(n,)`` along the body's axes, at a yaw of that cosine and sine."""
    rest = [dz[index] for index in range(2, dz.shape[0])]
    return [c * dz[0] + s * dz[1], -s * dz[0] + c * dz[1], *rest]


class FossenVehicle:
    """Fossen's equations in the plane (3-DOF) or with heave (4-DOF), fully actuated (``eq2``).

    ``M ν̇ + C(ν) ν + D(ν) ν = τ``, ``η̇ = J(η) ν`` with the mass distribution homogeneous, so that M is diagonal.
    The flat output is the pose, ``z = [P_A, ψ]``; the state of the forward dynamics is ``[η, ν]``.

    Parameters
    ----------
    parameters
        Coefficients; three entries a sequence make a planar vehicle, four a vehicle with heave.
    thrust_max
        τ_max: forces in N on each axis, then the yaw moment in N m, ``(n,)``.
    thrust_min
        τ_min in the same units ``(n,)``, all below 0; by default -τ_max.

    Raises
    ------
    ValueError
        If the limits do not fit the coefficients, or are not on their side of 0.
    """

    def __init__(
        self, parameters: FossenParameters, thrust_max: ArrayLike, thrust_min: ArrayLike | None = None
    ) -> None:
        self.parameters = parameters
        self.flat_dimension = len(parameters.added_mass)
        self.position_dimension = self.flat_dimension - 1
        self.thrust_max = vector("thrust_max", thrust_max, self.flat_dimension, above_zero=True)
        self.thrust_min: Array | None = None
        if thrust_min is not None:
            lower = np.asarray(thrust_min, dtype=float)
            self.thrust_min = -vector("minus thrust_min", -lower, self.flat_dimension, above_zero=True)
        self._inertia = parameters.inertia_diagonal
        self._linear_drag = np.asarray(parameters.linear_drag, dtype=float)
        self._quadratic_drag = np.asarray(parameters.quadratic_drag, dtype=float)
        scale = self.thrust_max / self._inertia
        # Any horizontal axis may be turned towards any thruster, so both share the geometric mean.
        scale[:2] = np.sqrt(scale[0] * scale[1])
        self.acceleration_scale = scale

    def inputs(self, z: Any, dz: Any, ddz: Any) -> Any:
        """Thrust ``τ = M ν̇ + C(ν)ν + D(ν)ν`` with ``ν = Jᵀż``, ``ν̇ = Jᵀz̈ + J̇ᵀż``.

        This is ``eq30`` with its misprint corrected: there C multiplies ż in earth axes.
        """
        c, s, r = ca.cos(z[-1]), ca.sin(z[-1]), dz[-1]
        heave_rate = [ddz[2]] if self.flat_dimension == 4 else []
        u, v, *others = along_body(c, s, dz)
        # J̇ᵀż is the turn of the body frame: (r v, -r u)
        u_rate = c * ddz[0] + s * ddz[1] + r * v
        v_rate = -s * ddz[0] + c * ddz[1] - r * u
        nu = ca.vertcat(u, v, *others)
        nu_rate = ca.vertcat(u_rate, v_rate, *heave_rate, ddz[-1])
        m = self._inertia
        coriolis = ca.vertcat(-m[1] * v * r, m[0] * u * r, *(0.0 for _ in heave_rate), (m[1] - m[0]) * u * v)
        drag = (ca.DM(self._linear_drag) + ca.DM(self._quadratic_drag) * ca.sqrt(nu**2 + DRAG_SMOOTHING)) * nu
        return ca.DM(m) * nu_rate + coriolis + drag

    def body_velocity(self, z: Any, dz: Any) -> Any:
        """``ν = Jᵀż`` ``(n,)``, a CasADi expression: with τ, what the thrusters' power is made of (``Σ|τ_i ν_i|``)."""
        return ca.vertcat(*along_body(ca.cos(z[-1]), ca.sin(z[-1]), dz))

    def coriolis_matrix(self, nu: ArrayLike) -> Array:
        """C(ν) ``(n, n)``, skew-symmetric, with the added mass in it (Fossen 2011, section 6.3)."""
        u, v = np.asarray(nu, dtype=float)[:2]
        matrix = np.zeros((self.flat_dimension, self.flat_dimension))
        matrix[0, -1] = -self._inertia[1] * v
        matrix[1, -1] = self._inertia[0] * u
        return matrix - matrix.T

    def damping_matrix(self, nu: ArrayLike) -> Array:
        """D(ν) ``(n, n)``, diagonal: linear plus smoothed quadratic drag."""
        speed = np.sqrt(np.asarray(nu, dtype=float) ** 2 + DRAG_SMOOTHING)
        return np.diag(self._linear_drag + self._quadratic_drag * speed)

    def rates(self, state: Any, thrust: Any) -> Any:
        """Time derivative of ``[η, ν]`` ``(2n,)`` under the thrust ``(n,)``; CasADi expressions give one."""
        if isinstance(state, ca.SX | ca.MX):
            return self._symbolic_rates(state, thrust)
        # Called a dozen times a step: C(ν)ν and J ν written out cost a fifth of the products with their matrices.
        x, n, m = np.asarray(state, dtype=float), self.flat_dimension, self._inertia
        nu = x[n:]
        u, v, r, c, s = x[n], x[n + 1], x[-1], math.cos(x[n - 1]), math.sin(x[n - 1])
        resistance = (self._linear_drag + self._quadratic_drag * np.sqrt(nu * nu + DRAG_SMOOTHING)) * nu
        resistance[0] -= m[1] * v * r
        resistance[1] += m[0] * u * r
        resistance[-1] += (m[1] - m[0]) * u * v
        rates = np.empty(2 * n)
        rates[:n] = nu
        rates[0], rates[1] = c * u - s * v, s * u + c * v
        rates[n:] = (thrust - resistance) / m
        return rates

    def _symbolic_rates(self, state: Any, thrust: Any) -> Any:
        """The same in CasADi, from the matrices that :meth:`rates` has written out."""
        n, m, nu = self.flat_dimension, self._inertia, state[self.flat_dimension :]
        u, v, r, c, s = nu[0], nu[1], nu[-1], ca.cos(state[n - 1]), ca.sin(state[n - 1])
        heave = [nu[2]] if n == 4 else []
        coriolis = ca.vertcat(-m[1] * v * r, m[0] * u * r, *(0.0 for _ in heave), (m[1] - m[0]) * u * v)
        drag = (ca.DM(self._linear_drag) + ca.DM(self._quadratic_drag) * ca.sqrt(nu**2 + DRAG_SMOOTHING)) * nu
        earth = ca.vertcat(c * u - s * v, s * u + c * v, *heave, r)
        return ca.vertcat(earth, (thrust - coriolis - drag) / ca.DM(m))

    def state(self, z: ArrayLike, dz: ArrayLike) -> Array:
        """State ``[η, ν]`` ``(2n,)``: Ψ_x of ``eq30``."""
        z = np.asarray(z, dtype=float)
        return np.concatenate([z, rotation(z[-1], len(z)).T @ np.asarray(dz, dtype=float)])

    def flat(self, state: ArrayLike) -> tuple[Array, Array]:
        """Flat output and rate: ``z = η``, ``ż = J ν``."""
        x, n = np.asarray(state, dtype=float), self.flat_dimension
        return x[:n], rotation(x[n - 1], n) @ x[n:]

    def pose(self, state: ArrayLike) -> Array:
        """Position and yaw ``(n,)``."""
        return np.asarray(state, dtype=float)[: self.flat_dimension]

    def velocity(self, state: ArrayLike) -> Array:
        """Body velocities ν ``(n,)``."""
        return np.asarray(state, dtype=float)[self.flat_dimension :]
