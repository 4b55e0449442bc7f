"""The section ``pilot``: what a pilot does with inputs that come late, or not at all."""

from __future__ import annotations

from gbt_ocp.experiments.config.keys import Section, key


class PilotSection(Section):
    """The online loop without a simulated world."""

    late_s: float = key(2.0, "Age in s up to which measurements and navigations that come late are taken.", ge=0.0)
    lead_s: float | None = key(
        None,
        "How far ahead on the plan setpoints are taken, in s: about the lag of the autopilot. null is a sampling "
        "period, or plant.autopilot_s with command: setpoint.",
        "null, or a number > 0",
        gt=0.0,
    )
    navigation_gap_s: float = key(
        1.0, "Longest time in s between navigations over which the own state is interpolated, or carried on.", gt=0.0
    )
