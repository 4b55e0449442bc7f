"""A new objective: good bearings, but not at any price of acceleration.

gbt-ocp run new_objective.py
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from gbt_ocp import TrackingProblem
from gbt_ocp.guidance.objectives import BearingSimilarity
from gbt_ocp.ocp.trajectory import FlatPoint


class EconomicalSimilarity:
    """The paper's expected similarity, less ``price`` times the squared acceleration of the position.

    An objective is a sum over the endpoints of the pieces, to be maximised.
    """

    price = 0.002  # for 1 (m/s²)² at one endpoint, where the similarity is at most 1

    def __init__(self) -> None:
        self.similarity = BearingSimilarity(dimension=2)

    @property
    def shapes(self) -> Mapping[str, tuple[int, int]]:
        """Numbers needed at one endpoint: name to shape. Here those of the similarity."""
        return self.similarity.shapes

    def value(self, point: FlatPoint, parameters: Mapping[str, Any]) -> Any:
        """The term at one endpoint: a CasADi expression of ``point`` and of the numbers named in ``shapes``."""
        return self.similarity.value(point, parameters) - self.price * ca.sumsqr(point.ddz[:2])

    def bind(self, pieces: int, data: Mapping[str, Any]) -> dict[str, NDArray[np.float64]]:
        """Those numbers for all endpoints, (p, *shape), from a solve's ``forecast`` and ``desired`` bearings."""
        return self.similarity.bind(pieces, data)


problem = TrackingProblem(
    name="economical",
    dimension=2,
    description="the figure eight of the paper, with a price on acceleration",
    target={"kind": "case2"},
    objective=EconomicalSimilarity,
    defaults={"duration_s": 20.0, "planner": {"formulation": "hard", "pieces": 10}},
)
