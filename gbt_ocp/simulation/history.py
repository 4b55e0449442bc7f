"""What is recorded of a run, step by step."""

from __future__ import annotations

import os
import zipfile
from collections.abc import Mapping
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from gbt_ocp.files import read_arrays
from gbt_ocp.models.bearings import condition_numbers
from gbt_ocp.ocp.plan import ANSWERED
from gbt_ocp.ocp.solvers.base import GIVEN_UP
from gbt_ocp.simulation import readings
from gbt_ocp.simulation.columns import SAME_LENGTH, UNKNOWN, column, columns, recorded
from gbt_ocp.tracking.protocol import RANGE_OBSERVABLE, relative_range_std
from gbt_ocp.typing import Array


@recorded
class History:
    """Everything recorded at t_k = 0, T, … up to the duration: K samples, arrays time first, SI units, radians.

    Arrays are converted to contiguous float64, int64, bool or unicode, so equal histories are saved as equal bytes.
    Each is declared once, in the order of the file. One more declaration, here or in a subclass that
    :func:`~gbt_ocp.simulation.loop.simulate` is given, records one more array.

    Raises
    ------
    ValueError
        If arrays disagree about K, d, n, the number of inputs or of outputs, or times do not increase.
    """

    t: Array = column("t", lambda step: step.time, "s", meaning="Times t_k")
    vehicle_pose: Array = column(
        "t pose",
        lambda step: step.vehicle.pose(step.state),
        "m; yaw rad",
        table={"vehicle": readings.same},
        meaning="Position P_A and yaw ψ, earth frame",
    )
    vehicle_velocity: Array = column(
        "t body",
        lambda step: step.vehicle.velocity(step.state),
        "m/s; yaw rate rad/s",
        table={"velocity": readings.same},
        meaning="Body-frame ν: surge, sway, (heave,) yaw rate",
    )
    thrust: Array = column(
        "t input",
        lambda step: step.move.thrust,
        "N; yaw moment N m",
        meaning="Body-frame τ at t_k, the start of the executed piece",
    )
    target: Array = column("t axis", lambda step: step.target[0], "m", meaning="True position P_T")
    bearing: Array = column("t axis", readings.bearing, meaning="Measured bearing λ, NaN where it was missed")
    detected: NDArray[np.bool_] = column(
        "t",
        lambda step: step.bearing is not None,
        kind=bool,
        meaning="Whether a bearing was measured",
    )
    forecast_mean: Array = column(
        "t ahead axis",
        lambda step: step.forecast.mean,
        "m",
        table={"estimate": readings.now},
        meaning="Posterior mean μ_k at T_k = {t_k, …, t_{k+n}}",
    )
    forecast_cov: Array = column(
        "t ahead axis axis_",
        lambda step: step.forecast.covariance,
        "m2",
        table={"estimate_std": readings.std_now},
        meaning="Posterior covariance Σ_k at T_k",
    )
    error: Array = column(
        "t ahead",
        lambda step: step.error,
        "m",
        table={"error": readings.now, "error_mean": readings.mean_ahead},
        meaning="Tracking error ‖μ_k(t) - P_T(t)‖ at T_k",
    )
    length_scale: Array = column(
        "t",
        readings.tuned(lambda process: process.hyperparameters.length_scale),
        "s",
        meaning="Length scale of the tracker, NaN if it has none",
    )
    amplitude: Array = column(
        "t",
        readings.tuned(lambda process: process.hyperparameters.amplitude),
        "m",
        meaning="Amplitude of the tracker, NaN if it has none",
    )
    condition_number: Array = column(
        "t",
        readings.bearing_matrix,
        finished=("axis axis_", condition_numbers),
        meaning="Condition number of the cumulative bearing matrix of the window, infinite while it is singular",
    )
    bound: Array = column(
        "t ahead",
        readings.bound,
        "m",
        table={"bound_mean": readings.mean_ahead},
        meaning="The theorem's bound on the error at T_k, NaN if the tracker has none",
    )
    objective: Array = column("t", readings.planned(lambda plan: plan.objective), meaning="Objective of the plan")
    violation: Array = column(
        "t",
        readings.planned(lambda plan: plan.violation),
        "of the limit",
        meaning="Largest |τ|/τ_max - 1 of the plan, at least 0, on its fine grid",
    )
    solver_status: NDArray[np.str_] = column(
        "t",
        readings.planned(lambda plan: plan.status, ""),
        kind=str,
        meaning="``solved``, another word of the solver, or nothing where nothing was solved",
    )
    solver_iterations: NDArray[np.int64] = column(
        "t",
        readings.planned(lambda plan: plan.iterations, 0),
        kind=int,
        meaning="Iterations of the solver",
    )
    solver_time: Array = column(
        "t",
        readings.planned(lambda plan: plan.solve_time),
        "s",
        clock=True,
        meaning="Time of the solver, NaN without one",
    )
    plan: Array = column(
        "t piece pose", readings.planned_poses, "m; yaw rad", meaning="Ends of the planned pieces; p may be 0"
    )
    tracker_time: Array = column("t", lambda step: step.tracker_time, "s", clock=True, meaning="Time of the tracker")
    nugget: Array = column(
        "t",
        readings.tuned(lambda process: process.hyperparameters.nugget),
        "of the amplitude squared",
        meaning="Nugget of the tracker, NaN if it has none",
    )
    fallback: NDArray[np.str_] = column(
        "t",
        readings.planned(lambda plan: plan.fallback, ""),
        kind=str,
        meaning="Answer to a failed solve: ``shifted``, ``cold``, ``unfinished``, ``braking``, or nothing",
    )
    desired_bearing: Array = column("t axis", lambda step: step.desired_bearing, meaning="Desired bearing λ* at t_k")
    piece_thrust_peak: Array = column(
        "t input",
        lambda step: step.move.thrust_peak,
        "of the limit",
        table={"thrust_peak": readings.same},
        meaning="Largest |τ|/τ_max on the fine grid of the piece executed from t_k, NaN where none is",
    )
    prior_cov: Array = column(
        "t axis axis_",
        readings.prior_covariance,
        "m2",
        meaning="Prior covariance of the target's coordinates under the hyperparameters, NaN if the tracker has "
        "none; off the diagonal R_xy, R_xz, R_yz of the linear model of coregionalization",
    )
    off_plan: Array = column(
        "t",
        lambda step: step.move.off_plan,
        "m",
        optional=True,
        meaning="Distance from the planned position at the end of the period that begins at t_k, NaN without a plan",
    )

    power: Array = column(
        "t",
        lambda step: step.move.power,
        "W",
        optional=True,
        meaning="Mean of Σ|τ_i ν_i| over the period that begins at t_k, ν through the water; NaN where τ is no force",
    )

    current: Array = column(
        "t axis",
        lambda step: readings.unknown_axes(step) if step.water is None else step.water,
        "m/s",
        optional=True,
        meaning="True velocity of the water over ground at the vehicle, NaN where it stands still",
    )
    current_estimate: Array = column(
        "t axis",
        lambda step: readings.unknown_axes(step) if step.current is None else step.current.velocity,
        "m/s",
        optional=True,
        meaning="Velocity of the water for which is planned, NaN where none is",
    )
    current_cov: Array = column(
        "t axis axis_",
        lambda step: np.diag(readings.unknown_axes(step)) * np.nan if step.current is None else step.current.covariance,
        "m2/s2",
        optional=True,
        meaning="Covariance of the estimated velocity of the water, zero where it is given",
    )

    def __post_init__(self) -> None:
        lengths: dict[str, tuple[int, str]] = {}
        for one in columns(self):
            array = one.canonical(getattr(self, one.name))
            object.__setattr__(self, one.name, array)
            if array.ndim != len(one.axes):
                raise ValueError(f"history: {one.name} has shape {array.shape}; allowed: {len(one.axes)} axes")
            for axis, length in zip(one.axes, array.shape, strict=True):
                known, source = lengths.setdefault(SAME_LENGTH.get(axis, axis), (length, one.name))
                if length != known:
                    raise ValueError(
                        f"history: {one.name} has shape {array.shape}, "
                        f"but {source} has shape {getattr(self, source).shape}"
                    )
        if not self.t.size:
            raise ValueError("history: found no steps; allowed: at least one")
        before = np.concatenate([[-np.inf], self.t[:-1]])
        wrong = np.flatnonzero(~(np.isfinite(self.t) & (self.t > before)))
        if wrong.size:
            raise ValueError(f"history: t: found {self.t[wrong[0]]} at step {wrong[0]}; allowed: times that increase")
        if self.dimension not in (2, 3):
            raise ValueError(f"history: found positions with {self.dimension} coordinates; allowed: 2 or 3")

    @property
    def answered(self) -> NDArray[np.bool_]:
        """Whether the first attempt of a step succeeded, be it that limits had to give ``(K,)``."""
        return np.isin(self.solver_status, ANSWERED)

    @property
    def answered_first(self) -> NDArray[np.bool_]:
        """Whether the first attempt's plan is the one of the step ``(K,)``."""
        return np.asarray(self.answered & (self.fallback == ""))

    @property
    def gave_way(self) -> NDArray[np.bool_]:
        """Whether a limit that may give had to, so that the step could be planned ``(K,)``."""
        return np.asarray(self.planned & (self.solver_status == GIVEN_UP))

    @property
    def dimension(self) -> int:
        """Space dimension d."""
        return int(self.target.shape[1])

    @property
    def mean_error(self) -> Array:
        """Mean over T_k of the tracking error at each step, ``(K,)``, m: what the summary and the figures are about."""
        return np.asarray(self.error.mean(axis=1))

    @property
    def covariance_norm(self) -> Array:
        """Mean over T_k of the spectral norm ‖Σ_k(t)‖ at each step, ``(K,)``, m²; NaN where Σ is unknown."""
        known = np.asarray(np.isfinite(self.forecast_cov).all(axis=(2, 3)))
        norms = np.linalg.norm(np.where(known[..., None, None], self.forecast_cov, 0.0), 2, axis=(2, 3))
        return np.asarray(np.where(known, norms, np.nan).mean(axis=1))

    @property
    def range_std_over_range(self) -> Array:
        """Posterior deviation of the range at t_k over the range to the estimate, ``(K,)``; NaN where Σ is unknown."""
        return relative_range_std(
            self.forecast_mean[:, 0], self.forecast_cov[:, 0], self.vehicle_pose[:, : self.dimension]
        )

    @property
    def range_observable(self) -> NDArray[np.bool_]:
        """Steps at which the range is known to a quarter, ``(K,)``: before, an estimate repeats its prior."""
        return np.asarray(self.range_std_over_range < RANGE_OBSERVABLE)

    @property
    def planned(self) -> NDArray[np.bool_]:
        """Steps at which a solver was asked, ``(K,)``."""
        return np.asarray(self.solver_status != "")

    def save_npz(self, path: str | os.PathLike[str]) -> None:
        """Write all arrays to one ``.npz``; equal histories give equal bytes (fixed order, dates and attributes)."""
        with zipfile.ZipFile(path, "w") as archive:
            for one in columns(self):
                entry = zipfile.ZipInfo(f"{one.name}.npy", date_time=(1980, 1, 1, 0, 0, 0))
                entry.compress_type = zipfile.ZIP_DEFLATED
                entry.create_system = 3  # otherwise the operating system's number
                entry.external_attr = 0o644 << 16
                with archive.open(entry, "w", force_zip64=True) as stream:
                    np.lib.format.write_array(stream, getattr(self, one.name), version=(1, 0), allow_pickle=False)

    @classmethod
    def load_npz(cls, path: str | os.PathLike[str]) -> Self:
        """Read a history; arrays beside the known ones are passed over.

        Raises
        ------
        ValueError
            If the file is no ``.npz``, an array is missing, shapes disagree, or times do not increase.
        """
        declared = columns(cls)
        needed = [one.name for one in declared if not one.optional]
        arrays = read_arrays(path, needed, "a history", optional=[one.name for one in declared if one.optional])
        try:
            return cls.of(arrays)
        except (ValueError, TypeError, OverflowError) as fault:
            raise ValueError(f"{os.fspath(path)}: not a history: {fault}") from None

    @classmethod
    def of(cls, arrays: Mapping[str, Any]) -> Self:
        """A history of arrays by name; optional arrays that are not among them are unknown.

        Raises
        ------
        ValueError
            If shapes disagree, or times do not increase.
        TypeError
            If an array that is not optional is missing.
        """
        declared = columns(cls)
        given = {name: np.asarray(array) for name, array in arrays.items()}
        lengths = {
            SAME_LENGTH.get(axis, axis): length
            for one in declared
            if one.name in given and given[one.name].ndim == len(one.axes)
            for axis, length in zip(one.axes, given[one.name].shape, strict=True)
        }
        for one in declared:
            if one.optional and one.name not in given:
                shape = [lengths.get(SAME_LENGTH.get(axis, axis), 0) for axis in one.axes]
                given[one.name] = np.full(shape, UNKNOWN[one.kind])
        return cls(**given)


WALL_CLOCK = tuple(one.name for one in columns(History) if one.clock)
"""The arrays of a history that are measured by a clock: all the others repeat bit by bit for the same seed."""

TEXT = frozenset(one.name for one in columns(History) if one.kind is str)
"""The arrays of a history that hold text."""
