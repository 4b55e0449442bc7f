"""From a configuration to the C of its pilot."""

from __future__ import annotations

from gbt_ocp.experiments.build.pilot import build_pilot
from gbt_ocp.experiments.config.faults import ConfigurationError
from gbt_ocp.experiments.config.guidance import PlannerGuidanceSection
from gbt_ocp.experiments.config.schema import Configuration
from gbt_ocp.pilot.pilot_source import pilot_files

TRACKERS_IN_C = ("ekf", "gp", "motion_gp", "held_turn", "mixture")
"""Kinds of trackers that there are in C."""


def with_compiled_tracker(configuration: Configuration) -> Configuration:
    """The same with the tracker's arithmetic in C, for a kind that there is in C."""
    if configuration.tracker.kind not in TRACKERS_IN_C:
        return configuration
    tracker = configuration.tracker.model_copy(update={"engine": "compiled"})
    return configuration.model_copy(update={"tracker": tracker})


def pilot_sources(configuration: Configuration) -> dict[str, str]:
    """The C files of a pilot by name, beside those of its planner.

    Raises
    ------
    ConfigurationError
        If a part of it does not exist in C; one line that names the key.
    """
    kind, guidance = configuration.tracker.kind, configuration.guidance
    noisy = kind == "gp" and configuration.bearing_noise_deg > 0.0
    if kind not in TRACKERS_IN_C or (noisy and getattr(configuration.tracker, "noise", None) is not None):
        found = "gp for noisy bearings" if noisy else kind
        raise ConfigurationError(
            [
                f"--pilot: tracker.kind: found {found}; allowed: mixture, held_turn, motion_gp, ekf, or gp for exact "
                "bearings"
            ]
        )
    if not isinstance(guidance, PlannerGuidanceSection):
        raise ConfigurationError([f"--pilot: guidance.kind: found {guidance.kind}; allowed: planner"])
    try:
        return pilot_files(build_pilot(with_compiled_tracker(configuration)))
    except ConfigurationError:
        raise
    except ValueError as fault:
        raise ConfigurationError([f"--pilot: {fault}"]) from fault
