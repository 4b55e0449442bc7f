"""Bootstrap intervals of paired quantities, whose resampled units are runs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.stats import bootstrap

RESAMPLES = 1000
CONFIDENCE = 0.95

STATISTICS = {"mean": np.nanmean, "median": np.nanmedian}


def interval(values: ArrayLike, clusters: Sequence[Any], statistic: str) -> tuple[float, float, float]:
    """A statistic with its percentile bootstrap interval.

    Steps of one run resemble each other, so runs are drawn with replacement, each with all its values. For a paired
    interval the values are differences (or logarithms of ratios) of the same problem under two treatments.

    Parameters
    ----------
    values
        One a problem ``(N,)``; values that are not finite are left out.
    clusters
        What run each belongs to ``(N,)``.
    statistic
        ``mean`` or ``median``.

    Returns
    -------
    The statistic and the ends of its 95 % interval; NaN without values; with a single run the ends are NaN.
    """
    data = np.asarray(values, dtype=float)
    finite = np.isfinite(data)
    data, labels = data[finite], [label for label, keep in zip(clusters, finite, strict=True) if keep]
    if not data.size:
        return np.nan, np.nan, np.nan
    apply: Any = STATISTICS[statistic]
    centre = float(apply(data))
    names, index = np.unique(np.array([str(label) for label in labels]), return_inverse=True)
    if len(names) < 2:
        return centre, np.nan, np.nan
    table = np.full((len(names), int(np.bincount(index).max())), np.nan)
    seen = np.zeros(len(names), dtype=int)
    for row, value in zip(index, data, strict=True):
        table[row, seen[row]] = value
        seen[row] += 1

    def of_runs(drawn: Any, axis: int = -1) -> Any:
        rows = table[np.moveaxis(np.asarray(drawn), axis, -1)]
        return apply(rows.reshape(*rows.shape[:-2], -1), axis=-1)

    found = bootstrap(
        (np.arange(len(names)),),
        of_runs,
        n_resamples=RESAMPLES,
        confidence_level=CONFIDENCE,
        method="percentile",
        vectorized=True,
        rng=np.random.default_rng(0),
    ).confidence_interval
    return centre, float(found.low), float(found.high)
