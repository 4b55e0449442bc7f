"""Who takes part in the benchmark: our trackers, those of other packages, and the particle filters, by name."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from importlib.util import find_spec
from typing import Any, TypeAlias

import numpy as np

from gbt_ocp.experiments.build.tracker_kinds import TRACKERS
from gbt_ocp.experiments.build.trackers import build_tracker
from gbt_ocp.models.sensors import BearingSensor
from gbt_ocp.studies.scenarios.motion_laws import HeldTurnLaw, MotionLaw, SteadyLaw
from gbt_ocp.studies.scenarios.opponents import FilterPyImm, StoneSoupTracker
from gbt_ocp.studies.scenarios.particles import LawParticleFilter
from gbt_ocp.studies.scenarios.scenario import CONTESTANT, PublicScenario, RecordedRun, stream
from gbt_ocp.tracking.priors import LogNormal

Maker: TypeAlias = Callable[[PublicScenario, RecordedRun, int], Any]
"""Makes a tracker for a scenario, a recording and the number of a run; ``None`` where it does not take part."""

LAW_PARTICLES = 20_000
"""Particles of the filters that move by a law."""


def settings(kind: str, recording: RecordedRun) -> dict[str, Any]:
    """The section ``tracker`` of one of our trackers, from what is known beforehand. Nothing is tuned on scenarios."""
    known = recording.knowledge
    degrees, pace = math.degrees(known.bearing_std), known.pace
    ranged = {"initial_range_m": known.range, "bearing_std_deg": degrees}
    guess = {**ranged, "initial_range_std_m": known.range_std, "initial_speed_std": known.speed}
    size = {} if known.size is None else {"size": list(known.size)}
    share = math.sqrt(math.log1p((known.range_std / known.range) ** 2))
    priors = {
        "speed": {"median": known.speed, "log_std": 1.0},
        "range": {"median_m": known.range, "log_std": share},
    }
    changes = {"speed_change_std": [0.1, 0.2, 0.4]} if known.speed_varies else {}
    turns = {"turn_rate_std": [rate / pace for rate in (0.01, 0.03, 0.09)], "speed_time_s": 30.0 * pace, **changes}
    shape = {
        **priors,
        **turns,
        "noise": {"std_deg": (1.5 if known.speed_varies else 1.15) * degrees},
        "bin_s": 2.0 * pace,
        "window_s": 120.0 * pace,
        "update_s": pace,
        "turn_kernel": "ou",
        "turn_time_s": [8.0 * pace, 25.0 * pace],
    }
    sections: dict[str, dict[str, Any]] = {
        "ekf": {**guess, **size, "process_noise": known.acceleration_density},
        "imm_ekf": {
            **guess,
            **size,
            "initial_variance": known.speed**2,
            "process_noise": 1e-3 * known.acceleration_density,
            "jerk_noise": 1e-2 * known.acceleration_density / pace**2,
            "stay_probability": math.exp(-_period(recording) / (10.0 * pace)),
            "turn_rate_max": 0.1 / pace,
        },
        "plkf": {
            **ranged,
            "prior": _first_prior(recording),
            "initial_variance": known.speed**2,
            "process_noise": known.acceleration_density,
            "bias_compensated": True,
        },
        "gp": {
            **size,
            "noise": {
                "std_deg": degrees,
                "bin_s": 1.5 * pace,
                "window_s": 60.0 * pace,
                "kernel": "velocity_matern32",
                "scale": {"median": known.speed},
                "length_scale": {"median_s": 20.0 * pace},
                "range": {"median_m": known.range, "log_std": share},
            },
        },
        "motion_gp": {**shape, **size},
        "mixture": {
            **shape,
            "noise": {"std_deg": degrees},
            "member_bin_s": 0.5 * pace,
            "hold_s": 20.0 * pace,
            "evidence_s": 30.0 * pace,
        },
        "held_turn": {
            **priors,
            "noise": {"std_deg": degrees},
            "bin_s": 0.5 * pace,
            "turn_rate_std": [0.03 / pace],
            "hold_s": 20.0 * pace,
            "speed_time_s": 30.0 * pace,
            **changes,
        },
    }
    return sections[kind]


def _first_prior(recording: RecordedRun) -> dict[str, Any]:
    """What our extended filter makes of the first bearing, for the pseudo-linear one."""
    first = next(one for at in recording.sightings for one in at if one.kind != "size")
    mean, covariance = recording.knowledge.first_position(first.bearing, first.position)
    return {"position": mean.tolist(), "covariance": covariance.tolist()}


def _period(recording: RecordedRun) -> float:
    return float(np.median(np.diff(recording.times)))


def _ours(kind: str) -> Maker:
    def make(scenario: PublicScenario, recording: RecordedRun, run: int) -> Any:
        section = TRACKERS[kind].section.model_validate(
            {"kind": kind, **settings(kind, recording)}, context={"d": scenario.dimension}
        )
        sensor = BearingSensor(_period(recording), recording.knowledge.bearing_std)
        return build_tracker(section, recording.own[0], sensor)

    return make


def _stone_soup(kind: str) -> Maker:
    def make(scenario: PublicScenario, recording: RecordedRun, run: int) -> Any:
        return StoneSoupTracker(kind, recording.knowledge, scenario.dimension, seed=run)

    return make


def _filterpy(scenario: PublicScenario, recording: RecordedRun, run: int) -> Any:
    return FilterPyImm(recording.knowledge, scenario.dimension)


def generic_law(recording: RecordedRun) -> MotionLaw:
    """A guessed law: turn rates that are held, normal, and a speed that varies; or white noise of the acceleration."""
    known = recording.knowledge
    if not known.turns:
        return SteadyLaw(known.speed, known.speed, density=known.acceleration_density)
    return HeldTurnLaw(
        known.speed,
        1.0,
        known.turn_rate,
        (10.0 * known.pace, 50.0 * known.pace),
        normal=True,
        speed_change=0.2 if known.speed_varies else 0.05,
        speed_time=40.0 * known.pace,
        climb=0.1 * known.speed,
    )


def _particles(
    law: Callable[[PublicScenario, RecordedRun], MotionLaw | None],
) -> Maker:
    def make(scenario: PublicScenario, recording: RecordedRun, run: int) -> Any:
        known, chosen = recording.knowledge, law(scenario, recording)
        if chosen is None:
            return None
        share = math.sqrt(math.log1p((known.range_std / known.range) ** 2))
        return LawParticleFilter(
            chosen,
            scenario.dimension,
            count=LAW_PARTICLES,
            bearing_std=known.bearing_std,
            range=LogNormal(known.range, share),
            bin_width=0.5 * known.pace,
            rng=stream(run, CONTESTANT),
            size=None if known.size is None else LogNormal(*known.size),
        )

    return make


@dataclass(frozen=True)
class Contestant:
    """A tracker of the benchmark.

    Attributes
    ----------
    name
        On the command line.
    says
        What it is.
    make
        Called with the scenario, the recording and the number of the run; ``None`` where it does not take part.
    package
        Module of the other package that it is from.
    """

    name: str
    says: str
    make: Maker
    package: str | None = None

    @property
    def installed(self) -> bool:
        """Whether its package is there."""
        return self.package is None or find_spec(self.package) is not None


CONTESTANTS = {
    one.name: one
    for one in (
        *(Contestant(kind, TRACKERS[kind].says, _ours(kind)) for kind in (
            "ekf", "imm_ekf", "plkf", "gp", "motion_gp", "mixture", "held_turn",
        )),
        Contestant("stonesoup_ekf", "Stone Soup's extended Kalman filter", _stone_soup("ekf"), "stonesoup"),
        Contestant("stonesoup_ukf", "Stone Soup's unscented Kalman filter", _stone_soup("ukf"), "stonesoup"),
        Contestant("stonesoup_pf", "Stone Soup's particle filter", _stone_soup("particle"), "stonesoup"),
        Contestant("filterpy_imm", "FilterPy's interacting multiple models", _filterpy, "filterpy"),
        Contestant(
            "particles_generic",
            "particles under a guessed law of held turn rates",
            _particles(lambda scenario, recording: generic_law(recording)),
        ),
        Contestant(
            "particles_exact",
            "particles under the law by which the target moves: the limit",
            _particles(lambda scenario, recording: scenario.law),
        ),
    )
}  # fmt: skip
"""All of them by name."""
