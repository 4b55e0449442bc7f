"""A vehicle under inputs that are held: the method of Dormand and Prince, a stretch of time in one call.

SciPy's solver calls the forward dynamics and some forty small operations of numpy in each of its stages. A simulation
in which inputs are held for a tenth of a second spends most of its time there, so a vehicle whose dynamics CasADi takes
is integrated by an expression of all stages: pairs of order 5 and 4 in steps of at most 5 ms, each with the error
estimate of SciPy's ``RK45``. A stretch in which a step does not meet the tolerance is halved, as where a velocity
changes its sign and drag has a kink; what six halves do not mend is left to SciPy.
"""

from __future__ import annotations

from math import ceil
from typing import Any

import casadi as ca
import numpy as np

from gbt_ocp.models.evaluated import Evaluated
from gbt_ocp.models.fossen import FossenVehicle, along_body
from gbt_ocp.typing import Array

RELATIVE, ABSOLUTE = 1e-8, 1e-10
"""Tolerances of a step, in the sense of ``scipy.integrate.solve_ivp``."""

LONGEST_STEP_S = 5e-3
"""Longest step in s."""

STEPS_A_CALL = 5
"""Steps of an expression: more take longer to be made, fewer are more calls."""

MOST_HALVES = 6
"""How often a stretch is halved."""

STAGES = (
    (),
    (1 / 5,),
    (3 / 40, 9 / 40),
    (44 / 45, -56 / 15, 32 / 9),
    (19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729),
    (9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656),
    (35 / 384, 0.0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84),
)
"""Dormand and Prince, "A family of embedded Runge-Kutta formulae", J. Comput. Appl. Math. 6 (1980), table 2; the last
row is the step itself."""

ERRORS = (-71 / 57600, 0.0, 71 / 16695, -71 / 1920, 17253 / 339200, -22 / 525, 1 / 40)
"""Difference of both orders."""


class HeldInputs:
    """Integrates a vehicle of Fossen's equations under inputs that are held.

    Parameters
    ----------
    vehicle
        Its forward dynamics.
    lag
        Time constant in s of the thrusters; 0 for none.
    push
        Constant force in the earth frame ``(n,)``, ``None`` for none.
    """

    def __init__(self, vehicle: FossenVehicle, lag: float, push: Array | None) -> None:
        self._vehicle, self._lag, self._push = vehicle, lag, push
        self._steps: Evaluated | None = None

    def advance(self, x: Array, asked: Array, duration: float) -> tuple[Array, float] | None:
        """State and work after a stretch of time.

        Parameters
        ----------
        x
            The state, and behind it what acts of the inputs where there is a lag.
        asked
            What the inputs ask for ``(m,)``.
        duration
            In s.

        Returns
        -------
        The same after ``duration``, and ``∫ Σ|τ_i ν_i| dt`` in J; ``None`` where a step is not as exact as asked.
        """
        if self._steps is None:
            self._steps = self._expression(len(x), len(asked))
        parts = max(1, ceil(duration / (STEPS_A_CALL * LONGEST_STEP_S) - 1e-9))
        y = np.append(x, 0.0)
        for _ in range(parts):
            end = self._over(self._steps, y, asked, duration / parts, MOST_HALVES)
            if end is None:
                return None
            y = end
        return y[:-1], float(y[-1])

    def _over(self, steps: Evaluated, y: Array, asked: Array, duration: float, halves: int) -> Array | None:
        """States and work after ``duration`` seconds, in the steps of an expression or in halves of as many each."""
        end, (error,) = steps.all(y, asked, [duration / STEPS_A_CALL])
        if error <= 1.0:
            return end
        if halves == 0 or not np.all(np.isfinite(end)):
            return None
        first = self._over(steps, y, asked, 0.5 * duration, halves - 1)
        return None if first is None else self._over(steps, first, asked, 0.5 * duration, halves - 1)

    def _expression(self, states: int, inputs: int) -> Evaluated:
        """States, with the work behind them, and the largest error of a step over its tolerance."""
        begin, asked, h = ca.SX.sym("y", states + 1), ca.SX.sym("asked", inputs), ca.SX.sym("h")
        # functions of expressions are written out by the library, which is quicker than by operations of Python
        rates = ca.Function("rates", [begin, asked], [self._rates(begin, asked)])
        slopes: list[Any] = []
        at: Any = begin
        for row in STAGES:
            at = begin
            for weight, slope in zip(row, slopes, strict=True):
                at = at + (h * weight) * slope
            slopes.append(rates(at, asked))
        off = h * sum(weight * slope for weight, slope in zip(ERRORS, slopes, strict=True))
        allowed = ABSOLUTE + RELATIVE * ca.fmax(ca.fabs(begin), ca.fabs(at))
        error = ca.norm_2((off / allowed)[:states]) / np.sqrt(states)
        step = ca.Function("step", [begin, asked, h], [at, error])
        y, worst = begin, ca.SX(0.0)
        for _ in range(STEPS_A_CALL):
            y, error = step(y, asked, h)
            worst = ca.fmax(worst, error)
        return Evaluated("held", [begin, asked, h], [y, worst])

    def _rates(self, y: ca.SX, asked: ca.SX) -> ca.SX:
        """Time derivative of the states and of the work."""
        n = self._vehicle.flat_dimension
        state, lagging = y[: 2 * n], self._lag > 0.0
        acting = y[2 * n : -1] if lagging else asked
        force = acting
        if self._push is not None:
            yaw = state[n - 1]
            force = acting + ca.vertcat(*along_body(ca.cos(yaw), ca.sin(yaw), self._push))
        moved = self._vehicle.rates(state, force)
        power = ca.sum1(ca.fabs(acting * state[n:]))
        return ca.SX(ca.vertcat(moved, *([(asked - acting) / self._lag] if lagging else []), power))
