"""What a planner returns."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from gbt_ocp.ocp.solvers.base import GIVEN_UP
from gbt_ocp.ocp.trajectory import FlatTrajectory
from gbt_ocp.typing import Array

ANSWERED = ("solved", GIVEN_UP)
"""Words for a first attempt that succeeded."""


@dataclass(frozen=True)
class Plan:
    """A trajectory and how it came about.

    Attributes
    ----------
    trajectory
        The flat output over the horizon.
    status
        ``solved``, ``given up`` (solved, and the limits named in :attr:`given_up` could not be kept), or the word for
        what happened to the first attempt of this step; empty while a plan is followed on.
    objective
        The objective without penalty, summed over the endpoints.
    violation
        Worst violation of the true limits over the plan on the fine grid, in units of the limits, at least 0.
    piece_violation
        The same for each piece ``(p,)``.
    iterations
        Solver iterations of all attempts.
    solve_time
        Seconds of all attempts, fine-grid checks included.
    fallback
        ``""``, ``shifted`` (the rest of the previous plan), ``cold`` (a cold solve), ``unfinished`` (what the solver
        had when its iterations were spent) or ``braking``.
    tightened
        How often limits were tightened because the piece to be executed broke them between nodes.
    elapsed
        Seconds of the trajectory that lie behind: 0 for a plan just made, more for one that is followed on.
    given_up
        Limits that the plan does not keep, by name, with their worst violation on the fine grid in units of the limit.
        Never thrust, and no penalty on what is only believed, which is not judged.
    broken_at_start
        Limits that are broken where the plan begins and no plan can change it, by name, likewise.
    current
        Velocity of the water over ground for which the plan was made ``(d,)`` in m/s; ``None`` for still water.
    """

    trajectory: FlatTrajectory
    status: str
    objective: float
    violation: float
    piece_violation: Array
    iterations: int
    solve_time: float
    fallback: str = ""
    tightened: int = 0
    elapsed: float = 0.0
    given_up: Mapping[str, float] = field(default_factory=dict)
    broken_at_start: Mapping[str, float] = field(default_factory=dict)
    current: Array | None = None

    @property
    def through_water(self) -> FlatTrajectory:
        """The trajectory in the frame that moves with the water, from which the thrust follows."""
        return self.trajectory if self.current is None else self.trajectory.moving(-self.current)

    @property
    def solved(self) -> bool:
        """Whether the first attempt of this step succeeded and its plan keeps the limits."""
        return self.status == "solved"

    @property
    def answered(self) -> bool:
        """Whether the first attempt of this step succeeded, be it that limits had to give."""
        return self.status in ANSWERED

    @property
    def knots(self) -> Array:
        """The continuous derivatives of the flat output at the boundaries of the pieces ``(p+1, k+1, n)``, z first."""
        return self.trajectory.knots

    @property
    def endpoints(self) -> Array:
        """z̄ ``(p, n)``."""
        return self.trajectory.endpoints

    def __call__(self, times: ArrayLike, order: int = 0) -> Array:
        """The flat output, or a derivative of it, ``times`` seconds after the plan was made ``(..., n)``."""
        return self.trajectory(times, order)


@dataclass(frozen=True)
class ShootingPlan:
    """What multiple shooting plans: inputs to hold, and where they lead.

    Attributes
    ----------
    thrust
        Inputs at the start of each period ``(p, m)``, held over it.
    knots
        z and ż at the start and at the end of each period ``(p+1, 2, n)``.
    held
        The unknowns of the solver ``(p, m)``: inputs in units of their limits.
    fallback
        ``""``, ``cold`` (a cold solve), ``shifted`` (the rest of the previous plan), ``unfinished``, ``braking`` or
        ``coasting`` (no thrust).
    status, objective, violation, piece_violation, iterations, solve_time, tightened, given_up, broken_at_start
        As in a :class:`Plan`; limits on the inputs never need to be tightened.
    thrust_end
        Inputs at the end of each period ``(p, m)``, where they change linearly over it; ``None`` where they are held.
    period
        Seconds of each period; ``None`` where it is that of the samples.
    elapsed
        Seconds of the plan that lie behind: 0 for one just made, more for one that is followed on.
    current
        Velocity of the water over ground for which the plan was made ``(d,)`` in m/s; ``None`` for still water.
    """

    thrust: Array
    knots: Array
    held: Array
    status: str
    objective: float
    violation: float
    piece_violation: Array
    iterations: int
    solve_time: float
    fallback: str = ""
    tightened: int = 0
    given_up: Mapping[str, float] = field(default_factory=dict)
    broken_at_start: Mapping[str, float] = field(default_factory=dict)
    thrust_end: Array | None = None
    period: float | None = None
    elapsed: float = 0.0
    current: Array | None = None

    def applied(self, duration: float) -> tuple[Array, Array]:
        """Inputs now and ``duration`` seconds later ``(m,)``, within the first period."""
        first = self.thrust[0]
        if self.thrust_end is None:
            return first, first
        change = (self.thrust_end[0] - first) / (duration if self.period is None else self.period)
        return first + self.elapsed * change, first + (self.elapsed + duration) * change

    @property
    def solved(self) -> bool:
        """Whether the first attempt of this step succeeded."""
        return self.status == "solved"

    @property
    def endpoints(self) -> Array:
        """z̄ ``(p, n)``."""
        return np.asarray(self.knots[1:, 0])

    def rest(self, holds: int = 1) -> Array:
        """What is held after the first ``holds`` entries, with zeros in the place of what is missing at the end."""
        return np.vstack([self.held[holds:], np.zeros_like(self.held[:holds])])
