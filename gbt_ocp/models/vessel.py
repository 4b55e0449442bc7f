"""A surface vessel with two thrusters side by side."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from gbt_ocp.models.driven import DrivenBody, smooth_square
from gbt_ocp.models.fossen import DRAG_SMOOTHING
from gbt_ocp.models.sizes import positive

STRIPS = 8
"""Points of the quadrature (Gauss-Legendre) over the length of the hull that sums the cross-flow drag."""


@dataclass(frozen=True)
class VesselParameters:
    """Coefficients of a surface vessel on two pontoons; Fossen's signs, SI units.

    Parameters
    ----------
    mass, inertia
        m in kg; I about the vertical through the middle of the hull in kg m².
    ahead
        How far the centre of gravity lies before the middle, m.
    added_mass
        X_u̇, Y_v̇ in kg, N_ṙ in kg m².
    drag
        X_u, Y_v in N s/m, N_r in N m s, all below 0.
    yaw_drag_growth
        How much N_r grows with the yaw rate: ``N_r (1 + k |r|)``, in s/rad.
    length, cross_flow
        Of the hull in m; drag to one side in N s²/m² for each metre of it.
    lever
        How far from the middle a thruster acts, m.

    Raises
    ------
    ValueError
        If mass, inertia, length or lever are not above 0.
    """

    mass: float
    inertia: float
    ahead: float
    added_mass: tuple[float, float, float]
    drag: tuple[float, float, float]
    yaw_drag_growth: float
    length: float
    cross_flow: float
    lever: float

    def __post_init__(self) -> None:
        for name in ("mass", "inertia", "length", "lever"):
            positive(name, getattr(self, name))


_OTTER_INERTIA = 55.0 * (0.5**2 + 0.2**2)
_OTTER_DRAUGHT = 55.0 / 1025.0 / (2.0 * 0.4 * 0.25 * 2.0)

OTTER = VesselParameters(
    mass=55.0,
    inertia=_OTTER_INERTIA,
    ahead=0.2,
    added_mass=(-2.7 * 1025.0 * (55.0 / 1025.0) ** (5.0 / 3.0) / 2.0**2, -82.5, -1.7 * _OTTER_INERTIA),
    drag=(-24.4 * 9.81 / (6.0 * 0.5144), -137.5, -2.7 * _OTTER_INERTIA),
    yaw_drag_growth=10.0,
    length=2.0,
    cross_flow=0.5 * 1026.0 * _OTTER_DRAUGHT * 0.846,
    lever=0.395,
)
"""The Otter of Maritime Robotics without payload, 2 m long, 55 kg: ``otter`` of T. I. Fossen's Marine Systems Simulator
(2019 to 2024; Handbook of Marine Craft Hydrodynamics and Motion Control, 2nd ed., Wiley 2021). Added mass in surge by
Söding's formula, time constants of 1 s in sway and yaw, X_u from 24.4 kgf at 6 knots, cross-flow drag by strips with
Hoerner's coefficient of 0.846 for a pontoon of 0.25 m by 0.134 m. The Munk moment is left out, as ``otter.py`` of the
Python Vehicle Simulator does."""

OTTER_THRUST = (0.5 * 24.4 * 9.81, 0.5 * 13.6 * 9.81)
"""Largest thrust of one of its two thrusters in N, ahead and astern (the same source)."""


class TwinThrusterVessel(DrivenBody):
    """A surface vessel that is driven and steered by two thrusters, port and starboard, in N.

    Parameters
    ----------
    parameters
        Coefficients.
    thrust_max
        Of the port and the starboard thruster in N ``(2,)``.
    thrust_min
        Likewise, astern; by default -τ_max.

    Raises
    ------
    ValueError
        See :class:`~gbt_ocp.models.driven.DrivenBody`.
    """

    input_names: ClassVar = {2: ("port", "starboard")}
    input_units: ClassVar = {2: ("N", "N")}

    def __init__(
        self, parameters: VesselParameters, thrust_max: ArrayLike, thrust_min: ArrayLike | None = None
    ) -> None:
        self.parameters = parameters
        nodes, weights = np.polynomial.legendre.leggauss(STRIPS)
        self._strips = 0.5 * parameters.length * nodes, 0.5 * parameters.length * weights
        mass = np.diag([parameters.mass, parameters.mass, parameters.inertia] - np.array(parameters.added_mass))
        mass[1, 2] = mass[2, 1] = parameters.mass * parameters.ahead
        self._inverse = np.linalg.inv(mass)
        lower = -np.asarray(thrust_max, dtype=float) if thrust_min is None else thrust_min
        super().__init__(2, thrust_max, lower)

    def body_rates(self, eta: Any, nu: Any, inputs: Any) -> Any:
        """ν̇ ``(3,)`` of ``M ν̇ + C_RB(ν) ν = D(ν) ν + τ``."""
        own, (u, v, r) = self.parameters, ca.vertsplit(nu)
        cross, twist = 0.0, 0.0
        for place, width in zip(*self._strips, strict=True):
            drag = -own.cross_flow * float(width) * smooth_square(v + float(place) * r, DRAG_SMOOTHING)
            cross, twist = cross + drag, twist + float(place) * drag
        growth = 1.0 + own.yaw_drag_growth * ca.sqrt(r**2 + DRAG_SMOOTHING)
        forces = ca.vertcat(
            inputs[0] + inputs[1] + own.drag[0] * u + own.mass * (v + own.ahead * r) * r,
            own.drag[1] * v + cross - own.mass * u * r,
            own.lever * (inputs[1] - inputs[0]) + own.drag[2] * growth * r + twist - own.mass * own.ahead * u * r,
        )
        return ca.mtimes(ca.DM(self._inverse), forces)

    def input_velocities(self, state: Any) -> Any:
        """Those of the two thrusters ahead."""
        u, r = state[3], state[5]
        return ca.vertcat(u - self.parameters.lever * r, u + self.parameters.lever * r)

    def steered(self, push: Any, turn: Any) -> Any:
        """Both thrusters, with the difference for the turn first."""
        half = turn * float(np.min(np.minimum(self.thrust_max, -self.thrust_min)))
        ahead = ca.fmin(push * float(np.mean(self.thrust_max)), float(np.min(self.thrust_max)) - ca.fabs(half))
        return ca.vertcat(ahead - half, ahead + half)
