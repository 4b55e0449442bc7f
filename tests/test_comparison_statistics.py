"""Tables and sentences of a comparison, against numbers that are known by other means."""

import itertools
import re

import numpy as np
import pytest

from gbt_ocp.studies.limits import statistics, summaries
from gbt_ocp.studies.limits.comparison_tables import read_rows, write_rows
from gbt_ocp.studies.limits.treatments import Pair
from gbt_ocp.studies.limits.verdict import verdict

HARD, PENALTY, ELASTIC = Pair("hard", "compiled"), Pair("penalty", "ipopt"), Pair("elastic", "compiled")


def clustered(rng, runs, each, spread):
    """Values of which those of one run share an offset."""
    labels = np.repeat(np.arange(runs), each)
    return rng.normal(size=runs)[labels] + spread * rng.normal(size=len(labels)), labels


@pytest.mark.parametrize("statistic", ["mean", "median"])
def test_intervals_are_those_of_all_ways_to_draw_whole_runs(statistic):
    rng = np.random.default_rng(3)
    # runs of different lengths, all 5^5 equally likely draws of which are written out
    labels = np.repeat(np.arange(5), [3, 8, 5, 4, 6])
    values = rng.normal(size=5)[labels] + 0.3 * rng.normal(size=len(labels))
    apply = getattr(np, statistic)
    every = [
        apply(np.concatenate([values[labels == run] for run in drawn]))
        for drawn in itertools.product(range(5), repeat=5)
    ]
    centre, low, high = statistics.interval(values, labels, statistic)
    assert centre == pytest.approx(apply(values))
    # 1000 draws put the ends between neighbouring percentiles of the exact distribution
    assert np.percentile(every, 1.0) <= low <= np.percentile(every, 4.5)
    assert np.percentile(every, 95.5) <= high <= np.percentile(every, 99.0)


def test_steps_of_one_run_do_not_count_as_so_many_experiments():
    values, labels = clustered(np.random.default_rng(0), 8, 50, 0.1)
    _, low, high = statistics.interval(values, labels, "mean")
    _, alone_low, alone_high = statistics.interval(values, range(len(values)), "mean")
    assert high - low > 4.0 * (alone_high - alone_low)


def test_intervals_cover_the_truth_about_as_often_as_they_say():
    rng = np.random.default_rng(1)
    hits = 0
    for _ in range(100):
        low, high = statistics.interval(*clustered(rng, 12, 4, 0.5), "mean")[1:]
        hits += low <= 0.0 <= high
    # percentile intervals of twelve runs fall somewhat short of 95 %
    assert 83 <= hits <= 100


def test_an_interval_leaves_out_what_is_no_number():
    plain = statistics.interval([1.0, 2.0, 4.0], [0, 1, 2], "mean")
    assert statistics.interval([1.0, np.nan, 2.0, 4.0], [0, 0, 1, 2], "mean") == plain
    assert np.isnan(statistics.interval([np.nan], [0], "mean")).all()
    centre, *ends = statistics.interval([2.0, 4.0], ["a", "a"], "mean")
    assert centre == 3.0
    assert np.isnan(ends).all()  # one run says nothing about others


def solve(pair, problem, objective, *, solved=1, between=-0.01, time=1.0, iterations=10, case="case2", run=0):
    return {
        "case": case, "origin": "recorded", "run": run, "problem": problem, "mode": "warm",
        "formulation": pair.formulation, "solver": pair.solver, "solved": solved, "status": "so" if solved else "no",
        "iterations": iterations, "time_ms": time, "objective": objective, "violation_nodes": between - 0.001,
        "violation_between": between,
    }  # fmt: skip


def table_of_solves():
    """Two pairs on four problems; the printed penalty fails on the last one."""
    solves = [solve(PENALTY, k, 4.0, time=100.0, iterations=200, run=k // 2) for k in range(3)]
    solves.append(solve(PENALTY, 3, 9.0, solved=0, between=0.7, time=900.0, iterations=300, run=1))
    solves += [solve(HARD, 0, 4.1, time=2.0), solve(HARD, 1, 4.0005, time=4.0)]
    solves += [solve(HARD, 2, 3.9, time=1.0, between=0.02, run=1), solve(HARD, 3, 3.0, time=1.0, run=1)]
    bests = [{"case": "case2", "problem": k, "best": best} for k, best in enumerate((4.2, 4.0, np.nan, 2.5))]
    return summaries.with_gaps(solves, bests)


def test_gaps_are_to_the_best_that_keeps_the_limits():
    gaps = {(row["formulation"], row["problem"]): row for row in table_of_solves()}
    assert gaps["hard", 0]["gap"] == pytest.approx(0.1)
    assert gaps["penalty", 1]["gap"] == pytest.approx(0.0005)  # the hard solution beats the multi-start
    assert gaps["hard", 2]["best_known"] == 4.0  # its own breaks a limit and counts for nothing
    assert gaps["hard", 2]["gap"] == pytest.approx(0.1)
    assert np.isnan(gaps["penalty", 3]["gap"])  # not solved, however high its objective
    assert gaps["hard", 3]["gap"] == 0.0
    assert [gaps["hard", k]["kept"] for k in range(4)] == [1, 1, 0, 1]
    assert gaps["penalty", 3]["kept"] == 0


def test_table_open_loop_counts_failures_with_their_times():
    penalty, hard = summaries.open_loop(table_of_solves())
    assert (penalty["problems"], penalty["solved"], penalty["solved_share"]) == (4, 3, 0.75)
    assert penalty["time_99_ms"] == pytest.approx(np.percentile([100.0, 100.0, 100.0, 900.0], 99))
    assert penalty["iterations_99"] == pytest.approx(297.0)
    assert penalty["violation_between_max"] == -0.01  # what was not solved has no solution to judge
    assert (hard["solved"], hard["kept"], hard["broken_between"]) == (4, 3, 1)
    assert hard["violation_between_max"] == 0.02
    assert hard["gap_mean"] == pytest.approx((0.1 + 0.0 + 0.1 + 0.0) / 4)


def test_table_paired_holds_the_same_problems_against_each_other():
    (row,) = summaries.paired(table_of_solves(), [PENALTY, HARD])
    assert (row["pair"], row["against"]) == ("hard, compiled", "penalty, ipopt")
    assert (row["problems"], row["both_solved"]) == (4, 3)
    assert row["times_faster"] == pytest.approx(np.exp(np.median(np.log([50.0, 25.0, 100.0, 900.0]))))
    assert row["solved_more"] == pytest.approx(0.25)
    assert row["objective_more"] == pytest.approx((0.1 + 0.0005 - 0.1) / 3)
    assert (row["better"], row["equal"], row["worse"]) == (1, 1, 1)
    assert row["times_faster_low"] <= row["times_faster"] <= row["times_faster_high"]


def loop(pair, run, error, violation=0.0, **counts):
    fallbacks = {f"fallbacks_{word}": counts.get(word, 0) for word in ("shifted", "cold", "braking", "other")}
    return {
        "case": "case2", "run": run, "formulation": pair.formulation, "solver": pair.solver, "error_settled": error,
        "error_mean": error, "distance_median": 1.0, "condition_median": 1.0, "similarity_mean_second_half": 1.0,
        "solver_success_rate": 1.0, "solver_iterations_mean": 9.0, "solver_time_median_ms": 1.0,
        "violation_max": violation, "tightened": 0, "steps": 300, **fallbacks,
    }  # fmt: skip


def all_tables(loops):
    solves = table_of_solves()
    return {
        "open_loop": summaries.open_loop(solves),
        "paired": summaries.paired(solves, [PENALTY, HARD]),
        "closed_loop": summaries.closed_loop(loops),
        "at_a_distance": summaries.at_a_distance(loops),
        "closed_loop_paired": summaries.closed_loop_paired(loops, [PENALTY, HARD]),
        "sensitivity": [],
    }


LOOPS = [
    *(loop(PENALTY, seed, 0.5 + 0.01 * seed, braking=2) for seed in range(3)),
    *(loop(HARD, seed, 0.02 + 0.01 * seed) for seed in range(3)),
]


def test_closed_loops_are_paired_by_seed():
    tables = all_tables(LOOPS)
    (row,) = tables["closed_loop_paired"]
    assert (row["pair"], row["against"], row["runs"]) == ("hard, compiled", "penalty, ipopt", 3)
    assert row["error_more"] == pytest.approx(-0.48)
    # the difference is the same on every seed, so nothing is left to be unsure of
    assert row["error_more_high"] == pytest.approx(-0.48)


def test_a_run_that_goes_astray_is_not_left_out():
    astray = loop(HARD, 3, None, None)
    (penalty, hard) = summaries.closed_loop([*LOOPS, astray])
    assert (penalty["astray"], hard["astray"]) == (0, 1)
    assert np.isnan(hard["error_settled_worst"])
    assert np.isnan(hard["violation_max"])
    text = " ".join(verdict(all_tables([*LOOPS, astray]), [PENALTY, HARD]))
    assert "0.03 m (1 of 4 seeds astray) in case2" in text
    assert "broke a limit of the thrust by no finite number" in text


def test_every_sentence_names_a_table_that_there_is():
    tables = all_tables(LOOPS)
    sentences = verdict(tables, [PENALTY, HARD])
    assert len(sentences) >= 6
    for sentence in sentences:
        named = re.findall(r"\(tables? ([a-z_]+)\)", sentence)
        assert named, sentence
        assert set(named) <= set(tables)
        assert sentence.endswith(").")


def test_sentences_follow_from_the_numbers(tmp_path):
    tables = all_tables(LOOPS)
    for name, rows in tables.items():  # as the report reads them
        write_rows(tmp_path / name, rows)
    tables = {name: read_rows(tmp_path / name) for name in tables}
    text = "\n".join(verdict(tables, [PENALTY, HARD]))
    assert "Every problem of every set was solved by: hard, compiled (table open_loop)." in text
    assert "hard, compiled 75 %; penalty, ipopt 75 %" in text or "penalty, ipopt 75 %; hard, compiled 75 %" in text
    assert "None of them reached 99 %" in text
    assert "penalty, ipopt: solved 75 % of each set, median 100 ms, 99 % 876 ms" in text
    assert "true limits broken between the nodes in 1 of 4 solutions, by 2 % at most" in text
    assert "better in 1, equal in 1 and worse in 1 of the 3 problems that both solved" in text
    assert "needed fallbacks in some of 903 steps (6 braking)" in text
    assert "settles at an error of 0.03 m in case2, " in text
    assert (
        "1 of 1 differences over several seeds have a 95 % interval without zero; the largest of all is -0.48 m" in text
    )


def test_a_treatment_that_solves_nothing_is_said_to():
    solves = summaries.with_gaps([solve(PENALTY, k, np.nan, solved=0) for k in range(3)], [])
    tables = {"open_loop": summaries.open_loop(solves), "paired": [], "sensitivity": []}
    tables |= {"closed_loop": [], "closed_loop_paired": [], "at_a_distance": []}
    sentences = verdict(tables, [PENALTY])
    assert "No pair solved every problem (table open_loop)." in sentences
    assert "penalty, ipopt: solved no problem (table open_loop)." in sentences


def test_the_verdict_on_stiffness_names_where_solves_begin_to_fail():
    def at(stiffness, solved):
        return {
            "case": "case2", "swept": "width", "formulation": "penalty", "solver": "ipopt", "value": str(stiffness),
            "mode": "cold", "kink_mm": 100.0 / stiffness, "stiffness": stiffness, "problems": 10, "solved": solved,
        }  # fmt: skip

    tables = {name: [] for name in ("open_loop", "paired", "closed_loop", "closed_loop_paired", "at_a_distance")}
    swept = [at(10.0, 10), at(50.0, 10), at(200.0, 7), at(1000.0, 1)]
    (sentence,) = verdict({**tables, "sensitivity": swept}, [])
    assert "in every problem up to a stiffness of 50 and not all from 200 on" in sentence
    assert "(1e+03, a kink of 0.1 mm of endpoint motion) in 1 of 10 (table sensitivity)." in sentence


def test_names_that_look_like_numbers_stay_names(tmp_path):
    rows = [{"case": "0010", "formulation": "hard", "solver": "ipopt", "problem": 3, "gap": 0.5, "best": None}]
    write_rows(tmp_path / "x.csv", rows)
    assert read_rows(tmp_path / "x.csv") == rows
