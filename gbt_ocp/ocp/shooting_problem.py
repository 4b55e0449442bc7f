"""The trajectory problem of any vehicle: its trajectory follows from the inputs by integration.

problem = ShootingProblem(vehicle, pieces=5, period=0.1)
problem = problem.maximize(BearingSimilarity(2)).subject_to(ThrustLimit(vehicle, gamma=0.98))
planner = problem.compile()
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from gbt_ocp.models.dynamics import Dynamics
from gbt_ocp.ocp.planner import ShotPlanner
from gbt_ocp.ocp.problem_data import ShootingData
from gbt_ocp.ocp.verbs import PosingVerbs


@dataclass(frozen=True)
class ShootingProblem(PosingVerbs, ShootingData):
    """Maximise a sum over the ends of the periods of a trajectory, under limits on the inputs and along it.

    The verbs, objectives and constraints are those of :class:`~gbt_ocp.ocp.problem.TrajectoryProblem`. What is free are
    the inputs; the motion follows from them by integration (direct shooting, Bock and Plitt 1984). A
    :class:`~gbt_ocp.ocp.limits.ThrustLimit` becomes bounds on them, which hold between the ends of the periods, too.

    Parameters
    ----------
    vehicle
        Either one whose ``rates(state, inputs)`` are CasADi expressions, its state beginning with z, the position first
        (:class:`~gbt_ocp.models.vehicles.DrivenVehicle`), or a flat vehicle.
    pieces
        p, the number of periods.
    period
        T in seconds.
    thrust
        ``held`` over each period, or ``linear`` from a value at its beginning to one at its end; it may jump between
        periods.
    steps
        M, classical Runge-Kutta steps over a period; by default as few as are stable at all speeds that inputs and
        limits allow (:func:`gbt_ocp.ocp.integration_steps.stable_steps`).

    Raises
    ------
    ValueError
        If a size is out of range.
    gbt_ocp.models.contracts.ContractError
        If the vehicle has no dynamics in CasADi.
    """

    def __post_init__(self) -> None:
        super().__post_init__()
        Dynamics(self.vehicle)

    def compile(self, solver: str = "auto", options: Mapping[str, Any] | None = None) -> ShotPlanner:
        """Make the planner of this problem; the same as ``ShotPlanner(problem, solver, options)``.

        Raises
        ------
        ValueError
            As :class:`~gbt_ocp.ocp.planner.AnyPlanner`.
        """
        return ShotPlanner(self, solver, options)
