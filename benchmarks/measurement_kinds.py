"""What measurements with their own noise are worth: pings, angular sizes, two sensors; against bounds of their own.

Run ``python benchmarks/measurement_kinds.py [--runs 50]``. It prints the table of docs/benchmarks. The bounds are
Cramér-Rao bounds of a target of constant velocity, from the Fisher information of the measurements, computed here.
"""

from __future__ import annotations

import argparse

import numpy as np

from gbt_ocp.models import Measurement
from gbt_ocp.studies.scenarios.bearing_angle import STEP, to_and_fro
from gbt_ocp.tracking import ExtendedKalmanFilter, LogNormal, RangedPrior, take_in
from gbt_ocp.tracking.filters.ekf import FirstGuess

OWN_SPEED, SPEED, FIRST_RANGE, LEG = 1.75, 1.0, 60.0, 60.0
"""m/s along one line, m and s: the leg on which one ping every 30 s leaves 1.3 % of the final range unknown."""

ONE_DEGREE = np.deg2rad(1.0)
INSIDE = 5.991
"""95 % quantile of χ² with 2 degrees of freedom."""


def leg(seed, *, pings=False, sizes=False):
    """Measurements of a straight leg parallel to the target's, and where the target ends."""
    rng = np.random.default_rng(seed)
    size = 2.0 * np.exp(0.3 * rng.standard_normal())
    found = []
    for t in np.arange(0.0, LEG + 0.5):
        own, target = np.array([OWN_SPEED * t, 0.0]), np.array([SPEED * t, FIRST_RANGE])
        line, pose = target - own, np.append(own, 0.0)
        far = float(np.linalg.norm(line))
        azimuth = np.arctan2(line[1], line[0]) + ONE_DEGREE * rng.standard_normal()
        found.append(Measurement(t, "azimuth", azimuth, ONE_DEGREE).placed(pose))
        if pings and t > 0 and t % 30 == 0:
            found.append(Measurement(t, "range", far + rng.standard_normal(), 1.0, "ping").placed(pose))
        if sizes:
            angle = 2.0 * np.arctan(0.5 * size / far) * (1.0 + 0.1 * rng.standard_normal())
            found.append(Measurement(t, "size", angle, 0.1 * angle, "camera").placed(pose))
    return found, target


def leg_bound(*, pings=False, sizes=False, speed_std=None):
    """Bound ``(2, 2)`` of the last position. ``speed_std`` is a prior of the velocity, where pings are missing."""
    information = np.diag([0.0, 0.0, *([0.0, 0.0] if speed_std is None else 2 * [speed_std**-2]), 0.3**-2])
    for t in np.arange(0.0, LEG + 0.5):
        line = np.array([(SPEED - OWN_SPEED) * t, FIRST_RANGE])
        far = float(np.linalg.norm(line))
        unit = line / far
        across = np.array([-unit[1], unit[0]]) / far
        rows = [(np.concatenate([across, t * across, [0.0]]), ONE_DEGREE)]
        if pings and t > 0 and t % 30 == 0:
            rows.append((np.concatenate([unit, t * unit, [0.0]]), 1.0))
        if sizes:
            rows.append((np.concatenate([-unit / far, -t * unit / far, [1.0]]), 0.1))
        for slope, std in rows:
            information += np.outer(slope, slope) / std**2
    last = np.hstack([np.eye(2), LEG * np.eye(2), np.zeros((2, 1))])
    return last @ np.linalg.inv(information) @ last.T


def on_a_leg(runs, **kinds):
    """Root of the mean square error over that of the bound, and the share of runs inside the 95 % ellipse."""
    squares, inside = [], []
    for seed in range(runs):
        seen, target = leg(seed, **kinds)
        size = LogNormal(2.0, 0.3) if kinds.get("sizes") else None
        guess = FirstGuess(RangedPrior(np.zeros(2), range=FIRST_RANGE), 50.0, 1.0)
        tracker = ExtendedKalmanFilter(guess, process_noise=1e-8, bearing_std=ONE_DEGREE, size=size)
        for one in seen:
            take_in(tracker, one)
        mean, covariance = (values[0] for values in tracker.predict([LEG]))
        off = mean - target
        squares.append(off @ off)
        inside.append(off @ np.linalg.solve(covariance, off) < INSIDE)
    return float(np.sqrt(np.mean(squares) / np.trace(leg_bound(**kinds)))), float(np.mean(inside))


def towards_a_still_target(runs, sizes=True):
    """Figure 4b of Ning et al. (2024): the observer runs to and fro on the line to the target; error at 4 s in metres.

    The target of 1 m is still at (0, 10); the observer starts at (0, 5) with 4 m/s and accelerates towards (0, 5) by
    2 m/s². 50 measurements a second: bearings of 0.008 rad, angles of 0.01 rad. The estimate starts at (0, 8), at rest,
    with a size of 0.8 m and variances of 0.08.
    """
    errors = []
    for seed in range(runs):
        rng = np.random.default_rng(seed)
        own, still = to_and_fro(201, 10.0)
        target = still[0]
        prior = RangedPrior(np.zeros(2), np.array([0.0, 8.0]), 0.08 * np.eye(2), range=3.0)
        tracker = ExtendedKalmanFilter(
            FirstGuess(prior, 1.0, np.sqrt(0.08)),
            process_noise=5e-5,
            bearing_std=0.008,
            size=LogNormal(0.8, np.sqrt(0.08) / 0.8),
        )
        for k in range(201):
            t, pose = STEP * k, np.append(own[k], 0.0)
            line = target - pose[:2]
            azimuth = np.arctan2(line[1], line[0]) + 0.008 * rng.standard_normal()
            take_in(tracker, Measurement(t, "azimuth", azimuth, 0.008).placed(pose))
            if sizes:
                angle = 2.0 * np.arctan(0.5 / line[1]) + 0.01 * rng.standard_normal()
                take_in(tracker, Measurement(t, "size", angle, 0.01).placed(pose))
        errors.append(float(np.linalg.norm(tracker.predict([4.0]).mean[0] - target)))
    return float(np.mean(errors))


def two_sensors(logs, periods, density):
    """Mean square errors of a log each: with both sensors, and with that of 0.5° alone ``(logs, 2)``.

    The vehicle circles a target at 30 m for 120 s; errors are of the position now, each 0.2 s after the first 20 s. The
    target's acceleration is white noise of this density in m²/s³, which the filter knows.
    """
    stds, step = np.deg2rad([3.0, 0.5]), 0.2
    found = []
    for seed in range(logs):
        rng = np.random.default_rng(seed)
        times = np.arange(0.0, 120.0, step)
        kicks = np.sqrt(density * step) * rng.standard_normal((len(times), 2))
        target = np.cumsum(step * (np.array([0.8, 0.5]) + np.cumsum(kicks, axis=0)), axis=0)
        own = target + 30.0 * np.stack([np.cos(0.15 * times), np.sin(0.15 * times)], axis=-1)
        line = target - own
        azimuths = np.arctan2(line[:, 1], line[:, 0])[:, None] + stds * rng.standard_normal((len(times), 2))
        errors = []
        for chosen in ((0, 1), (1,)):
            guess = FirstGuess(RangedPrior(np.zeros(2), range=40.0), 30.0, 1.0)
            tracker = ExtendedKalmanFilter(guess, process_noise=density, bearing_std=stds[1])
            squares = []
            for k, t in enumerate(times):
                pose = np.append(own[k], 0.0)
                for one in chosen:
                    if k % round(periods[one] / step) == 0:
                        name = f"sensor {one}"
                        take_in(tracker, Measurement(t, "azimuth", azimuths[k, one], stds[one], name).placed(pose))
                if t >= 20.0:
                    squares.append(np.sum((tracker.predict([t]).mean[0] - target[k]) ** 2))
            errors.append(np.mean(squares))
        found.append(errors)
    return np.array(found)


def ideal_share(ratio, draws=200_000):
    """Share of logs in which the best estimator of a position is nearer with both sensors than with the better alone.

    Its error without the worse sensor is its error with it plus an independent part. ``ratio`` is of their variances.
    """
    rng = np.random.default_rng(0)
    with_both = rng.standard_normal((draws, 2))
    alone = with_both + np.sqrt(ratio - 1.0) * rng.standard_normal((draws, 2))
    return float(np.mean(np.sum(with_both**2, axis=1) < np.sum(alone**2, axis=1)))


def main():
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=50)
    parser.add_argument("--logs", type=int, default=20)
    given = parser.parse_args()
    final = float(np.hypot((SPEED - OWN_SPEED) * LEG, FIRST_RANGE))
    print("| measured | figure |\n|---|---|")
    relative = np.sqrt(np.trace(leg_bound(pings=True))) / final
    print(f"| ping: bound over the final range | {100 * relative:.2f} % |", flush=True)
    for name, kinds in (("ping", {"pings": True}), ("size", {"sizes": True})):
        ratio, inside = on_a_leg(given.runs, **kinds)
        print(f"| {name}: error over the bound, {given.runs} runs | {ratio:.2f} |")
        print(f"| {name}: inside the 95 % ellipse | {100 * inside:.0f} % |", flush=True)
    error = towards_a_still_target(given.runs)
    print(f"| Ning et al. 2024, figure 4b: error at 4 s | {error:.4f} m |", flush=True)
    for density, periods in ((0.05, (0.2, 3.0)), (0.05, (0.2, 1.0)), (0.05, (1.0, 1.0)), (1e-6, (0.2, 1.0))):
        errors = two_sensors(given.logs, periods, density)
        better = int(np.sum(errors[:, 0] < errors[:, 1]))
        ratio = 1.0 + (0.5 / 3.0) ** 2 * periods[1] / periods[0]
        sensors = f"3° every {periods[0]:g} s, 0.5° every {periods[1]:g} s"
        share = np.mean(errors[:, 0]) / np.mean(errors[:, 1])
        alone = f"mean square {share:.3f} of that alone (information {1.0 / ratio:.3f})"
        once = f"the best estimator of one position: {100 * ideal_share(ratio):.0f} %"
        found = f"better with both in {better} of {given.logs}; {alone}; {once}"
        print(f"| {sensors}, density {density:g} | {found} |", flush=True)


if __name__ == "__main__":
    main()
