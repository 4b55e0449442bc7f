"""How far a vehicle that is not its model strays from its plans, by way of following and bandwidth.

    python benchmarks/follower.py sea2d --seeds 3 --bandwidth 0.5 1 2 3 5
    python benchmarks/follower.py case2 --seeds 3 --duration 10 --bandwidth 2 5 10

The planner is given the true positions of the target, so that only planning and following count. Each line is one way
to follow a plant; positions off the plan are those at the ends of sampling periods, pooled over the seeds.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterable
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

import gbt_ocp as gbt
from gbt_ocp.experiments.build.loop import build_loop
from gbt_ocp.models.targets import Target
from gbt_ocp.simulation.loop import simulate
from gbt_ocp.tracking.protocol import Forecast
from gbt_ocp.typing import Array

STD = 0.1
"""Posterior deviation in m that the planner is given."""

PARAMETERS = ("mass", "added_mass", "drag")
PLANTS: dict[str, tuple[str, ...]] = {
    "exact": (),
    "mass and drag 1.2": tuple(f"plant.{name}=1.2" for name in PARAMETERS),
    "lag 0.3 s": ("plant.lag_s=0.3",),
    "all": (
        *(f"plant.{name}=1.2" for name in PARAMETERS),
        "plant.thrust=0.9",
        "plant.lag_s=0.3",
        "plant.force=[40, 40]",
    ),
}
"""Overrides that make the plants; the force is about the drag of 0.3 m/s of water (30 N in surge, 56 N in sway)."""


class Truth:
    """A tracker that knows the target."""

    def __init__(self, target: Target) -> None:
        self._target = target

    def update(self, time: float, bearing: ArrayLike, own_position: ArrayLike) -> None:
        """Take in a bearing."""

    def predict(self, times: ArrayLike) -> Forecast:
        """The true positions."""
        d = self._target.dimension
        mean = self._target.position(np.asarray(times, dtype=float))
        return Forecast(mean, np.broadcast_to(STD**2 * np.eye(d), (len(mean), d, d)))


def runs(config: str, overrides: Iterable[str], seeds: int, duration: float) -> tuple[Array, float, float]:
    """Distances off the plan, the share of plans solved at first, and the largest thrust over its limit."""
    off, solved, peak = [], [], 0.0
    for seed in range(seeds):
        configuration = gbt.load_config(config, [f"duration_s={duration}", *overrides], seed)
        loop, start = build_loop(configuration)
        history = simulate(replace(loop, tracker=Truth(loop.target)), start, duration).history
        off.append(history.off_plan)
        asked = history.solver_status != ""
        solved.append((history.solver_status == "solved")[asked])
        peak = max(peak, float(np.nanmax(history.piece_thrust_peak)))
    return np.concatenate(off), float(np.mean(np.concatenate(solved))), peak


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("config")
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--duration", type=float, default=60.0)
    parser.add_argument("--bandwidth", type=float, nargs="+", default=[0.5, 1.0, 2.0, 3.0, 5.0])
    parser.add_argument("--set", dest="overrides", action="append", default=[], metavar="KEY=VALUE")
    options = parser.parse_args()
    ways = [("dynamics", ["vehicle.follow=dynamics"])]
    for bandwidth in options.bandwidth:
        chosen = ["vehicle.follow=feedback", f"vehicle.follow_bandwidth={bandwidth}"]
        ways.append((f"feedback, {bandwidth:g} rad/s", chosen))
    print("| plant | follow | off plan: median, m | 95 % | max | solved at first | peak thrust |\n" + "|---" * 7 + "|")
    for plant, differing in PLANTS.items():
        for way, chosen in ways:
            overrides = [*options.overrides, *differing, *chosen]
            off, solved, peak = runs(options.config, overrides, options.seeds, options.duration)
            found = np.nanpercentile(off, [50.0, 95.0, 100.0])
            distances = " | ".join(f"{value:.3g}" for value in found)
            print(f"| {plant} | {way} | {distances} | {solved:.3f} | {peak:.2f} |", flush=True)


if __name__ == "__main__":
    main()
