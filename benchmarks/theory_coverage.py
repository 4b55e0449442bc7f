"""How often the error bounds hold when the target is a draw of the Gaussian process itself: a table of docs/theory.md.

    python benchmarks/theory_coverage.py [--draws 20000] [--tuned 500]

Every row is the fraction of draws in which a bound holds at every t in T_k at once, with its Clopper-Pearson interval
of 95 %. Windows of 20 bearings in the plane and 12 in space, T = 0.1 s, n = 11, squared exponential of 3 s and 3 m.

orbit   the vehicle circles the target, so that the bearings are the desired ones whatever the target does: the
        theorems' setting, in which G does not depend on the target,
still   the vehicle stands 5 m from the prior mean, so that the bearings depend on the target,
tuned   as orbit, with the tracker's own tuning instead of the true hyperparameters,
latent  as orbit, with a coregionalised prior whose latent functions have their own length scales.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.stats import binomtest

from gbt_ocp.models.bearings import DesiredBearing, cumulative_bearing_matrix, tangent_basis, unit_bearing
from gbt_ocp.tracking.gp.bounds import (
    bearing_bound,
    confidence_radius,
    coregionalized_bound,
    posterior_bound,
    weighted_bearing_bound,
)
from gbt_ocp.tracking.gp.gp import GaussianProcessTracker

Array = NDArray[np.float64]

PERIOD = 0.1
HORIZON = 11
LENGTH, AMPLITUDE, NUGGET = 3.0, 3.0, 1e-9
DELTAS = (0.5, 0.2, 0.1, 0.05, 0.01)
WINDOW = {2: 20, 3: 12}
TURN = {2: 10, 3: 4}


def instants(dimension: int) -> tuple[Array, Array]:
    """Times of the window and of T_k, which begins with the last of the window."""
    window = PERIOD * np.arange(WINDOW[dimension])
    return window, window[-1] + PERIOD * np.arange(HORIZON + 1)


def prior(dimension: int, latent: bool) -> Callable[[Array], Array]:
    """k_f of a lag: isotropic, or with weights that couple the axes and a length scale for each latent function."""
    weights = AMPLITUDE * np.eye(dimension)
    scales = np.full(dimension, LENGTH)
    if latent:
        weights = AMPLITUDE * (np.eye(dimension) + 0.4 * np.tri(dimension, k=-1))
        scales = np.array([1.0, 3.0, 9.0])[:dimension]
    return lambda lag: np.einsum(
        "aq,...q,bq->...ab", weights, np.exp(-0.5 * (np.asarray(lag)[..., None] / scales) ** 2), weights
    )


def draw(k: Callable[[Array], Array], times: Array, count: int, rng: np.random.Generator) -> Array:
    """Draws of the process at the times ``(count, K, d)``."""
    blocks = k(times[:, None] - times[None, :])
    size, d = len(times), blocks.shape[-1]
    values, vectors = np.linalg.eigh(np.swapaxes(blocks, 1, 2).reshape(size * d, size * d))
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    return np.asarray((rng.standard_normal((count, size * d)) @ root.T).reshape(count, size, d))


def posterior(
    k: Callable[[Array], Array], bearings: Array, positions: Array, dimension: int, rng: np.random.Generator
) -> tuple[Array, Array]:
    """Posterior mean and covariance at T_k, one window of bearings ``(count, N, d)`` a draw, by dense matrices."""
    window, ahead = instants(dimension)
    basis = tangent_basis(bearings)
    variance = NUGGET * AMPLITUDE**2
    y = np.einsum("cjar,cja->cjr", basis, positions)
    y = y + np.sqrt(variance) * rng.standard_normal(y.shape)
    omega = np.einsum("cjar,jiab,cibs->cjris", basis, k(window[:, None] - window[None, :]), basis, optimize=True)
    count, rows = len(y), y.shape[1] * y.shape[2]
    omega = omega.reshape(count, rows, rows) + variance * np.eye(rows)
    cross = np.einsum("tjab,cjbr->ctajr", k(ahead[:, None] - window[None, :]), basis, optimize=True)
    cross = cross.reshape(count, -1, rows)
    solved = np.linalg.solve(omega, np.swapaxes(cross, 1, 2))
    mean = np.einsum("crt,cr->ct", solved, y.reshape(count, rows)).reshape(count, len(ahead), dimension)
    sigma = np.empty((count, len(ahead), dimension, dimension))
    for t in range(len(ahead)):
        part = slice(t * dimension, (t + 1) * dimension)
        sigma[:, t] = k(np.zeros(())) - cross[:, part] @ solved[:, :, part]
    return mean, sigma


def report(label: str, dimension: int, held: dict[float, Array]) -> None:
    """One row: the fraction of draws for each δ, with its interval, and a mark where 1 - δ is not reached."""
    cells = []
    for delta in DELTAS:
        count, good = held[delta].size, int(held[delta].sum())
        found = binomtest(good, count)
        interval = found.proportion_ci(0.95, method="exact")
        mark = " **<**" if interval.high < 1.0 - delta else ""
        cells.append(f"{good / count:.4f} ({interval.low:.3f}-{interval.high:.3f}){mark}")
    print(f"| {label} | {dimension} | " + " | ".join(cells) + " |", flush=True)


def known(name: str, dimension: int, draws: int, rng: np.random.Generator) -> None:
    """Rows with the true hyperparameters."""
    window, ahead = instants(dimension)
    k = prior(dimension, name == "latent")
    path = draw(k, np.concatenate([window, ahead[1:]]), draws, rng)
    seen, truth = path[:, : len(window)], path[:, len(window) - 1 :]
    if name == "still":
        bearings = unit_bearing(seen, np.array([5.0, 0.0, 0.0])[:dimension])
    else:
        desired = DesiredBearing(dimension, 2.0 * np.pi / (PERIOD * TURN[dimension]))(window)
        bearings = np.broadcast_to(desired, seen.shape) if name == "orbit" else desired[None] + 0.0 * seen
    mean, sigma = np.empty_like(truth), np.empty((draws, len(ahead), dimension, dimension))
    for part in np.array_split(np.arange(draws), max(1, draws // 500)):
        mean[part], sigma[part] = posterior(k, bearings[part], seen[part], dimension, rng)
    error = np.linalg.norm(mean - truth, axis=2)
    largest = np.sqrt(np.maximum(np.linalg.eigvalsh(sigma)[..., -1], 0.0))
    radius = {delta: confidence_radius(dimension, delta, len(ahead)) for delta in DELTAS}
    report(f"{name}, lemma 1", dimension, {delta: np.all(error <= r * largest, axis=1) for delta, r in radius.items()})
    cross, own = k(ahead[:, None] - window[None, :]), k(np.zeros(()))
    noise = NUGGET * AMPLITUDE**2
    for label in ("theorem 2", "weighted") if name == "latent" else ("theorem 1, constant 1", "theorem 1"):
        sizes = np.empty_like(error)
        for c in range(draws if name == "still" else 1):
            b = bearings[c]
            if label == "theorem 2":
                bound = coregionalized_bound(cross, own, b, delta=0.5, noise_variance=noise)
            elif label == "weighted":
                bound = weighted_bearing_bound(cross, own, b, delta=0.5, noise_variance=noise)
            else:
                matrix = cumulative_bearing_matrix(b)
                one = 1.0 if label.endswith("1, constant 1") else None
                bound = bearing_bound(
                    cross[..., 0, 0], own[0, 0], matrix, delta=0.5, noise_variance=noise, constant=one
                )
            sizes[c if name == "still" else slice(None)] = bound / confidence_radius(dimension, 0.5, len(ahead))
        held = {delta: np.all(error <= r * sizes, axis=1) for delta, r in radius.items()}
        report(f"{name}, {label} (median bound over lemma 1's: {np.median(sizes / largest):.0f})", dimension, held)


def tuned(dimension: int, draws: int, rng: np.random.Generator) -> None:
    """Rows with the tracker of preset ``default``, which tunes its hyperparameters on the same window."""
    window, ahead = instants(dimension)
    path = draw(prior(dimension, False), np.concatenate([window, ahead[1:]]), draws, rng)
    desired = DesiredBearing(dimension, 2.0 * np.pi / (PERIOD * TURN[dimension]))(window)
    held: dict[str, dict[float, list[bool]]] = {
        name: {delta: [] for delta in DELTAS} for name in ("lemma 1", "theorem 1")
    }
    for positions in path:
        tracker = GaussianProcessTracker(dimension, window=len(window))
        for time, bearing, position in zip(window, desired, positions, strict=False):
            tracker.update(float(time), bearing, position - 0.5 * bearing)
        forecast = tracker.predict(ahead)
        error = np.linalg.norm(forecast.mean - positions[len(window) - 1 :], axis=1)
        for delta in DELTAS:
            held["lemma 1"][delta].append(bool(np.all(error <= posterior_bound(forecast.covariance, delta=delta))))
            held["theorem 1"][delta].append(bool(np.all(error <= tracker.bound(ahead, delta))))
    for name, found in held.items():
        report(f"tuned, {name}", dimension, {delta: np.array(values) for delta, values in found.items()})


def main() -> None:
    """Print the table as Markdown."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--draws", type=int, default=20_000)
    parser.add_argument("--tuned", type=int, default=500)
    arguments = parser.parse_args()
    rng = np.random.default_rng(0)
    print("| bound | d | " + " | ".join(f"1 - δ = {1.0 - delta:g}" for delta in DELTAS) + " |")
    print("|---|---|" + "---|" * len(DELTAS))
    for name in ("orbit", "still", "latent"):
        for dimension in (2, 3):
            known(name, dimension, arguments.draws, rng)
    for dimension in (2, 3):
        tuned(dimension, arguments.tuned, rng)


if __name__ == "__main__":
    main()
