"""Corners: a window whose older bearings are of another motion than the newest.

A smooth process cannot join the bearings before and after a sharp turn or a sudden stop, and its present position is
wrong until the window holds none from before. The bearings say so at once: of exact ones each is foreseen to within a
few deviations, and the first after a corner is missed by hundreds. One such bearing is a stray, which is left out; two
in a row that the window until then does not foresee are a break.
"""

from __future__ import annotations

from collections import deque
from typing import NamedTuple

import numpy as np

from gbt_ocp.models.bearings import log_map, tangent_basis
from gbt_ocp.tracking.gp.posterior import Conditional
from gbt_ocp.typing import Array

BROKEN = 1.0e4
"""Squared standardised innovation, a component, of a bearing that is not of the window's motion."""

FORESEEN = 1.0e3
"""The same of a bearing that is: a window that misses more has never fitted, as under noise that it does not know."""

BEFORE = 5
"""Bearings in a row that have to be foreseen before a break is one."""

LEAST_SPEED = 1.0
"""Least standard deviation of what the target moves off its old motion in a sampling interval, over it, in m/s.

The medians of the priors of amplitude and length scale. Across the line of sight the bearings show it; along it they
show nothing, and a position that is believed too well there is explained by a motion that jitters.
"""


class Break(NamedTuple):
    """Where a motion breaks: the first bearing that is not of the old one.

    Attributes
    ----------
    mean
        Position then, as the old motion has it, ``(d,)`` in metres.
    std
        Standard deviation in metres of what the target moved off it, on each axis.
    """

    mean: Array
    std: float


class BreakWatch:
    """Notices a break from one bearing to the next."""

    def __init__(self) -> None:
        self._squares: deque[float] = deque(maxlen=BEFORE)
        self._suspect: tuple[Conditional, float, float] | None = None

    @property
    def suspects(self) -> bool:
        """Whether the latest bearing is a stray or the first after a break: the next one will say."""
        return self._suspect is not None

    def judge(self, posterior: Conditional, time: float, bearing: Array, own: Array) -> Break | None:
        """Judge a bearing ``(d,)`` before it is taken in.

        Parameters
        ----------
        posterior
            Of the window until then.
        time, bearing, own
            The sample: seconds, unit vector ``(d,)``, own position ``(d,)`` in metres.

        Returns
        -------
        The break that lies before the bearing before this one, or ``None``.
        """
        if self._suspect is not None:
            before, when, missed = self._suspect
            self._suspect = None
            square, more = _unforeseen(before, time, bearing, own)
            if square > BROKEN:
                self._squares.clear()
                mean = before.predict(np.array([when])).mean[0]
                return Break(mean, max(missed, more, LEAST_SPEED * (time - when)))
            return None
        square, missed = _unforeseen(posterior, time, bearing, own)
        if len(self._squares) == BEFORE and max(self._squares) < FORESEEN and square > BROKEN:
            self._suspect = posterior, time, missed
        else:
            self._squares.append(square)
        return None


def _unforeseen(posterior: Conditional, time: float, bearing: Array, own: Array) -> tuple[float, float]:
    """Squared standardised innovation a component, and how far the expected position lies off the bearing, in m."""
    mean, covariance = (values[0] for values in posterior.predict(np.array([time])))
    line = mean - own
    distance = float(np.linalg.norm(line))
    if not distance > 0.0:
        return 0.0, 0.0
    unit = line / distance
    basis = tangent_basis(unit)
    angle = log_map(unit, bearing, basis)
    spread = basis.T @ covariance @ basis + (posterior.noise + np.finfo(float).eps * distance**2) * np.eye(len(angle))
    variances, axes = np.linalg.eigh(spread / distance**2)
    square = np.sum((axes.T @ angle) ** 2 / np.maximum(variances, np.finfo(float).eps ** 2)) / len(angle)
    return float(square), float(np.linalg.norm(angle)) * distance
