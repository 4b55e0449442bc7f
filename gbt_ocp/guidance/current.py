"""The current: what the vehicle knows of the velocity of the water, given or estimated from its own motion."""

from __future__ import annotations

from typing import Protocol

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from gbt_ocp.models.driven import DrivenBody
from gbt_ocp.models.dynamics import Dynamics
from gbt_ocp.models.sizes import not_negative, positive, vector
from gbt_ocp.models.vehicles import Vehicle
from gbt_ocp.typing import Array

ACCELERATION_STD = 0.05
"""σ_a in m/s² (rad/s²): acceleration that neither thrust nor drag explains, independent from sample to sample."""

ACCELERATION_SHARE = 0.02
"""Part of the acceleration that the middle of a sample does not show, added to σ_a."""

CURRENT_STD = 0.5
"""Standard deviation in m/s of the current on each axis before anything is known."""

DRIFT = 0.003
"""Standard deviation in m/s by which the current wanders in a second, on each axis."""


class Current(Protocol):
    """The velocity of the water as the vehicle knows it."""

    @property
    def velocity(self) -> Array:
        """v_c ``(d,)`` in m/s over ground, earth frame."""

    @property
    def covariance(self) -> Array:
        """Of v_c ``(d, d)`` in m²/s²; zero where it is given."""

    def observe(self, before: Array, after: Array, thrust: Array, duration: float) -> None:
        """Take note of how the vehicle moved.

        Parameters
        ----------
        before, after
            Flat output and its rate over ground ``(2, n)`` at two times.
        thrust
            Mean inputs between them ``(m,)``.
        duration
            Seconds between them.
        """


class KnownCurrent:
    """A current that is given and stays as it is.

    Parameters
    ----------
    velocity
        v_c ``(d,)`` in m/s over ground, earth frame.

    Raises
    ------
    ValueError
        If it is not two or three finite numbers.
    """

    def __init__(self, velocity: ArrayLike) -> None:
        size = np.size(velocity)
        self.velocity = vector("velocity", velocity, 3 if size == 3 else 2)
        self.covariance = np.zeros((size, size))

    def observe(self, before: Array, after: Array, thrust: Array, duration: float) -> None:
        """Nothing is learnt."""


class CurrentObserver:
    """Estimates the current from own navigation against the model: an extended Kalman filter of d states.

    Between two navigations the model needs the inputs ``Ψ_τ(z, ż - v_c, z̈)`` at their middle, with z̈ from the
    difference of the rates. What the inputs that were given differ from that tells of v_c, since the drag acts on the
    velocity through the water. The innovation is in newtons, its covariance ``M M' σ_a²`` with M = ∂Ψ_τ/∂z̈; a share of
    the acceleration is added to σ_a.

    Parameters
    ----------
    vehicle
        The model.
    acceleration_std
        σ_a.
    prior_std
        Of v_c on each axis in m/s, about zero.
    drift
        Standard deviation in m/s by which v_c wanders in a second.

    Raises
    ------
    ValueError
        If a deviation is not above 0, or the drift is below it.

    Notes
    -----
    A vehicle that is not flat has no such inputs; of it the acceleration is compared with that of its model.

    A constant force that the model does not have is taken for a current.
    """

    def __init__(
        self,
        vehicle: Vehicle | DrivenBody,
        acceleration_std: float = ACCELERATION_STD,
        prior_std: float = CURRENT_STD,
        drift: float = DRIFT,
    ) -> None:
        self._std = positive("acceleration_std", acceleration_std)
        self._drift = not_negative("drift", drift)
        d, n = vehicle.position_dimension, vehicle.flat_dimension
        self._estimate = np.zeros(d)
        self._spread = positive("prior_std", prior_std) ** 2 * np.eye(d)
        sizes = {"z": n, "dz": n, "ddz": n, "water": d, "thrust": len(vehicle.thrust_max)}
        z, dz, ddz, water, thrust = given = [ca.SX.sym(name, size) for name, size in sizes.items()]
        through = ca.vertcat(dz[:d] - water, dz[d:])
        if isinstance(vehicle, DrivenBody):
            # no inverse dynamics: the accelerations are compared, and not the inputs
            state = ca.SX.sym("state", vehicle.states)
            accelerated = Dynamics(vehicle).point(state, thrust)[2]
            found = ca.substitute(accelerated, state, vehicle.symbolic_state(z, through))
            innovation, mass = ddz - found, ca.SX.eye(n)
        else:
            found = vehicle.inputs(z, through, ddz)
            innovation, mass = thrust - found, ca.jacobian(found, ddz)
        self._model = ca.Function("model", given, [innovation, ca.jacobian(found, water), mass])

    @property
    def velocity(self) -> Array:
        """The estimate of v_c ``(d,)`` in m/s."""
        return self._estimate.copy()

    @property
    def covariance(self) -> Array:
        """Of the estimate ``(d, d)`` in m²/s²."""
        return self._spread.copy()

    @property
    def settings(self) -> tuple[float, float, ca.Function]:
        """σ_a, the drift, and the model.

        That is a function of z, ż, z̈ ``(n,)``, v_c ``(d,)`` and the inputs τ ``(m,)``: what τ is less than the inputs
        that the motion needs ``(m,)``, the slopes of these by v_c ``(m, d)``, and those by z̈ ``(m, n)``.
        """
        return self._std, self._drift, self._model

    def observe(self, before: Array, after: Array, thrust: Array, duration: float) -> None:
        """See :meth:`Current.observe`. A motion that is not finite teaches nothing."""
        positive("duration", duration)
        step = np.asarray(after[:2]) - np.asarray(before[:2])
        d = len(self._estimate)
        # an angle may have passed a full turn; the middle is on the short way
        step[0, d:] = (step[0, d:] + np.pi) % (2.0 * np.pi) - np.pi
        middle = before[:2] + 0.5 * step
        given = np.asarray(thrust, dtype=float)
        off, slope, mass = (
            np.asarray(part) for part in self._model(middle[0], middle[1], step[1] / duration, self._estimate, given)
        )
        innovation = off.ravel()
        if not np.all(np.isfinite(innovation)):
            return
        spread = self._spread + self._drift**2 * duration * np.eye(d)
        noise = (self._std**2 + ACCELERATION_SHARE**2 * np.sum((step[1] / duration) ** 2)) * mass @ mass.T
        gain = np.linalg.solve(slope @ spread @ slope.T + noise, slope @ spread).T
        self._estimate = self._estimate + gain @ innovation
        kept = np.eye(d) - gain @ slope
        # Joseph's form stays positive definite
        self._spread = kept @ spread @ kept.T + gain @ noise @ gain.T
