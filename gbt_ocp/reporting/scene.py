"""What an animation shows of a run, read from its folder: paths, bearing, forecast with its 95 % regions, plan."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from gbt_ocp.reporting.drawable import drawable_history
from gbt_ocp.simulation import run_folder
from gbt_ocp.simulation.calibration import region_radius
from gbt_ocp.simulation.history import History
from gbt_ocp.typing import Array

FEWEST_FRAMES_A_SECOND, MOST_FRAMES_A_SECOND = 10.0, 25.0


@dataclass(frozen=True)
class Scene:
    """A run as an animation shows it.

    Attributes
    ----------
    title
        The problem's name, and the seed.
    history
        The run.
    """

    title: str
    history: History

    @classmethod
    def load(cls, run_dir: str | os.PathLike[str]) -> Scene:
        """Read a run folder.

        Raises
        ------
        FileNotFoundError
            If a file of the run folder is missing.
        ValueError
            If one is damaged.
        """
        folder = Path(run_dir)
        history = drawable_history(folder)
        _, configuration = run_folder.read_configuration(folder)
        seed = run_folder.read_summary(folder).get("seed")
        return cls(f"{configuration.get('name', 'run')}, seed {seed}", history)

    @property
    def vehicle(self) -> Array:
        """P_A, ``(K, d)``, m."""
        return self.history.vehicle_pose[:, : self.history.dimension]

    @property
    def plan(self) -> Array:
        """Positions of the plan: where it begins and the ends of its pieces, ``(K, p+1, d)``, m; p may be 0."""
        return np.concatenate([self.vehicle[:, None], self.history.plan[:, :, : self.history.dimension]], axis=1)

    @property
    def distance(self) -> Array:
        """‖P_A - P_T‖, ``(K,)``, m."""
        return np.asarray(np.linalg.norm(self.vehicle - self.history.target, axis=1))

    @property
    def frames_a_second(self) -> float:
        """Samples shown a second: real time, within what an eye can follow."""
        t = self.history.t
        period = float(t[1] - t[0]) if len(t) > 1 else 1.0
        return float(np.clip(1.0 / period, FEWEST_FRAMES_A_SECOND, MOST_FRAMES_A_SECOND))

    @property
    def speed(self) -> float:
        """Seconds of the run shown in a second."""
        t = self.history.t
        return self.frames_a_second * (float(t[1] - t[0]) if len(t) > 1 else 1.0)

    def corners(self) -> tuple[Array, Array]:
        """Lowest and highest coordinates ``(d,)`` of the vehicle's and the target's path, with a margin, m."""
        points = np.concatenate([self.vehicle, self.history.target])
        points = points[np.isfinite(points).all(axis=1)]
        if not len(points):
            return -np.ones(self.history.dimension), np.ones(self.history.dimension)
        low, high = points.min(axis=0), points.max(axis=0)
        margin = 0.06 * max(float(np.max(high - low)), 1e-3)
        return low - margin, high + margin

    def close_up(self) -> float:
        """Half the side of a square around the target that shows the settled vehicle and forecast, m."""
        late = slice(len(self.history.t) // 2, None)
        mean = self.history.forecast_mean[late]
        reach = np.linalg.norm(mean - mean[:, :1], axis=2).max(axis=1)
        sizes = [values[np.isfinite(values)] for values in (self.distance[late], reach)]
        return 1.3 * max(1e-3, *(float(np.quantile(size, 0.9)) for size in sizes if size.size))


def outline(covariance: Array, axes: tuple[int, int], corners: int = 49) -> Array:
    """Outline around zero of the 95 % region, seen along the axes left out.

    Parameters
    ----------
    covariance
        Σ ``(d, d)``, m².
    axes
        The two coordinates that are seen. In space the outline is the shadow of the ellipsoid.
    corners
        Points of the closed outline.

    Returns
    -------
    ``(corners, 2)``, m; NaN where Σ is not finite.
    """
    seen = covariance[np.ix_(axes, axes)]
    if not np.isfinite(seen).all():
        return np.full((corners, 2), np.nan)
    values, vectors = np.linalg.eigh(seen)
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    angle = np.linspace(0.0, 2.0 * np.pi, corners)
    circle = np.stack([np.cos(angle), np.sin(angle)])
    return np.asarray(region_radius(len(covariance)) * (root @ circle).T)
