"""Latitude, longitude and height on the ellipsoid of WGS 84, and a plane that touches it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from gbt_ocp.files import optional_module
from gbt_ocp.typing import Array


@dataclass(frozen=True)
class LocalPlane:
    """Axes east, north and up at a point of the ellipsoid (WGS 84), in metres.

    Far from the origin the plane leaves the earth's surface: 10 km away z = 0 is 8 m above it. Positions and distances
    stay exact. The direction of north turns with the longitude; :meth:`turned` accounts for that.

    Attributes
    ----------
    latitude, longitude
        Of the origin in radians, north and east positive.
    height
        Of the origin above the ellipsoid in metres. A depth is a negative height.

    Raises
    ------
    ValueError
        If the latitude is not between -π/2 and π/2, or a number is not finite.
    """

    latitude: float
    longitude: float
    height: float = 0.0

    def __post_init__(self) -> None:
        if not np.isfinite([self.latitude, self.longitude, self.height]).all():
            found = f"{self.latitude!r}, {self.longitude!r}, {self.height!r}"
            raise ValueError(f"latitude, longitude, height: found {found}; allowed: finite numbers")
        if abs(self.latitude) > 0.5 * np.pi:
            raise ValueError(f"latitude: found {self.latitude!r}; allowed: a number of radians from -π/2 to π/2")

    def to_plane(self, latitude: ArrayLike, longitude: ArrayLike, height: ArrayLike = 0.0) -> Array:
        """Positions in the plane ``(..., 3)`` in metres: east, north, up.

        Parameters
        ----------
        latitude, longitude
            ``(...)`` in radians.
        height
            ``(...)`` above the ellipsoid in metres.

        Raises
        ------
        ValueError
            If the library for geodesy is not installed.
        """
        geodesy = optional_module("pymap3d", "geodesy", "latitude and longitude")
        shape = np.broadcast_shapes(*(np.shape(one) for one in (latitude, longitude, height)))
        flat = [np.broadcast_to(np.asarray(one, dtype=float), shape).ravel() for one in (latitude, longitude, height)]
        found = geodesy.geodetic2enu(*flat, self.latitude, self.longitude, self.height, deg=False)
        return np.stack([np.asarray(one, dtype=float) for one in found], axis=-1).reshape(*shape, 3)

    def from_plane(self, positions: ArrayLike) -> tuple[Array, Array, Array]:
        """Latitude, longitude in radians and height above the ellipsoid in metres, each ``(...)``.

        Parameters
        ----------
        positions
            ``(..., 2)`` or ``(..., 3)`` in metres: east, north(, up); up is 0 where it is not given.

        Raises
        ------
        ValueError
            If the library for geodesy is not installed.
        """
        geodesy = optional_module("pymap3d", "geodesy", "latitude and longitude")
        found = np.asarray(positions, dtype=float)
        up = found[..., 2] if found.shape[-1] == 3 else np.zeros(found.shape[:-1])
        flat = [one.ravel() for one in (found[..., 0], found[..., 1], up)]
        back = geodesy.enu2geodetic(*flat, self.latitude, self.longitude, self.height, deg=False)
        latitude, longitude, height = (np.asarray(one, dtype=float).reshape(up.shape) for one in back)
        return latitude, longitude, height

    def turned(self, directions: ArrayLike, latitude: ArrayLike, longitude: ArrayLike) -> Array:
        """Vectors in axes east, north, up of other points as vectors in the axes of this plane, ``(K, 3)``.

        Parameters
        ----------
        directions
            ``(K, 3)`` in any unit.
        latitude, longitude
            Of the other points ``(K,)`` in radians.
        """
        there = _axes(np.asarray(latitude, dtype=float), np.asarray(longitude, dtype=float))
        here = _axes(np.asarray(self.latitude), np.asarray(self.longitude))
        return np.asarray(np.einsum("ij,kjl,kl->ki", here.T, there, np.asarray(directions, dtype=float)))


def _axes(latitude: Array, longitude: Array) -> Array:
    """Unit vectors east, north, up as columns, in coordinates that turn with the earth ``(..., 3, 3)``."""
    cos_lat, sin_lat = np.cos(latitude), np.sin(latitude)
    cos_lon, sin_lon = np.cos(longitude), np.sin(longitude)
    east = np.stack([-sin_lon, cos_lon, np.zeros_like(sin_lon)], axis=-1)
    north = np.stack([-sin_lat * cos_lon, -sin_lat * sin_lon, cos_lat], axis=-1)
    up = np.stack([cos_lat * cos_lon, cos_lat * sin_lon, sin_lat], axis=-1)
    return np.stack([east, north, up], axis=-1)
