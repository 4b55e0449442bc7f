"""Optimal desired bearings (``eq22``, ``op_bearings``) against a numerical optimiser: tables of docs/theory.md.

    python benchmarks/theory_optimal_bearings.py [--restarts 20]

First the metric of the paper, the condition number of the cumulative bearing matrix. Then what it stands for: the norm
of the posterior covariance of a Gaussian process, averaged over T_k, for the paper's bearings and for those that an
optimiser finds.
"""

from __future__ import annotations

import argparse

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from gbt_ocp.models.bearings import DesiredBearing, condition_number, cumulative_bearing_matrix
from gbt_ocp.tracking.gp.kernels import KERNELS
from gbt_ocp.tracking.gp.posterior import Hyperparameters, condition
from gbt_ocp.tracking.window import Window

Array = NDArray[np.float64]

PERIOD = 0.1


def on_the_sphere(angles: Array, dimension: int) -> Array:
    """Bearings from azimuth and, in space, elevation."""
    a = angles.reshape(-1, dimension - 1)
    if dimension == 2:
        return np.column_stack([np.cos(a[:, 0]), np.sin(a[:, 0])])
    level = np.cos(a[:, 1])
    return np.column_stack([level * np.cos(a[:, 0]), level * np.sin(a[:, 0]), np.sin(a[:, 1])])


def spread(bearings: Array, length_scale: float, nugget: float) -> float:
    """Mean over T_k of √‖Σ‖, for a process of unit amplitude."""
    window = Window(len(bearings))
    for k, bearing in enumerate(bearings):
        window.append(k * PERIOD, bearing, np.zeros(bearings.shape[1]))
    theta = Hyperparameters(np.log([length_scale]), 0.0, nugget)
    posterior, _ = condition(KERNELS["se"], theta, window.measurements(), np.zeros(bearings.shape[1]))
    sigma = posterior.predict(PERIOD * (len(bearings) - 1 + np.arange(12.0))).covariance
    return float(np.mean(np.sqrt(np.maximum(np.linalg.eigvalsh(sigma)[:, -1], 0.0))))


def metric(restarts: int, rng: np.random.Generator) -> None:
    """Condition numbers of the stated sets and of those found."""
    print("| d | m | cond - 1, stated set | cond - 1, best found | starts that end below 1e-4 |\n|---|---|---|---|---|")
    for d in (2, 3):
        for m in range(d + 1, d + 8):
            stated = DesiredBearing(d, 2.0 * np.pi / (PERIOD * m))(PERIOD * np.arange(m))
            found = []
            for _ in range(restarts):
                # The logarithm is smoother near its minimum than the ratio; Nelder-Mead needs no derivative there.
                result = minimize(
                    lambda x, d=d: np.log(condition_number(cumulative_bearing_matrix(on_the_sphere(x, d)))),
                    rng.uniform(0.0, np.pi, m * (d - 1)),
                    method="Nelder-Mead",
                    options={"maxfev": 20_000, "xatol": 1e-10, "fatol": 1e-14, "adaptive": True},
                )
                found.append(np.expm1(result.fun))
            cond = condition_number(cumulative_bearing_matrix(stated))
            reached = int(np.sum(np.array(found) < 1e-4))
            print(f"| {d} | {m} | {cond - 1.0:.1e} | {min(found):.1e} | {reached} of {restarts} |", flush=True)


def meaning(restarts: int, rng: np.random.Generator) -> None:
    """Posterior spread of the stated bearings and of the best found for it."""
    print("\n| d | length scale (s) | nugget | stated set | best found | its cond |\n|---|---|---|---|---|---|")
    for d, count, turn in ((2, 20, 10), (3, 12, 4)):
        stated = DesiredBearing(d, 2.0 * np.pi / (PERIOD * turn))(PERIOD * np.arange(count))
        for length_scale in (1.0, 3.0):
            for nugget in (1e-10, 1e-4):
                best, where = np.inf, stated
                for _ in range(restarts):
                    result = minimize(
                        lambda x, d=d, s=length_scale, v=nugget: np.log(spread(on_the_sphere(x, d), s, v)),
                        rng.uniform(0.0, np.pi, count * (d - 1)),
                        method="L-BFGS-B",
                        options={"maxiter": 100},
                    )
                    if result.fun < best:
                        best, where = float(result.fun), on_the_sphere(result.x, d)
                cond = condition_number(cumulative_bearing_matrix(where))
                ours = spread(stated, length_scale, nugget)
                print(
                    f"| {d} | {length_scale} | {nugget:g} | {ours:.2e} | {np.exp(best):.2e} | {cond:.2f} |", flush=True
                )


def main() -> None:
    """Print both tables as Markdown."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--restarts", type=int, default=20)
    arguments = parser.parse_args()
    rng = np.random.default_rng(0)
    metric(arguments.restarts, rng)
    meaning(max(1, arguments.restarts // 4), rng)


if __name__ == "__main__":
    main()
