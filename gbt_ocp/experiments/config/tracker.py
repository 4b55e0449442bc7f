"""The section ``tracker``: how the target's motion is estimated, one class a kind.

:mod:`gbt_ocp.experiments.build.tracker_kinds` lists the kinds, each with its section and the function that builds it.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BeforeValidator, Discriminator, Field, Tag, ValidationInfo

from gbt_ocp.experiments.config.engine import engine, engine_or_auto
from gbt_ocp.experiments.config.keys import (
    Covariance,
    PositionNumbers,
    Positive,
    PositiveNumbers,
    Section,
    as_tuples,
    key,
)
from gbt_ocp.experiments.config.noise import LEAST_STD_DEG, NoiseSection, NoisyBearingsSection

SizeNumbers = Annotated[tuple[Positive, ...], Field(min_length=2, max_length=2), BeforeValidator(as_tuples)]


def _size() -> Any:
    return key(
        None,
        "True size of the target, its median in m and the share by which it may differ; angular sizes estimate it.",
        "null, or a list of 2 numbers > 0",
    )


KernelName = Literal["se", "matern32", "matern52", "rq"]


def _enough_kernels(value: tuple[str, ...], info: ValidationInfo) -> tuple[str, ...]:
    if len(value) < (info.context or {}).get("d", 2):
        raise ValueError("fewer than d")
    return value


class PriorSection(Section):
    """What is known of the target's position before the first bearing."""

    position: PositionNumbers = key(..., "Expected position in m.")
    std: float | None = key(
        None, "Standard deviation on each axis in m.", "a number > 0, or null beside covariance", gt=0.0
    )
    covariance: Covariance | None = key(
        None,
        "Covariance in m^2, instead of std.",
        "a symmetric positive definite {d} x {d} matrix, or null beside std",
    )


class TrackerSection(Section):
    """What all estimators share."""

    kind: str = key(..., "Method.")
    window: int = key(
        20,
        "N_c, bearings kept by gp, lmc and pr (default 12 in space). Other kinds, and gp with noise, have windows of "
        "their own; for them it is the number of bearings that the recorded condition number counts.",
        ge=2,
    )
    forecast: int = key(11, "n, sampling periods (or forecast_period_s) predicted ahead.", ge=1)
    forecast_period_s: Positive | None = key(
        None, "Time between predicted positions in s; null is one sampling period."
    )
    prior: PriorSection | None = key(
        None, "Prior knowledge of the position.", "null, or a mapping with position and one of std, covariance"
    )


class ProcessSection(TrackerSection):
    """What the Gaussian-process trackers share."""

    centre: Literal["origin", "vehicle"] = key("vehicle", "Where the prior mean lies.")
    length_scale: Literal["tuned"] | Positive = key("tuned", "Length scale in s, tuned on the window or fixed.")
    nugget: Literal["tuned"] | Positive = key(
        "tuned", "Variance of a measurement relative to the amplitude squared, tuned on the window or fixed."
    )
    bound_delta: float = key(0.05, "δ, probability that the error bound fails.", gt=0.0, le=1.0)


def _own_or_named(value: Any) -> str:
    return "own" if isinstance(value, Mapping | NoisyBearingsSection) else "named"


class GaussianProcessSection(ProcessSection):
    """The Gaussian-process tracker."""

    kind: Literal["gp"] = key("gp", "Gaussian process.")
    kernel: KernelName = key("se", "Kernel of the process, for exact bearings.")
    amplitude: Literal["tuned"] | Positive = key(
        "tuned", "Prior standard deviation in m, tuned on the window or fixed."
    )
    noise: Annotated[
        Annotated[Literal["sensor"] | None, Tag("named")] | Annotated[NoisyBearingsSection, Tag("own")],
        Discriminator(_own_or_named),
    ] = key(
        "sensor",
        "Treatment of noisy bearings, in place of kernel, centre, amplitude, length_scale, nugget and bound_delta, "
        "which are refused beside it. sensor: the defaults of its keys if sensor.noise_deg > 0, else null. null: the "
        "paper's tracker, for exact bearings.",
        "sensor, null, or a mapping",
    )
    size: SizeNumbers | None = _size()
    engine: Literal["auto", "numpy", "compiled"] = engine_or_auto()


class CoregionalizedSection(ProcessSection):
    """The Gaussian-process tracker with a linear model of coregionalization."""

    kind: Literal["lmc"] = key(..., "Linear model of coregionalization.")
    kernels: Annotated[tuple[KernelName, ...], BeforeValidator(as_tuples), AfterValidator(_enough_kernels)] | None = (
        key(
            None,
            "Kernels of the latent functions, one each (default: d times se).",
            "null, or a list of at least {d} of se, matern32, matern52, rq",
        )
    )


class SpeedPriorSection(Section):
    """What is known of the target's speed."""

    median: float = key(1.0, "Median speed of the target in m/s.", gt=0.0)
    log_std: float = key(1.0, "Standard deviation of the logarithm of its speed.", gt=0.0)


class RangePriorSection(Section):
    """What is known of the target's range."""

    median_m: float = key(50.0, "Median range in m.", gt=0.0)
    log_std: float = key(1.0, "Standard deviation of the logarithm of the range.", gt=0.0)


class ShapeSection(TrackerSection):
    """What the trackers with a Gaussian process on the shape of the motion share."""

    noise: NoiseSection = Field(default_factory=NoiseSection, description="Noise of the bearings.")
    bin_s: float = key(1.5, "Width of the bins in s over which bearings are averaged.", gt=0.0)
    window_s: float = key(60.0, "Age of the oldest bin in s.", "a number of at least 4 bins", gt=0.0)
    update_s: float = key(1.0, "Least time between two estimates in s; in between, the last one is predicted.", ge=0.0)
    speed: SpeedPriorSection = Field(default_factory=SpeedPriorSection, description="Prior of the target's speed.")
    range: RangePriorSection = Field(default_factory=RangePriorSection, description="Prior of the target's range.")
    size: SizeNumbers | None = _size()
    starts_m: PositiveNumbers | None = key(
        None, "Ranges in m at which a track is begun; null is four about the prior's median."
    )
    hypotheses: int = key(3, "Largest number of distinct motions kept.", ge=1)
    memory: float | None = key(
        3.0,
        "Factor on the deviations of position and velocity remembered from before the window; null remembers nothing.",
        gt=0.0,
    )
    gate: float | None = key(4.0, "Standardised residual from which a bearing is suspected; null trusts all.", gt=0.0)
    turn_kernel: Literal["matern32", "ou"] = key("matern32", "Kernel of the turn rate.")
    turn_rate_std: PositiveNumbers = key(
        (0.01, 0.03, 0.09), "Standard deviations of the turn rate in rad/s, averaged over."
    )
    turn_time_s: PositiveNumbers = key((8.0, 25.0), "Time scales of the turn rate in s, averaged over.")
    speed_change_std: PositiveNumbers = key(
        (0.03, 0.1, 0.3), "Standard deviations of the change of log speed, averaged over."
    )
    speed_time_s: float = key(30.0, "Time scale of the change of log speed in s.", gt=0.0)


class MotionSection(ShapeSection):
    """Gaussian process on the shape of the motion."""

    kind: Literal["motion_gp"] = key(..., "Gaussian process on turn rate and log speed.")
    engine: Literal["numpy", "compiled"] = engine()


def _once_each(value: tuple[str, ...]) -> tuple[str, ...]:
    if len(set(value)) < len(value):
        raise ValueError("twice")
    return value


class MixtureSection(ShapeSection):
    """Trackers with different ideas of motion."""

    kind: Literal["mixture"] = key(..., "Trackers with different ideas of motion, weighed by evidence.")
    members: Annotated[
        tuple[Literal["held_turn", "imm_ekf", "ekf", "motion_gp"], ...],
        BeforeValidator(as_tuples),
        AfterValidator(_once_each),
        Field(min_length=1),
    ] = key(
        ("held_turn", "imm_ekf"),
        "The trackers, weighed by evidence.",
        "a list of held_turn, imm_ekf, ekf, motion_gp, each once at most, not empty",
    )
    evidence_s: Positive | None = key(30.0, "Time in s in which evidence fades; null is never.")
    member_bin_s: float = key(
        0.5,
        "Width in s of the bins of held_turn, imm_ekf and ekf; evidence counts twice that. motion_gp has bin_s.",
        gt=0.0,
    )
    hold_s: float = key(20.0, "Mean time in s for which a turn is held; the time scale of the members' motion.", gt=0.0)
    engine: Literal["auto", "numpy", "compiled"] = engine_or_auto()


class HeldTurnSection(TrackerSection):
    """A bank of filters over the time at which the turn rate was drawn last."""

    kind: Literal["held_turn"] = key(..., "Turn rates that are held and drawn again, in log-polar coordinates.")
    noise: NoiseSection = Field(default_factory=NoiseSection, description="Noise of the bearings.")
    bin_s: float = key(0.5, "Width of the bins in s over which bearings are averaged.", gt=0.0)
    speed: SpeedPriorSection = Field(default_factory=SpeedPriorSection, description="Prior of the target's speed.")
    range: RangePriorSection = Field(default_factory=RangePriorSection, description="Prior of the target's range.")
    size: SizeNumbers | None = _size()
    gate: float | None = key(4.0, "Standardised residual from which a bearing is suspected; null trusts all.", gt=0.0)
    turn_rate_std: PositiveNumbers = key(
        (0.03,), "Standard deviations of a turn rate when it is drawn, in rad/s, averaged over."
    )
    hold_s: float = key(20.0, "Mean time in s for which a turn rate is held.", gt=0.0)
    speed_change_std: PositiveNumbers = key(
        (0.007, 0.04, 0.2), "Standard deviations of the change of log speed, averaged over."
    )
    speed_time_s: float = key(30.0, "Time scale of the change of log speed in s.", gt=0.0)
    climb_std: float = key(0.1, "Standard deviation of a vertical speed when it is drawn, in m/s, in space.", gt=0.0)
    components: int = key(120, "Gaussians kept after the first 5 s of a track.", ge=1)
    engine: Literal["auto", "numpy", "compiled"] = engine_or_auto()


class BaselineSection(TrackerSection):
    """What the estimators share that the paper compares with."""

    initial_range_m: float = key(
        3.0, "Range in m at which the first bearing puts the target where there is no prior.", gt=0.0
    )


class OrthogonalityStaticSection(BaselineSection):
    """Orthogonality-based estimator of a static target."""

    kind: Literal["oe_s"] = key(..., "Orthogonality-based, static target.")
    position_gain: float = key(10.0, "Gain on the position in 1/s (k1, c1).", gt=0.0)


class OrthogonalityVelocitySection(BaselineSection):
    """Orthogonality-based estimator of a target with constant velocity."""

    kind: Literal["oe_cv"] = key(..., "Orthogonality-based, constant velocity.")
    position_gain: float = key(5.0, "Gain on the position in 1/s (k1, c1).", gt=0.0)
    velocity_gain: float = key(0.1, "Gain on the velocity in 1/s^2 (c2).", gt=0.0)


def _bearing_std() -> Any:
    return key(
        None,
        f"Assumed noise of a bearing in degrees; null is that of the sensor, and at least {LEAST_STD_DEG}.",
        "null, or a number > 0",
        gt=0.0,
    )


class FilterSection(BaselineSection):
    """What the Kalman filters share."""

    initial_variance: float = key(
        1.0, "P0, variance of the velocity (and acceleration) in SI units, and of the position without a prior.", gt=0.0
    )
    process_noise: float = key(
        0.1, "q, spectral density of the acceleration in m^2/s^3 under constant velocity.", gt=0.0
    )


class PseudoLinearSection(FilterSection):
    """Pseudo-linear Kalman filter."""

    kind: Literal["plkf"] = key(..., "Pseudo-linear Kalman filter.")
    bearing_std_deg: float | None = _bearing_std()
    bias_compensated: bool = key(False, "Whether the bias of the update is taken off.")


class InteractingModelsSection(FilterSection):
    """What both trackers with interacting multiple models share."""

    jerk_noise: float = key(0.1, "Spectral density of the jerk in m^2/s^5 where the acceleration varies.", gt=0.0)
    stay_probability: float = key(0.9, "Probability that a mode lasts for another measurement.", gt=0.0, lt=1.0)
    turn_rate_max: float = key(2.0, "Largest turn rate in rad/s.", gt=0.0)


class InteractingPseudoLinearSection(InteractingModelsSection):
    """Interacting multiple models with pseudo-linear updates."""

    kind: Literal["imm_plkf"] = key(..., "Interacting models, bearings.")
    bearing_std_deg: float | None = _bearing_std()


class InteractingPositionSection(InteractingModelsSection):
    """Interacting multiple models that see the target's position, missed where its bearing is."""

    kind: Literal["imm_kf_f"] = key(..., "Interacting models, full positions.")
    position_std_m: float = key(0.0001, "Noise of the measured position in m, given to the filter too.", gt=0.0)


class ExtendedSection(BaselineSection):
    """What the extended filters share."""

    initial_range_std_m: float = key(3.0, "Standard deviation in m of that range.", gt=0.0)
    initial_speed_std: float = key(
        1.0, "Standard deviation of each component of the velocity in m/s at the start.", gt=0.0
    )
    process_noise: float = key(
        0.1, "q, spectral density of the acceleration in m^2/s^3 under constant velocity.", gt=0.0
    )
    bearing_std_deg: float | None = _bearing_std()
    size: SizeNumbers | None = _size()


class ExtendedKalmanSection(ExtendedSection):
    """Extended Kalman filter."""

    kind: Literal["ekf"] = key(..., "Extended Kalman filter.")
    engine: Literal["numpy", "compiled"] = engine()


class InteractingExtendedSection(ExtendedSection):
    """Interacting multiple models with extended updates."""

    kind: Literal["imm_ekf"] = key(..., "Interacting models, extended updates.")
    initial_variance: float = key(
        1.0, "P0, variance of the velocity (and acceleration) in SI units, and of the position without a prior.", gt=0.0
    )
    jerk_noise: float = key(0.1, "Spectral density of the jerk in m^2/s^5 where the acceleration varies.", gt=0.0)
    stay_probability: float = key(0.9, "Probability that a mode lasts for another measurement.", gt=0.0, lt=1.0)
    turn_rate_max: float = key(2.0, "Largest turn rate in rad/s.", gt=0.0)


class PolynomialSection(BaselineSection):
    """Polynomial regression."""

    kind: Literal["pr"] = key(..., "Polynomial regression.")
    order: int = key(3, "Degree of the polynomial.", ge=0, le=20)
    ridge: float = key(1.0e-8, "Weight of the coefficients beside the squared residuals.", gt=0.0)
