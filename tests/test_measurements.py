"""One record for all kinds of measurements, and its place in the earth frame."""

from __future__ import annotations

import numpy as np
import pytest

from gbt_ocp.models import Measurement, Mounting, unit_bearing


@pytest.mark.parametrize("dimension", [2, 3])
def test_a_bearing_from_the_bow_points_to_the_target(dimension: int) -> None:
    """By geometry: target, sensor and bow are drawn, the angle from the bow is computed with rotation matrices."""
    rng = np.random.default_rng(3)
    for _ in range(20):
        target, own, yaw, mount_yaw = (
            rng.normal(0, 30, dimension),
            rng.normal(0, 30, dimension),
            *rng.uniform(-np.pi, np.pi, 2),
        )
        arm = rng.normal(0, 2, dimension)

        def turned(vector: np.ndarray, angle: float) -> np.ndarray:
            level = np.exp(1j * angle) * (vector[0] + 1j * vector[1])
            return np.array([level.real, level.imag, *vector[2:]])

        sensor = own + turned(arm, yaw)
        seen = turned(target - sensor, -(yaw + mount_yaw))
        azimuth = np.arctan2(seen[1], seen[0])
        elevation = np.arcsin(seen[2] / np.linalg.norm(seen)) if dimension == 3 else 0.0
        measurement = Measurement(
            1.0,
            "azimuth" if dimension == 2 else "azimuth_elevation",
            azimuth if dimension == 2 else (azimuth, elevation),
            std=0.03,
            frame="bow",
            mounting=Mounting(tuple(arm), mount_yaw),
        )
        sighting = measurement.placed(np.append(own, yaw), heading_std=0.04)
        np.testing.assert_allclose(sighting.position, sensor, atol=1e-12)
        np.testing.assert_allclose(sighting.bearing, unit_bearing(target, sensor), atol=1e-12)
        np.testing.assert_allclose(sighting.std, [0.05, 0.03][: dimension - 1], atol=1e-12)


@pytest.mark.parametrize(
    ("given", "line"),
    [
        ({"kind": "sonar"}, "kind: found 'sonar'; allowed: azimuth, "),
        ({"frame": "north"}, "frame: found 'north'; allowed: earth, bow"),
        ({"value": np.nan}, "value: found "),
        ({"kind": "azimuth_elevation"}, "value: found "),
        ({"std": 0.0}, "std: found "),
        ({"time": np.inf}, "time: found inf"),
    ],
)
def test_a_wrong_measurement_is_refused_by_name(given: dict, line: str) -> None:
    with pytest.raises(ValueError, match=f"^{line}"):
        Measurement(**{"time": 0.0, "kind": "azimuth", "value": 0.1, **given})


def test_a_range_is_no_bearing() -> None:
    with pytest.raises(ValueError, match="'range' is not a bearing in 2 dimensions"):
        _ = Measurement(0.0, "range", 12.0).placed(np.zeros(3)).bearing
