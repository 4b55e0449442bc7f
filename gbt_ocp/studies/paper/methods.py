"""The methods of tables 2 and 3: each with its observer strategy, its grid of parameters, and the paper's figures."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

PLANE = ("case1", "case2", "case3")
SPACE = ("case4", "case5", "case6")

GBT = "GBT"
FULL_POSITIONS = "IMM-KF-F"
"""The one method that sees where the target is, and not only in which direction."""

POLYNOMIAL = "PR"
POLYNOMIAL_SETTLED = "PR, settled"
"""Polynomial regression with the order that is best once the start is over: the rival of the settled error."""

Grid = Mapping[str, Sequence[Any]]


@dataclass(frozen=True)
class Method:
    """An estimator with the strategy that moves the vehicle for it.

    Attributes
    ----------
    name
        In the tables.
    keys
        What makes the configuration this method.
    grids
        Grids searched one after the other, each with the best of those before; a key may be any of the configuration.
    score
        Column that the search makes small.
    """

    name: str
    keys: Mapping[str, Any]
    grids: Sequence[Grid] = ()
    score: str = "error_mean"


PAPER: dict[str, dict[str, tuple[float, float]]] = {
    "OE-S": {"case1": (1.069, 0.128), "case2": (1.114, 0.117), "case3": (1.119, 0.266)},
    "OE-CV": {"case1": (0.264, 0.081), "case2": (0.862, 0.049), "case3": (1.060, 0.057)},
    "PLKF": {
        "case1": (0.010, 0.003),
        "case2": (2.993, 0.321),
        "case3": (4.225, 0.078),
        "case4": (0.010, 0.004),
        "case5": (2.866, 0.492),
        "case6": (4.123, 0.318),
    },
    "IMM-PLKF": {
        "case1": (0.010, 0.001),
        "case2": (0.412, 0.063),
        "case3": (0.226, 0.036),
        "case4": (0.010, 0.002),
        "case5": (0.589, 0.107),
        "case6": (0.399, 0.079),
    },
    FULL_POSITIONS: {
        "case1": (0.003, 0.000),
        "case2": (0.243, 0.000),
        "case3": (0.129, 0.000),
        "case4": (0.003, 0.000),
        "case5": (0.355, 0.000),
        "case6": (0.167, 0.000),
    },
    POLYNOMIAL: {
        "case1": (0.011, 0.001),
        "case2": (0.311, 0.002),
        "case3": (0.053, 0.001),
        "case4": (0.008, 0.001),
        "case5": (0.214, 0.012),
        "case6": (0.084, 0.008),
    },
    GBT: {
        "case1": (0.026, 0.002),
        "case2": (0.059, 0.004),
        "case3": (0.052, 0.005),
        "case4": (0.014, 0.002),
        "case5": (0.053, 0.004),
        "case6": (0.035, 0.003),
    },
}
"""Tables 2 and 3 of the paper: mean and standard deviation of the average error over 50 runs, metres."""

_GAINS = (0.5, 1.0, 5.0, 10.0)
_CIRCLE: Grid = {"guidance.radial_gain": (1.0, 2.0, 5.0, 10.0)}
_COVARIANCE: Grid = {"tracker.initial_variance": _GAINS}
_VELOCITY_NOISE: Grid = {"tracker.process_noise": (0.001, 0.01, 0.1, 1.0)}
_MODEL_NOISE: Grid = {
    "tracker.process_noise": (0.001, 0.1, 1.0),
    "tracker.jerk_noise": (0.001, 0.1, 1.0, 10.0),
}
"""The paper does not give the noise of the filters' models; searched last, so that no filter suffers from a guess."""
_ORDER: Grid = {"tracker.order": (3, 5, 8, 10)}
_PLACES: Grid = {"desired_bearing.m": (10, 15, 20)}
_HELIX_GAIN: Grid = {"guidance.gain": (0.5, 1.5, 3.0, 5.0)}
_HELIX_SHAPE: Grid = {
    "guidance.amplitude_z": (1.5, 3.5, 5.5),
    "guidance.amplitude_y": (1.5, 3.5, 5.5),
    "guidance.frequency": (0.3, 0.5, 0.7),
}


def _informed(
    name: str, kind: str, own: Grid, dimension: int, noise: Sequence[Grid] = (), score: str = "error_mean"
) -> Method:
    """A method whose vehicle seeks informative bearings: placed in the plane, along a helix in space."""
    if dimension == 2:
        keys = {"tracker.kind": kind, "guidance.kind": "fim_placement"}
        return Method(name, keys, [{**own, **_PLACES}, *noise], score)
    keys = {"tracker.kind": kind, "guidance.kind": "helical"}
    return Method(name, keys, [{**own, **_HELIX_GAIN}, _HELIX_SHAPE, *noise], score)


def methods(dimension: int) -> list[Method]:
    """The methods compared in the plane (2) or in space (3), in the order of the paper."""
    circling = [
        Method(
            "OE-S",
            {"tracker.kind": "oe_s", "guidance.kind": "circumnavigation"},
            [{"tracker.position_gain": _GAINS, **_CIRCLE}],
        ),
        Method(
            "OE-CV",
            {"tracker.kind": "oe_cv", "guidance.kind": "circumnavigation"},
            [{"tracker.position_gain": _GAINS, "tracker.velocity_gain": (0.1, 0.5, 1.0, 2.0), **_CIRCLE}],
        ),
    ]
    return [
        *(circling if dimension == 2 else []),
        _informed("PLKF", "plkf", _COVARIANCE, dimension, [_VELOCITY_NOISE]),
        _informed("IMM-PLKF", "imm_plkf", _COVARIANCE, dimension, [_MODEL_NOISE]),
        # It sees positions wherever the vehicle is; placing it costs nothing.
        Method(
            FULL_POSITIONS, {"tracker.kind": "imm_kf_f", "guidance.kind": "fim_placement"}, [_COVARIANCE, _MODEL_NOISE]
        ),
        _informed(POLYNOMIAL, "pr", _ORDER, dimension),
        _informed(POLYNOMIAL_SETTLED, "pr", _ORDER, dimension, score="error_settled"),
        Method(GBT, {"tracker.kind": "gp", "guidance.kind": "planner", "planner.formulation": "hard"}),
    ]
