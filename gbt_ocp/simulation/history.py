"""What is recorded of a run, step by step."""

from __future__ import annotations

import os
import zipfile
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from gbt_ocp.files import read_arrays
from gbt_ocp.tracking.protocol import RANGE_OBSERVABLE, relative_range_std
from gbt_ocp.typing import Array

if TYPE_CHECKING:
    pass

WALL_CLOCK = ("solver_time", "tracker_time")
"""The arrays of a history that are measured by a clock: all the others repeat bit by bit for the same seed."""

# Shape of each array: K steps, d space dimensions, z flat outputs, a thrust axes, n forecast times, p pieces.
_LAYOUT = {
    "t": "K",
    "vehicle_pose": "Kz",
    "vehicle_velocity": "Kz",
    "thrust": "Ka",
    "piece_thrust_peak": "Ka",
    "target": "Kd",
    "bearing": "Kd",
    "desired_bearing": "Kd",
    "detected": "K",
    "forecast_mean": "Knd",
    "forecast_cov": "Kndd",
    "error": "Kn",
    "bound": "Kn",
    "length_scale": "K",
    "amplitude": "K",
    "nugget": "K",
    "prior_cov": "Kdd",
    "condition_number": "K",
    "objective": "K",
    "violation": "K",
    "solver_status": "K",
    "solver_iterations": "K",
    "solver_time": "K",
    "tracker_time": "K",
    "fallback": "K",
    "plan": "Kpz",
}
TEXT = {"solver_status", "fallback"}


@dataclass(frozen=True, eq=False)
class History:
    """Everything recorded at t_k = 0, T, … up to the duration: K samples, arrays time first, SI units, radians.

    Attributes
    ----------
    t
        Times t_k, ``(K,)``, s.
    vehicle_pose
        Position P_A and yaw ψ, earth frame, ``(K, d+1)``; m and rad.
    vehicle_velocity
        Body-frame ν: surge, sway, (heave,) yaw rate, ``(K, d+1)``; m/s and rad/s.
    thrust
        Body-frame τ at t_k, the start of the executed piece, ``(K, d+1)``; N, and N m for yaw.
    piece_thrust_peak
        Largest |τ|/τ_max of each axis on the fine grid of the piece executed from step k, ``(K, d+1)``. NaN in the
        last row when no piece is executed from there.
    target
        True position P_T, ``(K, d)``, m.
    bearing, detected
        Measured bearing λ ``(K, d)`` (NaN when missed) and whether there was one, ``(K,)`` bool.
    desired_bearing
        Desired bearing at t_k, ``(K, d)``.
    forecast_mean, forecast_cov
        Posterior mean μ_k and covariance Σ_k at T_k = {t_k, …, t_{k+n}}, ``(K, n+1, d)`` m, ``(K, n+1, d, d)`` m².
    error, bound
        ‖μ_k(t) - P_T(t)‖ at T_k and the theorem's bound on it, ``(K, n+1)``, m.
    length_scale, amplitude, nugget
        Hyperparameters of the tracker, ``(K,)``; s, m, and a variance relative to the kernel's. NaN if it has none.
    prior_cov
        Prior covariance of the target's coordinates under the hyperparameters, ``(K, d, d)``, m²; off the diagonal
        the R_xy, R_xz, R_yz of the linear model of coregionalization. NaN likewise.
    condition_number
        Of the cumulative bearing matrix of the window, ``(K,)``; infinite while it is singular.
    objective, violation
        Of the plan: value of the objective, and largest |τ|/τ_max - 1 (at least 0) on its fine grid, ``(K,)``.
    solver_status
        "solved", the solver's own word otherwise, "" where nothing was solved; ``(K,)`` text.
    solver_iterations, solver_time, tracker_time
        ``(K,)``; count, s, s. Without a solver 0 iterations and NaN time.
    fallback
        Answer to a failed solve: "" | "shifted" | "cold" | "unfinished" | "braking"; ``(K,)`` text.
    plan
        Endpoints of the planned pieces, ``(K, p, d+1)``; p may be 0.

    Raises
    ------
    ValueError
        If arrays disagree about K, d, n, the number of axes or of outputs.

    Notes
    -----
    Arrays are converted to contiguous float64, int64, bool or unicode, so equal histories are saved as equal bytes.
    """

    t: Array
    vehicle_pose: Array
    vehicle_velocity: Array
    thrust: Array
    target: Array
    bearing: Array
    detected: NDArray[np.bool_]
    forecast_mean: Array
    forecast_cov: Array
    error: Array
    length_scale: Array
    amplitude: Array
    condition_number: Array
    bound: Array
    objective: Array
    violation: Array
    solver_status: NDArray[np.str_]
    solver_iterations: NDArray[np.int64]
    solver_time: Array
    plan: Array
    tracker_time: Array
    nugget: Array
    fallback: NDArray[np.str_]
    desired_bearing: Array
    piece_thrust_peak: Array
    prior_cov: Array

    def __post_init__(self) -> None:
        sizes: dict[str, tuple[int, str]] = {}
        for name, layout in _LAYOUT.items():
            array = _canonical(name, getattr(self, name))
            object.__setattr__(self, name, array)
            if array.ndim != len(layout):
                raise ValueError(f"history: {name} has shape {array.shape}; allowed: {len(layout)} axes")
            for letter, size in zip(layout, array.shape, strict=True):
                known, source = sizes.setdefault(letter, (size, name))
                if size != known:
                    raise ValueError(
                        f"history: {name} has shape {array.shape}, but {source} has shape {getattr(self, source).shape}"
                    )
        if not self.t.size:
            raise ValueError("history: found no steps; allowed: at least one")
        if self.dimension not in (2, 3):
            raise ValueError(f"history: found positions with {self.dimension} coordinates; allowed: 2 or 3")

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
            for field in fields(self):
                entry = zipfile.ZipInfo(f"{field.name}.npy", date_time=(1980, 1, 1, 0, 0, 0))
                entry.compress_type = zipfile.ZIP_DEFLATED
                entry.create_system = 3  # otherwise the operating system's number
                entry.external_attr = 0o644 << 16
                with archive.open(entry, "w", force_zip64=True) as stream:
                    np.lib.format.write_array(stream, getattr(self, field.name), version=(1, 0), allow_pickle=False)

    @classmethod
    def load_npz(cls, path: str | os.PathLike[str]) -> History:
        """Read a history; arrays that stand beside the known ones are passed over.

        Raises
        ------
        ValueError
            If the file is no ``.npz``, an array is missing, or shapes disagree.
        """
        arrays = read_arrays(path, (field.name for field in fields(cls)), "a history")
        try:
            return cls(**arrays)
        except (ValueError, TypeError, OverflowError) as fault:
            raise ValueError(f"{os.fspath(path)}: not a history: {fault}") from None


def _canonical(name: str, array: Any) -> NDArray[Any]:
    if name in TEXT:
        return np.array(np.asarray(array).tolist(), dtype=np.str_)  # the narrowest width, whatever it was made with
    kind = {"detected": np.bool_, "solver_iterations": np.int64}.get(name, np.float64)
    return np.ascontiguousarray(array, dtype=kind)
