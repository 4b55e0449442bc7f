"""Defaults that depend on the preset and on the dimension of the problem."""

from __future__ import annotations

from typing import Any

PRESETS: dict[str, dict[str, Any]] = {
    "default": {},
    "paper": {
        "tracker": {"centre": "origin", "amplitude": 1.0, "nugget": 1.0e-8, "noise": None, "prior": None},
        "planner": {"range_pull": 0.02},
        "desired_bearing": {"speed_mps": None},
    },
}
"""What a preset fills in (docs/paper.md, E7 and E8); `default` is the defaults of the models."""

DIMENSION_DEFAULTS: dict[int, dict[str, Any]] = {
    2: {
        "tracker": {"kind": "gp", "window": 20},
        "desired_bearing": {"m": 10},
        "vehicle": {"kind": "fossen", "parameters": "falcon"},
    },
    3: {
        "tracker": {"kind": "gp", "window": 12},
        "desired_bearing": {"m": 4, "axis": [0.0, 0.0, 1.0]},
        "vehicle": {"kind": "fossen", "parameters": "falcon"},
    },
}
"""What the dimension of a problem, or of a log, fills in."""
