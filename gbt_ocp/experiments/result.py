"""What a run leaves: its history step by step, its summary, and both together with the configuration as a result."""

from __future__ import annotations

import html
import importlib.metadata
import os
import platform
import zipfile
import zlib
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
import yaml
from numpy.typing import NDArray

from gbt_ocp.experiments import run_folder
from gbt_ocp.experiments.track_summary import track_numbers
from gbt_ocp.tracking.protocol import RANGE_OBSERVABLE, relative_range_std

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from pandas import DataFrame
    from xarray import Dataset

Array = NDArray[np.float64]

WALL_CLOCK = ("solver_time", "tracker_time")
"""The arrays of a history that are measured by a clock: all the others repeat bit by bit for the same seed."""

FALLBACKS = ("shifted", "cold", "relaxed", "braking")
"""The answers to a failed solve, in the order in which they are tried; a summary always counts all of them."""

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
_TEXT = {"solver_status", "fallback"}


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
        Answer to a failed solve: "" | "shifted" | "cold" | "relaxed" | "braking"; ``(K,)`` text.
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
        try:
            # Opened here: given a path, np.load leaves a damaged file open.
            with open(path, "rb") as stream, np.load(stream, allow_pickle=False) as archive:
                missing = [field.name for field in fields(cls) if field.name not in archive.files]
                if missing:
                    raise ValueError(f"missing arrays: {', '.join(missing)}")
                return cls(**{field.name: archive[field.name] for field in fields(cls)})
        except (ValueError, TypeError, EOFError, zipfile.BadZipFile, zlib.error) as error:
            raise ValueError(f"{os.fspath(path)}: not a history: {error}") from None


def summarise(
    history: History,
    *,
    period: float,
    seed: int,
    settling: float = 2.0,
    wall_s: float,
    solver_first_try: NDArray[np.bool_],
    retries: Mapping[str, int],
    versions: Mapping[str, str],
    forecast_period: float | None = None,
    standoff: float | None = None,
) -> dict[str, Any]:
    """Numbers of a run, as they stand in ``summary.json`` (the paper's tables 2 and 3, and what explains them).

    Parameters
    ----------
    history
        The run.
    period
        Sampling period T, s.
    seed
        Of the run.
    settling
        Time from which errors count as settled, s.
    wall_s
        Time the run took, s.
    solver_first_try
        Whether the first solve of each step succeeded, ``(K,)``; read only where a solver was asked.
    retries
        Counts of what happened short of a fallback, for example nugget retries of the tracker.
    versions
        See `installed_versions`.
    forecast_period
        Time between two predicted positions, s; by default T.
    standoff
        Least range to the target, m, if there is one.

    Returns
    -------
    A mapping of strict JSON values. ``None`` stands for what does not exist (no solver, a run that ends before the
    settling time) and for what is not finite. Errors are the mean over T_k per step: ``error_mean``, ``error_median``,
    ``error_rms`` are over all steps, ``error_settled`` and ``error_settled_max`` over t_k >= settling, ``error_final``
    is the last step's. Distances are ‖P_A - P_T‖ at t_k. ``steps`` counts the sampling periods, K - 1. Similarities are
    of desired and true bearing, over the second half of the run. ``range_observable_from_s`` is the time from which on
    the range is known to a quarter until the end. ``steps_over_period`` counts the steps in which tracker and solver
    together took longer than T. To these come the numbers of
    :func:`gbt_ocp.experiments.track_summary.track_numbers`, as far as they are defined.

    Raises
    ------
    ValueError
        If ``solver_first_try`` is not of shape (K,).
    """
    first_try = np.asarray(solver_first_try, dtype=bool)
    if first_try.shape != history.t.shape:
        raise ValueError(f"solver_first_try has shape {first_try.shape}; allowed: {history.t.shape}")
    t, error, planned = history.t, history.mean_error, history.planned
    slack = 1e-6 * period  # t_k = k T is rounded
    settled = t >= settling - slack
    second_half = t >= 0.5 * (t[0] + t[-1]) - slack

    line = history.target - history.vehicle_pose[:, : history.dimension]
    distance = np.linalg.norm(line, axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):  # NaN where the vehicle sits on the target
        similarity = np.sum(history.desired_bearing * line, axis=1) / distance

    executed = history.piece_thrust_peak
    if len(executed) > 1 and np.isnan(executed[-1]).all():  # no piece is executed from the last sample
        executed = executed[:-1]
    step_time = history.tracker_time + np.where(planned, history.solver_time, 0.0)
    answers = Counter(str(word) for word in history.fallback if word)

    summary = {
        "error_mean": error.mean(),
        "error_settled": _of(np.mean, error[settled]),
        "error_final": error[-1],
        "error_rms": np.sqrt(np.mean(error**2)),
        "error_median": np.median(error),
        "error_settled_max": _of(np.max, error[settled]),
        "settling_s": settling,
        "distance_min": distance.min(),
        "distance_median": np.median(distance),
        "distance_max_after_10s": _of(np.max, distance[t >= 10.0 - slack]),
        "similarity_second_half": _of(np.min, similarity[second_half]),
        "similarity_mean_second_half": _of(np.mean, similarity[second_half]),
        "range_std_over_range_final": history.range_std_over_range[-1],
        "range_observable_from_s": _of(np.min, t[_for_good(history.range_observable)]),
        "violation_max": np.maximum(0.0, executed.max() - 1.0) if executed.size else None,
        "objective_mean": _of(np.mean, history.objective[planned]),
        "solver_success_rate": _of(np.mean, first_try[planned]),
        "solver_iterations_mean": _of(np.mean, history.solver_iterations[planned]),
        "solver_time_median_ms": _of(np.median, 1e3 * history.solver_time[planned]),
        "solver_time_max_ms": _of(np.max, 1e3 * history.solver_time[planned]),
        "fallbacks": {word: answers[word] for word in dict.fromkeys([*FALLBACKS, *sorted(answers)])},
        "retries": dict(retries),
        "tracker_time_median_ms": np.median(1e3 * history.tracker_time),
        "step_time_median_ms": np.median(1e3 * step_time),
        "steps_over_period": np.count_nonzero(step_time > period),
        "steps": t.size - 1,
        "wall_s": wall_s,
        "seed": seed,
        "versions": dict(versions),
    }
    summary |= track_numbers(history, forecast_period or period, standoff)
    strict: dict[str, Any] = run_folder.strict(summary)
    return strict


def installed_versions() -> dict[str, str]:
    """Versions that decide whether a run repeats bit by bit: Python, this package, its numerics, the platform."""
    versions = {"python": platform.python_version()}
    for package in ("gbt_ocp", "casadi", "numpy", "scipy"):
        try:
            versions[package] = importlib.metadata.version(package)
        except importlib.metadata.PackageNotFoundError:  # run from a checkout that was never installed
            versions[package] = "not installed"
    versions["platform"] = platform.platform()
    return versions


class WritesYaml(Protocol):
    """What a result asks of a configuration: its resolved YAML, with `vehicle.thrust_max` and `sensor.period_s`."""

    def to_yaml(self) -> str:
        """Return the text of ``config.yaml``, every default written out."""
        ...


class RecordedConfiguration(SimpleNamespace):
    """The configuration a run folder holds, as it was written: ``configuration.sensor.period_s``, ``.to_yaml()``.

    It is not checked again: a folder from an older version stays readable. To run it again, give its ``config.yaml``
    to ``gbt-ocp run``.
    """

    def __init__(self, text: str) -> None:
        mapping = yaml.safe_load(text)
        super().__init__(**_attributes(mapping) if isinstance(mapping, dict) else {})
        self._text = text

    def to_yaml(self) -> str:
        """Return the text that was read, byte for byte."""
        return self._text


@dataclass(frozen=True, eq=False, repr=False)
class Result:
    """A finished run: its configuration, history and summary.

    Attributes
    ----------
    configuration
        The resolved configuration; after `load`, a `RecordedConfiguration`.
    history
        All steps.
    summary
        What `summarise` returned.
    """

    configuration: WritesYaml
    history: History
    summary: dict[str, Any]

    def plot(self) -> dict[str, Figure]:
        """Draw the run: figures by name (see `gbt_ocp.reporting.figures.draw_figures`); pyplot is not touched."""
        from gbt_ocp.reporting.figures import draw_figures  # matplotlib only when something is drawn

        return draw_figures(self.history, yaml.safe_load(self.configuration.to_yaml()), self.summary)

    def save(self, folder: str | os.PathLike[str], figures: bool = True) -> Path:
        """Write the run folder, whole or not at all, and return its path.

        Raises
        ------
        FileExistsError
            If ``folder`` is a file, or a folder that is not empty.
        """
        with run_folder.whole_folder(folder) as temporary:
            self.write(temporary, figures=figures)
        return Path(folder)

    def write(self, folder: Path, *, history: bool = True, figures: bool = True) -> None:
        """Write the files of a run folder into a folder that is there, with or without its arrays and figures."""
        (folder / run_folder.CONFIGURATION).write_text(self.configuration.to_yaml(), encoding="utf-8")
        if history:
            self.history.save_npz(folder / run_folder.HISTORY)
        run_folder.write_summary(folder, self.summary)
        if figures:
            from gbt_ocp.reporting.figures import write_figures

            write_figures(folder)

    @classmethod
    def load(cls, folder: str | os.PathLike[str]) -> Result:
        """Read a run folder back.

        Raises
        ------
        FileNotFoundError
            If one of its three files is missing.
        ValueError
            If one of them is damaged.
        """
        path = Path(folder)
        text = (path / run_folder.CONFIGURATION).read_text(encoding="utf-8")
        history = History.load_npz(path / run_folder.HISTORY)
        return cls(RecordedConfiguration(text), history, run_folder.read_summary(path))

    def to_dataframe(self) -> DataFrame:
        """The history as a ``pandas.DataFrame``, one row a step (see `gbt_ocp.experiments.tabular.dataframe`).

        Raises
        ------
        ImportError
            If pandas is not installed.
        """
        from gbt_ocp.experiments.tabular import dataframe

        return dataframe(self.history)

    def to_xarray(self) -> Dataset:
        """The history as an ``xarray.Dataset`` (see `gbt_ocp.experiments.tabular.dataset`); the numbers of the summary
        and the configuration are its attributes.

        Raises
        ------
        ImportError
            If xarray is not installed.
        """
        from gbt_ocp.experiments.tabular import dataset

        numbers = {key: value for key, value in self.summary.items() if isinstance(value, int | float | str)}
        return dataset(self.history, {**numbers, "configuration": self.configuration.to_yaml()})

    def _repr_html_(self) -> str:
        """What a notebook shows: the numbers of `repr`, as a table."""
        title, *lines = repr(self).splitlines()
        rows = "".join(
            f"<tr><th style='text-align:left'>{html.escape(head)}</th>"
            f"<td style='text-align:left'>{html.escape(rest)}</td></tr>"
            for head, rest in (line.split(maxsplit=1) for line in lines)
        )
        return f"<table><caption style='text-align:left'>{html.escape(title)}</caption>{rows}</table>"

    def __repr__(self) -> str:
        number = self.summary.get
        fallbacks = sum((number("fallbacks") or {}).values())
        problem = getattr(self.configuration, "problem", "run")
        return (
            f"Result({problem}, {self.history.dimension}D, seed {number('seed')}, {number('steps')} steps, "
            f"{_text(number('wall_s'), 's')} wall)\n"
            f"  error    mean {_text(number('error_mean'), 'm')}, settled {_text(number('error_settled'), 'm')}, "
            f"final {_text(number('error_final'), 'm')}\n"
            f"  distance min {_text(number('distance_min'), 'm')}, median {_text(number('distance_median'), 'm')}; "
            f"thrust above its limit by {_text(number('violation_max'))}\n"
            f"  solver   first try {_text(number('solver_success_rate'))}, "
            f"median {_text(number('solver_time_median_ms'), 'ms')}, {fallbacks} fallbacks"
        )


def _canonical(name: str, array: Any) -> NDArray[Any]:
    if name in _TEXT:
        return np.array(np.asarray(array).tolist(), dtype=np.str_)  # the narrowest width, whatever it was made with
    kind = {"detected": np.bool_, "solver_iterations": np.int64}.get(name, np.float64)
    return np.ascontiguousarray(array, dtype=kind)


def _for_good(holds: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Where something holds from there on to the end, ``(K,)``."""
    return np.asarray(np.logical_and.accumulate(holds[::-1])[::-1])


def _of(statistic: Any, values: NDArray[Any]) -> Any:
    """Statistic of the values, None when there are none."""
    return statistic(values) if values.size else None


def _attributes(value: Any) -> Any:
    if isinstance(value, dict):
        return {str(key): SimpleNamespace(**_attributes(v)) if isinstance(v, dict) else v for key, v in value.items()}
    return value


def _text(value: float | None, unit: str = "") -> str:
    return "none" if value is None else f"{value:.3g} {unit}".rstrip()
