"""One tracker over one recording: what it said at the scored times, in numbers."""

from __future__ import annotations

import warnings
from time import process_time
from typing import Any

import numpy as np

from gbt_ocp.simulation.calibration import squared_errors, within
from gbt_ocp.simulation.track_summary import LOST_SHARE
from gbt_ocp.studies.scenarios.contestants import Contestant
from gbt_ocp.studies.scenarios.scenario import PublicScenario, RecordedRun
from gbt_ocp.tracking.intake import take_in, taken_kinds

END_SHARE = 0.2
"""Share of the scored times, at the end, whose median decides whether the target is lost."""

EPSILON = 1e-9


def trial(scenario: PublicScenario, contestant: Contestant, run: int) -> dict[str, Any] | None:
    """One run.

    Returns
    -------
    ``error`` and ``error_ahead`` (medians of the distance from the truth over the true range, in per cent), ``rms_m``
    (root mean square of the distance in m), ``nees`` and ``nees_ahead`` (means of ``eᵀΣ⁻¹e / d``, ideally 1),
    ``inside`` and ``inside_ahead`` (shares of the truth inside the 95 % region), ``final_error``, ``lost``,
    ``seconds`` (processor time), ``measurements`` taken, and ``fault`` with what the tracker raised, if anything.
    ``None`` where the contestant does not take part.
    """
    recording = scenario.record(run)
    tracker = contestant.make(scenario, recording, run)
    if tracker is None:
        return None
    kinds = taken_kinds(tracker)
    if recording.knowledge.size is None:
        kinds = tuple(kind for kind in kinds if kind != "size")
    rows: list[list[float]] = []
    spent, taken, fault = 0.0, 0, ""
    due = recording.times[0] + scenario.scored_from
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")
        try:
            for k, time in enumerate(recording.times):
                began = process_time()
                for sighting in recording.sightings[k]:
                    if sighting.kind in kinds:
                        take_in(tracker, sighting)
                        taken += 1
                if time < due - EPSILON or not taken:
                    spent += process_time() - began
                    continue
                said = tracker.predict([time, time + scenario.ahead])
                spent += process_time() - began
                due = max(due + scenario.scored_every, float(time))
                rows.append(_row(recording, k, said))
        except (ValueError, ArithmeticError, np.linalg.LinAlgError) as raised:
            fault = f"{type(raised).__name__}: {str(raised).splitlines()[0] if str(raised) else ''}"
    return {**_numbers(np.array(rows).reshape(-1, 7), fault), "seconds": spent, "measurements": taken, "fault": fault}


def _row(recording: RecordedRun, k: int, said: Any) -> list[float]:
    """Error in m, range, NEES and whether inside, error ahead, NEES ahead and whether inside."""
    d = recording.own.shape[1]
    truth = np.stack([recording.target[k], recording.ahead[k]])
    off = said.mean - truth
    errors, squares = np.linalg.norm(off, axis=1), squared_errors(off, said.covariance)
    inside = within(squares, d).astype(float)
    inside[~np.isfinite(truth).all(axis=1)] = np.nan
    far = float(np.linalg.norm(recording.target[k] - recording.own[k]))
    return [errors[0], far, squares[0] / d, inside[0], errors[1], squares[1] / d, inside[1]]


def _numbers(rows: Any, fault: str) -> dict[str, Any]:
    if not len(rows):
        return {"lost": True}
    shares = 100.0 * rows[:, [0, 4]] / rows[:, 1:2]
    end = shares[-max(1, round(END_SHARE * len(rows))) :, 0]
    final = float(np.median(end))
    lost = bool(fault) or not np.isfinite(rows[:, 0]).all() or final > 100.0 * LOST_SHARE

    def number(statistic: Any, values: Any) -> float | None:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            found = float(statistic(values))
        return found if np.isfinite(found) else None

    return {
        "error": number(np.median, shares[:, 0]),
        "error_ahead": number(np.nanmedian, shares[:, 1]),
        "rms_m": number(lambda values: np.sqrt(np.mean(values**2)), rows[:, 0]),
        "nees": number(np.mean, rows[:, 2]),
        "nees_ahead": number(np.nanmean, rows[:, 5]),
        "inside": number(np.mean, rows[:, 3]),
        "inside_ahead": number(np.nanmean, rows[:, 6]),
        "final_error": final if np.isfinite(final) else None,
        "lost": lost,
    }
