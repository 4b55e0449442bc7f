"""Studies of figures 4, 7, 8 and 9 on made-up runs, where every number is known, and on a short real sweep."""

from types import SimpleNamespace

import numpy as np
import pytest

from gbt_ocp.experiments.sweep.engines import Serial
from gbt_ocp.reporting import bands
from gbt_ocp.studies.paper import fig4, fig7, fig8, fig9
from gbt_ocp.studies.paper.measures import same_sign, window_correlation
from gbt_ocp.studies.paper.workbench import Workbench

RUNS = 3


class MadeUp:
    """Stands for a workbench: every run is made by a function of its labels and its number."""

    seeds = tuple(range(RUNS))
    column = staticmethod(Workbench.column)

    def __init__(self, make):
        self._make = make

    def sweep(self, name, variants, *, arrays=()):
        runs = [(v.overrides, self._make(v.overrides, i)) for v in variants for i in range(RUNS)]
        rows = [{**labels, "number": n, "error_settled": run["settled"]} for n, (labels, run) in enumerate(runs)]
        assert all(set(arrays) <= set(run) for _, run in runs)

        def matching(**wanted):
            return [row for row in rows if all(row[key] == value for key, value in wanted.items())]

        def kept(chosen, array):
            return np.array([runs[row["number"]][1][array] for row in chosen])

        return SimpleNamespace(matching=matching, arrays=kept)


def verdicts(report, part):
    return [finding.holds for finding in report.findings if part in finding.statement]


# Figure 8


def robust(labels, number, **worse):
    """0.01 m everywhere, 0.5 m within 1.5 s of an event; ``worse`` replaces the errors of a scenario."""
    period = labels["level"] if labels["scenario"] == "period" else 0.1
    t = period * np.arange(round(30.0 / period) + 1)
    level = {"period": 0.1 * period, "noise": 0.02 * labels["level"]}.get(labels["scenario"], 0.01)
    error = np.full(len(t), level)
    if labels["scenario"] in ("outliers", "manoeuvres"):
        error[((t >= 10.0) & (t < 11.5)) | ((t >= 20.0) & (t < 21.5))] = 0.5
    if labels["scenario"] in worse and labels["level"] >= 0.1:
        error = np.where(t >= 2.0, worse[labels["scenario"]], error)
    return {"t": t, "mean_error": error, "settled": error[t >= 2.0].mean()}


def test_fig8_finds_every_statement_kept_where_it_is():
    report = fig8.conduct(MadeUp(robust))
    assert [finding.holds for finding in report.findings] == [True] * 14
    rows = {(row[0], row[1], row[2]): row for row in report.tables["fig8"].rows}
    assert len(rows) == 2 * (4 + 4 + 4 + 3 + 4)
    assert rows["outliers", "6", "10°"][-2:] == (0.5, 0.01)
    assert rows["bearing noise", "3", "0°"][5] == pytest.approx(0.01)
    assert rows["sampling period", "3", "0.3 s"][5] == pytest.approx(0.03)
    assert set(report.figures) == {f"fig8_{name}" for name in fig8.SCENARIOS}


@pytest.mark.parametrize(
    ("scenario", "error", "statement"),
    [
        ("noise", 2.0, "within 1 m."),
        ("noise", 0.2, "below 0.15 m with noise of 1°"),
        ("missed", 0.016, "1.5 times"),
        ("outliers", 1.1, "outliers cause"),
        ("outliers", 0.03, "at most twice"),
        ("period", 0.4, "sampling period"),
        ("manoeuvres", 0.11, "below 0.1 m"),
    ],
)
def test_fig8_finds_a_statement_broken_where_it_is(scenario, error, statement, monkeypatch):
    monkeypatch.setattr(bands, "draw_bands", lambda *arguments, **options: None)
    report = fig8.conduct(MadeUp(lambda labels, number: robust(labels, number, **{scenario: error})))
    assert verdicts(report, statement)[-2:] == [False, False]


# Figure 7


def lengths(labels, number, rising=True):
    error = 0.01 / labels["N_c"] * (2.0 if (labels["n"] == 12) == rising else 1.0)
    return {
        "t": 0.1 * np.arange(50),
        "covariance_norm": np.full(50, error**2),
        "settled": error * (1.0 + 0.01 * number),
    }


def test_fig7_finds_errors_that_fall_with_the_window_and_rise_with_the_forecast():
    report = fig7.conduct(MadeUp(lengths))
    assert all(finding.holds for finding in report.findings)
    assert len(report.findings) == 6
    row = next(row for row in report.tables["fig7"].rows if row[:3] == ("5", 12, 20))
    assert row[5] == pytest.approx(0.001 * 1.01)
    assert row[6] == pytest.approx(1e-6)
    # the least error is at 30; 20 is the shortest from which on all are within 1.5 times that
    assert all("from N_c = 20 on" in finding.seen for finding in report.findings[:4])
    report = fig7.conduct(MadeUp(lambda labels, number: lengths(labels, number, rising=False)))
    assert verdicts(report, "increases with n") == [False, False]


@pytest.mark.long
def test_fig7_on_real_runs(tmp_path, monkeypatch):
    monkeypatch.setattr(fig7, "CASES", ("case1",))
    monkeypatch.setattr(fig7, "WINDOW_LENGTHS", (6, 12))
    monkeypatch.setattr(fig7, "SETTINGS", ("duration_s=3", "planner.formulation=hard"))
    report = fig7.conduct(Workbench(tmp_path, (0,), Serial()))
    report.write(tmp_path / "report")
    assert [row[:4] for row in report.tables["fig7"].rows] == [
        ("1", 6, 6, 1),
        ("1", 6, 12, 1),
        ("1", 12, 6, 1),
        ("1", 12, 12, 1),
    ]
    errors = [row[5] for row in report.tables["fig7"].rows]
    # twelve exact bearings of a straight line tell more than six
    assert 0.0 < errors[1] < errors[0]
    assert errors[3] < errors[2]
    assert (tmp_path / "report" / "fig7.png").stat().st_size > 10_000


# Figure 4


def orbit(t, d):
    return np.column_stack([np.cos(np.pi * t), np.sin(np.pi * t), np.zeros(len(t))])[:, :d]


def effective(labels, number, factor=1.0):
    """Errors of ``factor`` standard deviations of a posterior of 0.01 m; condition numbers fall with them."""
    t, d = 0.1 * np.arange(301), 2 if labels["case"] in ("case1", "case2", "case3") else 3
    target = np.tile(t[:, None], (1, d))
    mean = np.zeros((301, 12, d))
    for i in range(12):
        mean[:, i] = (t + 0.1 * i)[:, None]
    mean[..., 0] += 0.01 * factor
    decline = 1.0 / (1.0 + t)
    error = np.full((301, 12), 0.01 * factor)
    return {
        "t": t,
        "mean_error": decline,
        "error": error,
        "bound": np.full((301, 12), 0.05),
        "condition_number": np.where(t < 0.2, np.inf, 1.0 + decline),
        "length_scale": np.ones(301) + 0.5 * (t > 15.0),
        "target": target,
        # half a turn a second behind the target, as desired
        "vehicle_pose": np.column_stack([target - 2.0 * orbit(t, d), np.zeros(301)]),
        "bearing": orbit(t, d),
        "desired_bearing": orbit(t, d),
        "forecast_mean": mean,
        "forecast_cov": np.tile(1e-4 * np.eye(d), (301, 12, 1, 1)),
        "settled": 0.02,
    }


@pytest.mark.slow
def test_fig4_reads_bounds_correlation_and_calibration():
    report = fig4.conduct(MadeUp(effective))
    assert all(verdicts(report, "bound of theorem 1"))
    assert all(verdicts(report, "strongly correlated"))
    assert not any(verdicts(report, "rapidly"))  # below 0.1 m only after 9 s
    row = report.tables["fig4"].rows[0]
    assert row[0] == "default"
    assert row[4] == pytest.approx(9.1, abs=0.11)
    assert row[6:8] == (f"{RUNS * 281} of {RUNS * 281}",) * 2
    assert row[8].startswith("1.00 [1.00, 1.00]")
    assert all(verdicts(report, "goes around the target"))
    assert all(verdicts(report, "length scale is adjusted"))
    np.testing.assert_allclose(report.tables["fig4_orbit"].rows[0][2:], [0.5, 0.5, 1.0, 1.0, 2.0, 1.0, 1.5])
    calibration = {row[:3]: row[3:] for row in report.tables["fig4_calibration"].rows}
    np.testing.assert_allclose(calibration["default", "1", "NEES/d"], [0.5] * 12)
    np.testing.assert_allclose(calibration["default", "6", "NEES/d"], [1.0 / 3.0] * 12)
    np.testing.assert_allclose(calibration["default", "1", "95 %"], [1.0] * 12)
    report = fig4.conduct(MadeUp(lambda labels, number: effective(labels, number, factor=6.0)))
    assert not any(verdicts(report, "bound of theorem 1"))
    assert report.tables["fig4"].rows[0][6] == f"0 of {RUNS * 281}"
    calibration = {row[:3]: row[3:] for row in report.tables["fig4_calibration"].rows}
    np.testing.assert_allclose(calibration["default", "1", "NEES/d"], [18.0] * 12)
    np.testing.assert_allclose(calibration["default", "1", "95 %"], [0.0] * 12)


# Figure 9


def test_correlation_over_the_window_is_numpys_and_waits_for_it():
    path = np.random.default_rng(0).standard_normal((30, 3)).cumsum(axis=0)
    found = window_correlation(path, 12)
    assert np.isnan(found[:11]).all()
    for k in (11, 20, 29):
        np.testing.assert_allclose(found[k], np.corrcoef(path[k - 11 : k + 1].T), atol=1e-12)
    still = np.column_stack([np.arange(15.0), np.zeros(15)])
    assert np.isnan(window_correlation(still, 5)[:, 0, 1]).all()
    assert np.isnan(window_correlation(path[:5], 12)).all()


def test_share_of_the_right_sign_counts_clear_steps_only():
    reference = np.array([[0.95, -0.95, 0.2, np.nan, 0.95], [0.1, 0.2, -0.3, 0.4, np.nan]])
    values = np.array([[1.0, 2.0, -1.0, 5.0, 1e-9], [1.0, 1.0, 1.0, 1.0, 1.0]])
    np.testing.assert_allclose(same_sign(values, reference, 0.9), [2.0 / 3.0, np.nan])
    np.testing.assert_allclose(same_sign(values, reference, 0.0), [2.0 / 4.0, 3.0 / 4.0])


def coupled(labels, number, wrong=0.0):
    """Coordinates on a line that turns back at 15 s; a covariance of their sign but in a share of the steps."""
    t, d = 0.1 * np.arange(301), 2 if labels["case"] == "case2" else 3
    target = np.column_stack([t, 15.0 - np.abs(t - 15.0), t])[:, :d]
    sign = np.where(t < 15.0, 1.0, -1.0)
    covariance = np.tile(np.eye(d), (301, 1, 1))
    covariance[:, 0, 1] = covariance[:, 1, 0] = sign * np.where(np.arange(301) % 10 < 10.0 * wrong, -0.5, 0.5)
    if d == 3:
        covariance[:, 0, 2] = covariance[:, 2, 0] = 0.5
        covariance[:, 1, 2] = covariance[:, 2, 1] = covariance[:, 0, 1]
    error = np.full(301, 0.2 if labels["model"] == "lmc" else 0.01)
    return {
        "t": t,
        "mean_error": error + 1.0 / (1.0 + t),
        "error": np.tile(error[:, None], (1, 12)),
        "bound": np.full((301, 12), 0.05),
        "prior_cov": covariance,
        "target": target,
        "bearing": np.tile(np.eye(d)[0], (301, 1)),
        "detected": np.ones(301, dtype=bool),
        "vehicle_pose": np.zeros((301, d + 1)),
        "condition_number": 1.0 + 1.0 / (1.0 + t),
        "settled": error[0],
    }


def test_fig9_reads_errors_bounds_and_signs(monkeypatch):
    monkeypatch.setattr(fig9, "_replayed", lambda *_: fig9.ReplayOutcome(6.0, (10, 10)))
    report = fig9.conduct(MadeUp(coupled))
    assert verdicts(report, "settled error below 0.1 m") == [False, True] * 2
    assert verdicts(report, "within the bound") == [False, True] * 2
    assert all(verdicts(report, "positively correlated"))
    # the covariance turns its sign at once, the correlation over the window a second later, when it is not clear
    assert all(verdicts(report, "the sign of R is right"))
    signs = {row[:3]: row[3:] for row in report.tables["fig9_signs"].rows}
    assert list(signs) == [
        (c, m, p) for c, ps in (("2", ["xy"]), ("6", ["xy", "xz", "yz"])) for m in ("lmc", "lmc, 1 s") for p in ps
    ]
    assert signs["6", "lmc", "xz"][1:] == (1.0,) * 4
    assert 0.9 < signs["2", "lmc", "xy"][3] < 1.0
    rows = {row[:2]: row for row in report.tables["fig9"].rows}
    assert rows["2", "gp"][5:7] == (f"{RUNS * 281} of {RUNS * 281}", None)
    assert rows["2", "lmc"][5:7] == (f"0 of {RUNS * 281}", "10 of 10")
    report = fig9.conduct(MadeUp(lambda labels, number: coupled(labels, number, wrong=0.2)))
    assert not any(verdicts(report, "the sign of R is right"))


@pytest.mark.slow
def test_fig9_on_short_real_runs(tmp_path, monkeypatch):
    """The trackers that are fed once more say what they said in the run: the bound is kept where it was."""
    monkeypatch.setattr(fig9, "SETTINGS", ("planner.formulation=hard", "duration_s=3.0"))
    monkeypatch.setattr(fig9, "CASES", ("case2",))
    report = fig9.conduct(Workbench(tmp_path / "study", (0,), Serial()))
    rows = {row[1]: row for row in report.tables["fig9"].rows}
    assert list(rows) == ["gp", "lmc", "lmc, 1 s"]
    for model in ("lmc", "lmc, 1 s"):
        assert rows[model][5:7] == ("11 of 11", "11 of 11")
        assert rows[model][8] > 1.0
    assert set(report.figures) == {"fig9"}
