"""The section ``plant``: how the vehicle that moves differs from the model with which is planned."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import AfterValidator, ValidationInfo

from gbt_ocp.experiments.config.keys import Numbers, PositionNumbers, PositiveInputNumbers, Section, key

_SMALLEST_LAG = 1.0e-3
"""Least time constant of a thruster in s: a shorter one makes a stiff equation and no difference."""


def _factor(meaning: str) -> Any:
    return key(1.0, meaning, ge=0.01, le=100.0)


def _thrust(value: float | tuple[float, ...]) -> float | tuple[float, ...]:
    if any(not 0.01 <= factor <= 100.0 for factor in (value if isinstance(value, tuple) else (value,))):
        raise ValueError("not in [0.01, 100]")
    return value


def _lag(value: float) -> float:
    if 0.0 < value < _SMALLEST_LAG:
        raise ValueError("stiff")
    return value


def _force(value: tuple[float, ...], info: ValidationInfo) -> tuple[float, ...]:
    wanted = (info.context or {}).get("d")
    if wanted is not None and len(value) not in (wanted, wanted + 1):
        raise ValueError(f"{wanted} or {wanted + 1} numbers")
    return value


class PlantSection(Section):
    """What of the vehicle its model does not know; by default nothing. Factors apply to the model's parameters."""

    mass: float = _factor("Factor on mass and inertia.")
    added_mass: float = _factor("Factor on the added mass.")
    drag: float = _factor("Factor on linear and quadratic drag.")
    thrust: Annotated[float | PositiveInputNumbers, AfterValidator(_thrust)] = key(
        1.0,
        "Thrust that acts over thrust that is asked for, the same on all axes or one number an axis.",
        "a number in [0.01, 100], or one for each axis",
    )
    lag_s: Annotated[float, AfterValidator(_lag)] = key(
        0.0, "Time constant in s of the thrusters, first order.", f"0, or a number >= {_SMALLEST_LAG:g}", ge=0.0
    )
    dead_time_s: float = key(0.0, "Time in s after which the thrusters begin to react.", ge=0.0)
    autopilot_s: float = key(
        1.0, "Time constant in s of the vehicle's own autopilot, with command: setpoint.", ge=0.05, le=100.0
    )
    force: Annotated[Numbers, AfterValidator(_force)] | None = key(
        None,
        "Constant force in N, earth frame; a further number is a moment about the vertical in N m.",
        "null, or {d} numbers, or one more",
    )
    force_std: float = key(
        0.0,
        "Standard deviation in N, on each axis of the position, of a random force that varies over 20 s.",
        ge=0.0,
    )

    current: PositionNumbers | None = key(
        None, "Velocity of the water over ground in m/s at z = 0, earth frame.", "null, or {d} numbers"
    )
    current_shear: PositionNumbers | None = key(
        None, "Its change with depth in m/s for each metre, in space.", "null, or {d} numbers"
    )
    current_std: float = key(
        0.0, "Standard deviation in m/s, on each horizontal axis, of a part of it that varies.", ge=0.0
    )
    current_time_s: float = key(300.0, "Time constant in s of that part.", gt=0.0)

    @property
    def flows(self) -> bool:
        """Whether the water moves."""
        return any(self.current or ()) or any(self.current_shear or ()) or self.current_std > 0.0

    @property
    def is_model(self) -> bool:
        """Whether the vehicle is as its model says."""
        exact = (self.thrust,) if isinstance(self.thrust, float | int) else self.thrust
        return not self.has_forces and all(factor == 1.0 for factor in exact) and not (self.lag_s or self.dead_time_s)

    @property
    def has_forces(self) -> bool:
        """Whether a key is set that needs a Fossen model: its parameters, the water, forces on its hull."""
        return self.has_push or self.flows

    @property
    def has_push(self) -> bool:
        """The same but for the water: parameters of a Fossen model, or forces on its hull."""
        factors = (self.mass, self.added_mass, self.drag)
        changed = any(factor != 1.0 for factor in factors)
        return changed or any(self.force or ()) or self.force_std > 0.0
