"""The sections ``tracker.noise``: what is known of the noise of bearings, and what is done about it."""

from __future__ import annotations

import math
from typing import Literal

from pydantic import Field

from gbt_ocp.experiments.config.keys import Section, key

LEAST_STD_DEG = 0.1
"""Least noise of a bearing in degrees that a Kalman filter is given where the configuration states none."""


def filter_std(stated_deg: float | None, sensor: float) -> float:
    """σ in radians of a bearing for a Kalman filter: what is stated in degrees, or that of the sensor in radians."""
    return max(sensor, math.radians(LEAST_STD_DEG)) if stated_deg is None else math.radians(stated_deg)


class NoiseSection(Section):
    """What is known of the noise of the bearings."""

    std_deg: float = key(1.5, "White noise of a bearing in degrees.", gt=0.0)
    estimated: bool = key(False, "Whether the white noise is estimated, std_deg being expected.")
    correlated_deg: float = key(
        0.0, "Standard deviation in degrees of an error that lasts, whatever the number of bearings.", ge=0.0
    )
    correlation_s: float = key(5.0, "Time in s in which that error changes.", gt=0.0)
    own_std_m: float = key(0.0, "Standard deviation of the own position in m.", ge=0.0)


class ScalePriorSection(Section):
    """What is known of how fast the target moves, or of how far about."""

    median: float = key(
        1.0, "Median of the kernel's standard deviation on each axis: m/s of a velocity, m of a position.", gt=0.0
    )
    log_std: float = key(0.7, "Standard deviation of its logarithm.", gt=0.0)


class LengthScalePriorSection(Section):
    """What is known of how soon the target changes its motion."""

    median_s: float = key(4.0, "Median length scale in s.", gt=0.0)
    log_std: float = key(0.8, "Standard deviation of its logarithm.", gt=0.0)


class StartRangePriorSection(Section):
    """What is known of the range at the first bearing."""

    median_m: float = key(5.0, "Median range in m.", gt=0.0)
    log_std: float = key(1.0, "Standard deviation of its logarithm.", gt=0.0)


class NoisyBearingsSection(NoiseSection):
    """How the Gaussian-process tracker treats noisy bearings."""

    std_deg: float | None = key(  # type: ignore[assignment]  # here the sensor may say it
        None, "σ, white noise of a bearing in degrees; null takes sensor.noise_deg (motion_gp: default 1.5).", gt=0.0
    )
    window: int = key(40, "Bearings kept where they are not binned.", ge=2)
    bin_s: float | None = key(
        None, "Width in s of bins over which bearings are averaged; null takes each by itself.", gt=0.0
    )
    window_s: float = key(60.0, "Age in s of the oldest bin.", "a number of at least 2 bins", gt=0.0)
    kernel: Literal["velocity_se", "velocity_matern32", "velocity_ou", "se", "matern32", "matern52"] = key(
        "velocity_se", "Kernel of the velocity, or of the position."
    )
    hyperparameters: Literal["averaged", "maximum"] = key(
        "averaged", "Averaged over a grid by evidence, or the likeliest."
    )
    scale: ScalePriorSection = Field(default_factory=ScalePriorSection, description="Prior of the kernel's scale.")
    length_scale: LengthScalePriorSection = Field(
        default_factory=LengthScalePriorSection, description="Prior of the kernel's length scale."
    )
    range: StartRangePriorSection = Field(
        default_factory=StartRangePriorSection, description="Prior of the range, used until range is observable."
    )
    position_std_m: float = key(
        100.0, "Standard deviation in m of the target about the vehicle, once range is observable.", gt=0.0
    )
    tails: float | None = key(
        None, "Degrees of freedom of a Student-t likelihood against outliers; null is Gaussian.", gt=0.0
    )
    linearisations: int = key(2, "Times the window is linearised an update.", ge=1, le=10)
