"""Make ``problems/recorded_track.csv``: the made-up boat track that stands in for a recording.

A small boat leaves a quay, holds a course, weaves round two buoys, slows down for a U-turn, comes back fast and ends in
a wide circle. Its speed (1 to 2 m/s) and turn rate are given at knots, jittered from a fixed seed as a helmsman would,
and joined by cubic (PCHIP) splines from which the heading and the position are integrated; the result is sampled every
half second like a satellite receiver's and rounded to a tenth of a millimetre.

    python scripts/make_recorded_track.py [FILE]
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

Array = NDArray[np.float64]

SEED = 20240517
SPACING = 0.5
"""Seconds between samples."""

MANOEUVRES = [
    # t [s], speed [m/s], turn rate [rad/s]
    (0.0, 1.05, 0.00),
    (6.0, 1.50, 0.02),
    (14.0, 1.70, -0.02),
    (19.0, 1.55, 0.20),  # round the first buoy
    (24.0, 1.50, -0.24),  # round the second
    (29.0, 1.60, 0.12),
    (34.0, 1.75, 0.00),
    (42.0, 1.60, 0.03),
    (47.0, 1.15, 0.22),  # slow down and turn back
    (53.0, 1.10, 0.30),
    (58.0, 1.40, 0.06),
    (66.0, 1.90, -0.03),
    (74.0, 1.80, 0.00),
    (80.0, 1.45, -0.16),  # a wide circle to the right
    (92.0, 1.40, -0.17),
    (104.0, 1.30, -0.15),
    (110.0, 1.15, -0.05),
    (120.0, 1.05, 0.00),
]


def track(seed: int = SEED) -> Array:
    """Rows ``t, x, y`` ``(K, 3)`` in s and m, from the origin and at first along +x."""
    rng = np.random.default_rng(seed)
    times, speeds, rates = np.array(MANOEUVRES).T
    # inner knots only: the boat leaves and arrives on a straight course
    times[1:-1] += rng.uniform(-0.5, 0.5, len(times) - 2)
    speeds[1:-1] += rng.uniform(-0.04, 0.04, len(times) - 2)
    rates[1:-1] += rng.uniform(-0.01, 0.01, len(times) - 2)
    # these splines do not overshoot their knots, so speed and turn rate stay what the table says
    speed, heading = PchipInterpolator(times, speeds), PchipInterpolator(times, rates).antiderivative()

    fine = np.linspace(0.0, times[-1], 100 * round(times[-1] / SPACING) + 1)
    velocity = speed(fine)[:, None] * np.stack([np.cos(heading(fine)), np.sin(heading(fine))], axis=-1)
    steps = 0.5 * (velocity[1:] + velocity[:-1]) * np.diff(fine)[:, None]
    position = np.vstack([np.zeros(2), np.cumsum(steps, axis=0)])
    return np.column_stack([fine, position])[::100]


def main(file: Path) -> None:
    """Write the track."""
    rows = (f"{t:.1f},{x:.4f},{y:.4f}\n" for t, x, y in track() + 0.0)
    file.write_text("t,x,y\n" + "".join(rows), encoding="utf-8")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parents[1] / "problems" / "recorded_track.csv")
