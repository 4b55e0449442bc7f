"""What a pilot is made of."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from gbt_ocp.guidance.strategy import Guidance
from gbt_ocp.models.driven import DrivenBody
from gbt_ocp.models.sensors import SimulatedSensor
from gbt_ocp.models.sizes import not_negative, positive
from gbt_ocp.ocp.follower import BANDWIDTH
from gbt_ocp.tracking.protocol import PositionTracker, Tracker
from gbt_ocp.typing import Array


@dataclass(frozen=True)
class PilotParts:
    """Everything that takes part in a pilot.

    Attributes
    ----------
    tracker, guidance, vehicle
        The parts. They have seen nothing yet. The first flat outputs of the vehicle are those of its pose; the pose of
        a vehicle that is not flat has the pitch too, in space.
    period
        T in seconds: time between two decisions of the guidance.
    forecast
        n, positions predicted ahead.
    forecast_period
        Seconds between them.
    follow_bandwidth
        ω in rad/s of the follower that gives the thrust between two plans.
    thrust_lag
        Time constant in seconds of the thrusters, which is made up for.
    observing
        Whether the follower estimates what the vehicle needs of thrust beyond its model, and adds it.
    lead
        How far ahead on the plan setpoints are taken, in seconds: about an autopilot's lag; ``None`` for a period.
    late
        Age in seconds up to which inputs that come late are taken.
    navigation_gap
        Longest time in seconds between two navigations over which the own state is interpolated, or carried on.
    bearing_std
        Deviation in radians of bearings that do not state one.
    tracker_at
        Makes the tracker at the vehicle's first position ``(d,)``, to take the place of ``tracker``; ``None`` keeps it.
    sensors
        Say frame, mounting, deviation and error of the heading of measurements of their name that do not.
    input_rate
        Largest rates of the inputs ``(m,)`` that the follower of a plan by integration keeps; ``None`` for no limit.

    Raises
    ------
    ValueError
        If a number is out of range, or the vehicle has more flat outputs than its pose.
    """

    tracker: Tracker | PositionTracker
    guidance: Guidance
    vehicle: Any
    period: float
    forecast: int
    forecast_period: float
    follow_bandwidth: float = BANDWIDTH
    thrust_lag: float = 0.0
    observing: bool = False
    lead: float | None = None
    late: float = 2.0
    navigation_gap: float = 1.0
    bearing_std: float = 0.0
    tracker_at: Callable[[Array], Tracker | PositionTracker] | None = None
    sensors: Mapping[str, SimulatedSensor] = field(default_factory=dict)
    input_rate: tuple[float, ...] | None = None

    def __post_init__(self) -> None:
        for name in ("period", "forecast_period", "navigation_gap"):
            positive(name, getattr(self, name))
        for name in ("late", "bearing_std", "thrust_lag"):
            not_negative(name, getattr(self, name))
        most = self.vehicle.position_dimension + 1
        if not isinstance(self.vehicle, DrivenBody) and self.vehicle.flat_dimension > most:
            raise ValueError(f"vehicle: found {self.vehicle.flat_dimension} flat outputs; allowed: at most {most}")
