"""Vehicles whose coefficients and limits are published, by name."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from gbt_ocp.models.driven import DrivenBody
from gbt_ocp.models.fossen import FALCON_2D, FALCON_3D, FossenParameters, FossenVehicle
from gbt_ocp.models.torpedo import LAUV, LAUV_FIN, LAUV_THRUST, Torpedo
from gbt_ocp.models.vessel import OTTER, OTTER_THRUST, TwinThrusterVessel

BLUEROV2_HEAVY_3D = FossenParameters(
    13.5, 0.37, (-6.36, -7.12, -18.68, -0.222), (13.7, 0.0, 33.0, 0.0), (141.0, 217.0, 190.0, 1.5)
)
"""The BlueROV2 Heavy with heave, roll and pitch left out: mass 13.5 kg, coefficients of table 2 in von Benzon et al.,
"An Open-Source Benchmark Simulator: Control of a BlueROV2 Underwater Robot", J. Mar. Sci. Eng. 10(12), 1898 (2022)."""

BLUEROV2_HEAVY_2D = FossenParameters(
    BLUEROV2_HEAVY_3D.mass,
    BLUEROV2_HEAVY_3D.inertia,
    (-6.36, -7.12, -0.222),
    (13.7, 0.0, 0.0),
    (141.0, 217.0, 1.5),
)
"""The same in the plane."""


@dataclass(frozen=True)
class KnownVehicle:
    """A vehicle with its limits.

    Attributes
    ----------
    plane, space
        Coefficients of its planar and its spatial model.
    thrust_max
        τ_max over surge, sway, heave (N) and yaw (N m) ``(4,)``.
    thrust_min
        τ_min, the same; ``None`` for -τ_max.
    """

    plane: FossenParameters
    space: FossenParameters
    thrust_max: tuple[float, float, float, float]
    thrust_min: tuple[float, float, float, float] | None = None

    def parameters(self, dimension: int) -> FossenParameters:
        """Coefficients in the plane (2) or in space (3)."""
        return self.plane if dimension == 2 else self.space

    def limits(self, dimension: int) -> tuple[list[float] | None, list[float]]:
        """τ_min, ``None`` for -τ_max, and τ_max ``(d+1,)`` each."""
        kept = [0, 1, 3] if dimension == 2 else [0, 1, 2, 3]
        lower = None if self.thrust_min is None else [self.thrust_min[axis] for axis in kept]
        return lower, [self.thrust_max[axis] for axis in kept]

    def make(self, dimension: int) -> FossenVehicle:
        """The vehicle with these limits."""
        lower, upper = self.limits(dimension)
        return FossenVehicle(self.parameters(dimension), upper, lower)


KNOWN_VEHICLES = {
    "falcon": KnownVehicle(
        FALCON_2D,
        FALCON_3D,
        (5000.0, 5000.0, 5000.0, 1500.0),
    ),
    # Eight T200 at 16 V: 5.25 kgf ahead, 4.1 kgf astern. Four act at 45° in the plane, two of them astern: surge and
    # sway. Heave: the four upright ones astern, the weaker sense. Yaw: the four in the plane astern, at 0.189 m.
    "bluerov2_heavy": KnownVehicle(
        BLUEROV2_HEAVY_2D,
        BLUEROV2_HEAVY_3D,
        (129.7, 129.7, 160.8, 30.4),
    ),
}
"""Every vehicle that a configuration can name in ``vehicle.parameters``."""


@dataclass(frozen=True)
class KnownDriven:
    """A vehicle that is not flat, with its limits.

    Attributes
    ----------
    dimension
        d in which it moves.
    thrust_max, thrust_min
        Limits of its inputs ``(m,)`` in their units.
    rate_max
        Largest rates of its inputs ``(m,)`` in their units a second.
    speed_min
        Least speed ahead in m/s at which it is to be steered; 0 where it may stop.
    turn_radius
        Least radius of its turns in m; 0 where it turns on the spot.
    pitch
        Largest pitch in rad; 0 for a vehicle without.
    speed
        Largest speed ahead in m/s.
    cruise
        Speed ahead in m/s at which it starts where nothing else is said.
    made
        Makes it with these limits, ``thrust_max`` and ``thrust_min``.
    """

    dimension: int
    thrust_max: tuple[float, ...]
    thrust_min: tuple[float, ...]
    rate_max: tuple[float, ...]
    speed_min: float
    turn_radius: float
    pitch: float
    speed: float
    cruise: float
    made: Callable[[tuple[float, ...], tuple[float, ...]], DrivenBody]

    def make(
        self, thrust_max: tuple[float, ...] | None = None, thrust_min: tuple[float, ...] | None = None
    ) -> DrivenBody:
        """The vehicle with these limits, or its own where they are ``None``."""
        return self.made(thrust_max or self.thrust_max, thrust_min or self.thrust_min)


def _torpedo(dimension: int) -> KnownDriven:
    fins = dimension - 1
    return KnownDriven(
        dimension=dimension,
        thrust_max=(LAUV_THRUST, *(LAUV_FIN,) * fins),
        thrust_min=(0.0, *(-LAUV_FIN,) * fins),
        # assumed: full thrust in 2 s, a fin from one side to the other in 2 s
        rate_max=(0.5 * LAUV_THRUST, *(LAUV_FIN,) * fins),
        speed_min=0.8,
        turn_radius=4.0,
        pitch=math.radians(40.0) if dimension == 3 else 0.0,  # assumed
        speed=1.96,
        cruise=1.2,
        made=lambda upper, lower: Torpedo(dimension, LAUV, upper, lower),
    )


KNOWN_DRIVEN = {
    "torpedo2d": _torpedo(2),
    "torpedo3d": _torpedo(3),
    "vessel": KnownDriven(
        dimension=2,
        thrust_max=(OTTER_THRUST[0],) * 2,
        thrust_min=(-OTTER_THRUST[1],) * 2,
        rate_max=(OTTER_THRUST[0],) * 2,  # assumed: full thrust in 1 s
        speed_min=0.0,
        turn_radius=0.0,
        pitch=0.0,
        speed=3.08,
        cruise=0.0,
        made=lambda upper, lower: TwinThrusterVessel(OTTER, upper, lower),
    ),
}
"""Every vehicle that a configuration can name in ``vehicle.model`` beside those of :data:`KNOWN_VEHICLES`."""
