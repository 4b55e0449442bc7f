"""How far the rows of a fit are trusted, under heavy tails."""

from __future__ import annotations

import numpy as np

from gbt_ocp.tracking.bins import BinnedBearings
from gbt_ocp.tracking.displacement.fit import DisplacementFit, NodePosterior
from gbt_ocp.tracking.displacement.rows import BearingRows, bearing_rows, tail_weights
from gbt_ocp.typing import Array


def row_trust(
    rows: BearingRows,
    last: tuple[DisplacementFit, NodePosterior] | None,
    samples: BinnedBearings,
    places: Array,
    white_variance: float,
    tails: float | None,
) -> Array:
    """Weights of the rows ``(R,)``; ones without heavy tails, or without a fit that says what is expected.

    Parameters
    ----------
    rows
        Of the bearings, and behind them of other measurements, which are trusted.
    last
        The last fit and its solution, if there is one.
    samples
        The bearings.
    places
        Where the rows are linearised ``(N + M, d)`` in metres.
    white_variance
        σ² of a bearing in rad².
    tails
        Degrees of freedom of Student's t; ``None`` is Gaussian.
    """
    trust = np.ones(len(rows.values))
    if tails is None or last is None:
        return trust
    fit, solution = last
    covariance = fit.predict(solution, samples.times).covariance
    unseen = samples.times > fit.latest
    seen = rows if rows.others is None else bearing_rows(samples, places[: len(samples)])
    own_std = fit.noise.own_std
    trust[: len(seen.values)] = tail_weights(seen, samples, covariance, unseen, white_variance, own_std, tails)
    return trust
