"""Vehicles whose coefficients and limits are published, by name."""

from __future__ import annotations

from dataclasses import dataclass

from gbt_ocp.models.fossen import FALCON_2D, FALCON_3D, FossenParameters, FossenVehicle

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
