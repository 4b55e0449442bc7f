"""The key ``tracker.engine``: what does the arithmetic of a tracker."""

from __future__ import annotations

from typing import Any

from gbt_ocp.experiments.config.keys import key


def engine() -> Any:
    """Of trackers that are in numpy unless it is asked for."""
    return key("numpy", "What does the arithmetic of motion_gp and ekf: numpy, or the C of codegen --pilot.")


def engine_or_auto() -> Any:
    """Of trackers that are in C wherever they can."""
    return key(
        "auto",
        "What does the arithmetic: numpy, or the C of codegen --pilot (compiled), with the same numbers to rounding. "
        "auto is compiled where there is a C compiler and one vehicle, but not for gp with noise, nor for a mixture of "
        "other members than held_turn and imm_ekf.",
    )
