"""A torpedo in the plane and in space: thrust and fins, sway and heave free."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, ClassVar

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from gbt_ocp.models.driven import DrivenBody, smooth_square
from gbt_ocp.models.fossen import DRAG_SMOOTHING
from gbt_ocp.models.sizes import positive

LOITER_PUSH, LOITER_TURN = 0.6, 0.5
"""Shares of thrust and rudder with which a torpedo circles where nothing can be planned."""


@dataclass(frozen=True)
class TorpedoParameters:
    """Coefficients of an axisymmetric hull with a propeller and cruciform fins at the stern.

    The same hold across and upright: of the force F and the moment N that follow from the velocity s to one side and
    the turn rate ω towards it. With Fossen's signs, in SI units.

    Parameters
    ----------
    mass, inertia
        m in kg; I about an axis across in kg m².
    added_mass
        X_u̇, Y_v̇ in kg, N_ṙ in kg m².
    surge_drag
        X_u in N s/m, X_uu in N s²/m².
    force
        Y_v, Y_r, Y_vv, Y_rr: of s, ω and their signed squares.
    moment
        N_v, N_r, N_vv, N_rr, likewise.
    force_lift, moment_lift
        Y_uv, Y_ur and N_uv, N_ur: of us and uω, hull and fins.
    fin_force, fin_arm
        Force of a fin in N s²/(m² rad), for ``u² δ``, and how far astern it acts in m.
    righting
        Moment in N m that rights the vehicle, for the sine of the pitch.

    Raises
    ------
    ValueError
        If mass, inertia, force or arm of the fins are not above 0.
    """

    mass: float
    inertia: float
    added_mass: tuple[float, float, float]
    surge_drag: tuple[float, float]
    force: tuple[float, float, float, float]
    moment: tuple[float, float, float, float]
    force_lift: tuple[float, float]
    moment_lift: tuple[float, float]
    fin_force: float
    fin_arm: float
    righting: float

    def __post_init__(self) -> None:
        for name in ("mass", "inertia", "fin_force", "fin_arm"):
            positive(name, getattr(self, name))


_BODY_LIFT = -0.5 * 1000.0 * math.pi * 0.075**2 * 1.24
_FIN_LIFT = 1000.0 * 3.0 * 64.0e-4

LAUV = TorpedoParameters(
    mass=18.0,
    inertia=0.2 * 18.0 * (0.54**2 + 0.075**2),
    added_mass=(-1.0, -16.0, -1.3),
    surge_drag=(-2.4, -2.4),
    force=(-23.0, 11.5, -80.0, 0.3),
    moment=(-3.1, -9.7, -1.5, -9.1),
    force_lift=(_BODY_LIFT - _FIN_LIFT, 0.4 * _FIN_LIFT),
    moment_lift=((-0.65 * 1.08 + 0.4) * _BODY_LIFT + 0.4 * _FIN_LIFT, -(0.4**2) * _FIN_LIFT),
    fin_force=_FIN_LIFT,
    fin_arm=0.4,
    righting=0.01 * 18.0 * 9.81,
)
"""The LAUV, 1.08 m long, 18 kg: da Silva, Terra, Martins and de Sousa, "Modeling and Simulation of the LAUV Autonomous
Underwater Vehicle", 13th IEEE IFAC Int. Conf. on Methods and Models in Automation and Robotics, Szczecin, 2007. Damping
is that of its tables, lift that of its formulas: of the hull ``ρ π r² 1.24/2`` at 0.65 of the length, of the fins ``3 ρ
S`` with S = 64 cm² at 0.4 m astern; the inertia is that of the ellipsoid. Weight and buoyancy are taken as equal."""

LAUV_THRUST = 14.0
"""Largest thrust of the LAUV in N, good for 1.97 m/s (Havenstrøm, "From Beginner to Expert", NTNU 2020)."""

LAUV_FIN = math.radians(30.0)
"""Largest angle of its fins in rad (the same)."""


class Torpedo(DrivenBody):
    """A torpedo: thrust in N, and the angle of its rudder, in space of its elevator too, in rad.

    A positive rudder turns to port, a positive elevator lifts the bow. The force of a fin grows with the square of the
    speed, so that there is a least speed for steering, and a turn has a radius that hardly depends on the speed.

    Parameters
    ----------
    dimension
        d, 2 or 3.
    parameters
        Coefficients.
    thrust_max
        Thrust in N and angles of the fins in rad ``(2,)`` or ``(3,)``.
    thrust_min
        Likewise; by default 0 and minus the angles: the propeller does not reverse.

    Raises
    ------
    ValueError
        See :class:`~gbt_ocp.models.driven.DrivenBody`.
    """

    input_names: ClassVar = {2: ("thrust", "rudder"), 3: ("thrust", "rudder", "elevator")}
    input_units: ClassVar = {2: ("N", "rad"), 3: ("N", "rad", "rad")}

    def __init__(
        self, dimension: int, parameters: TorpedoParameters, thrust_max: ArrayLike, thrust_min: ArrayLike | None = None
    ) -> None:
        self.parameters = parameters
        lower = np.concatenate([[0.0], -np.asarray(thrust_max, dtype=float)[1:]]) if thrust_min is None else thrust_min
        super().__init__(dimension, thrust_max, lower)

    def body_rates(self, eta: Any, nu: Any, inputs: Any) -> Any:
        """ν̇ ``(n,)``: surge, the plane of the yaw, and in space that of the pitch, with what couples them."""
        own, u = self.parameters, nu[0]
        m1, m2 = own.mass - own.added_mass[0], own.mass - own.added_mass[1]
        turned = own.inertia - own.added_mass[2]
        ahead = inputs[0] + own.surge_drag[0] * u + own.surge_drag[1] * smooth_square(u, DRAG_SMOOTHING)
        if self.position_dimension == 2:
            force, moment = self._across(u, nu[1], nu[2], inputs[1])
            return ca.vertcat((ahead + m2 * nu[1] * nu[2]) / m1, force / m2, moment / turned)
        force, moment = self._across(u, nu[1], nu[3], inputs[1])
        lift, pitching = self._across(u, nu[2], nu[4], inputs[2])
        ahead += m2 * (nu[1] * nu[3] + nu[2] * nu[4])
        pitching -= own.righting * ca.sin(eta[4])
        return ca.vertcat(ahead / m1, force / m2, lift / m2, moment / turned, pitching / turned)

    def input_velocities(self, state: Any) -> Any:
        """The surge for the thrust; a fin takes no power."""
        return ca.vertcat(state[self.flat_dimension], *(0.0 for _ in self.thrust_max[1:]))

    def steered(self, push: Any, turn: Any) -> Any:
        """Thrust and rudder; the elevator is level."""
        level = (0.0 for _ in self.thrust_max[2:])
        return ca.vertcat(push * float(self.thrust_max[0]), turn * float(self.thrust_max[1]), *level)

    def last_resort(self, state: Any) -> Any:
        """Circle on, in the sense in which the vehicle turns already; a torpedo that stops cannot be steered."""
        n = self.flat_dimension
        sense = ca.if_else(state[n + self.position_dimension] < 0.0, -1.0, 1.0)
        inputs = [LOITER_PUSH * self.thrust_max[0], LOITER_TURN * self.thrust_max[1] * sense]
        if self.position_dimension == 3:
            # towards the level, within the limits
            level = -0.5 * (state[4] + state[n + 4])
            inputs.append(ca.fmax(self.thrust_min[2], ca.fmin(self.thrust_max[2], level)))
        return ca.vertcat(*inputs)

    def _across(self, u: Any, s: Any, turn: Any, fin: Any) -> tuple[Any, Any]:
        """Force and moment in one plane of symmetry, hydrodynamic and Coriolis; ``fin`` turns towards +s."""
        own = self.parameters
        m1, m2 = own.mass - own.added_mass[0], own.mass - own.added_mass[1]
        across, along = smooth_square(s, DRAG_SMOOTHING), smooth_square(turn, DRAG_SMOOTHING)
        lift, twist = own.force_lift, own.moment_lift
        force = own.force[0] * s + own.force[1] * turn + own.force[2] * across + own.force[3] * along
        moment = own.moment[0] * s + own.moment[1] * turn + own.moment[2] * across + own.moment[3] * along
        force += u * (lift[0] * s + (lift[1] - m1) * turn) - own.fin_force * u**2 * fin
        moment += u * ((twist[0] + m1 - m2) * s + twist[1] * turn) + own.fin_arm * own.fin_force * u**2 * fin
        return force, moment
