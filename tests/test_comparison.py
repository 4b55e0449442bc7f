"""The comparison of treatments from problems to report, on runs of seconds."""

import csv
import json
import os
import re
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import gbt_ocp as gbt
from gbt_ocp.cli import main as cli
from gbt_ocp.cli.studies import COMPARED
from gbt_ocp.experiments.build.loop import build_problem, build_vehicle
from gbt_ocp.experiments.config.loading import load_config
from gbt_ocp.ocp.codegen.library import find_compiler
from gbt_ocp.ocp.shot import Shots
from gbt_ocp.ocp.solvers.base import Solution
from gbt_ocp.studies.limits import compare as comparing
from gbt_ocp.studies.limits import sensitivity, treatments
from gbt_ocp.studies.limits import tasks as plan
from gbt_ocp.studies.limits.comparison_figures import COLOURS
from gbt_ocp.studies.limits.formulations import COMPARED_SOLVERS, COMPILED, FORMULATIONS, IPOPT, Formulation, _planner
from gbt_ocp.studies.limits.integrated import by_integration
from gbt_ocp.studies.limits.parts import CarryOut
from gbt_ocp.studies.limits.problems import Problems, draw, record
from gbt_ocp.studies.limits.soft import SoftIpoptSolver
from gbt_ocp.studies.limits.solves import solve_chunk
from gbt_ocp.studies.limits.summaries import contrasts
from gbt_ocp.studies.limits.treatments import Pair, make_planner, treated
from gbt_ocp.studies.limits.verdict import integrated_against_flat

needs_compiler = pytest.mark.skipif(find_compiler() is None, reason="no C compiler")

SHORT = ["duration_s=2.1", "planner.pieces=2"]
CLOCKS = {"time_ms", "core_s", "wall_s", "solver_time_median_ms", "solver_time_max_ms"}


@pytest.fixture(scope="module")
def few():
    """The sweeps with few values: each costs a solver."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sensitivity, "WIDTHS", (0.1, 0.001))
        patch.setattr(sensitivity, "WEIGHTS", (100.0,))
        patch.setattr(sensitivity, "GAMMAS", (0.9, 0.98))
        patch.setattr(sensitivity, "NODES", (1, 4))
        patch.setattr(sensitivity, "PROBLEMS", {IPOPT: 2, COMPILED: 2})
        patch.setattr("gbt_ocp.studies.limits.solves.STARTS", 3)
        yield


@pytest.fixture(scope="module")
def done(few, tmp_path_factory):
    """IPOPT alone, so that it runs where there is no compiler."""
    folder = tmp_path_factory.mktemp("comparison") / "ipopt"
    return gbt.compare(
        "case2", formulations=["penalty", "elastic", "hard", "exchange"], solvers=["ipopt"], runs=2, problems=6,
        overrides=SHORT, out=folder, jobs=1,
    )  # fmt: skip


def rows(folder, name):
    with (folder / "tables" / f"{name}.csv").open(newline="", encoding="utf-8") as stream:
        return list(csv.DictReader(stream))


@pytest.mark.slow
def test_every_pair_solves_every_problem_in_every_mode(done):
    assert isinstance(done, gbt.Comparison)
    problems = Problems.load(done.folder / "problems" / "case2.npz")
    recorded, drawn = (int(np.sum(problems.origin == origin)) for origin in ("recorded", "random"))
    assert (recorded, drawn) == (6, 2)
    known = sum(problems[k].previous is not None for k in range(len(problems)))
    assert 0 < known < recorded  # the first step of a run has no plan before it
    seen = {}
    for row in rows(done.folder, "solves"):
        seen.setdefault((row["formulation"], row["mode"]), []).append(int(row["problem"]))
    for pair in done.plan.pairs:
        assert sorted(seen[pair.formulation, "cold"]) == list(range(8))
        assert len(seen[pair.formulation, "warm"]) == known
    assert {row["seed"] if "seed" in row else row["run"] for row in rows(done.folder, "runs")} >= {"0"}


@pytest.mark.long
def test_best_known_solutions_are_not_beaten_by_what_keeps_the_limits(done):
    for row in rows(done.folder, "solves"):
        if row["kept"] == "1":
            assert float(row["gap"]) >= -1e-12
            assert float(row["violation_between"]) <= 1e-6


@pytest.mark.long
def test_the_report_shows_the_tables_and_the_verdict(done):
    text = (done.folder / "report.md").read_text(encoding="utf-8")
    assert (done.folder / "verdict.txt").read_text(encoding="utf-8").splitlines() == done.verdict
    for sentence in done.verdict:
        assert f"- {sentence}" in text
        for named in re.findall(r"\(table ([a-z_]+)\)", sentence):
            assert f"## Table {named}" in text
            assert done.tables[named]
    page = (done.folder / "report.html").read_text(encoding="utf-8")
    figures = sorted(path.name for path in (done.folder / "figures").glob("*.png"))
    assert len(figures) >= 7
    for name in figures:
        assert f"figures/{name}" in text
        assert f'src="figures/{name}"' in page
    assert page.count("<table>") == sum(line.startswith(("| ---", "|---")) for line in text.split("\n"))
    # why a pair does not exist stands in the table of formulations
    assert "none: the kernel takes the kinks as inequalities" in text


@pytest.mark.long
def test_the_costs_are_those_of_all_tasks(done):
    costs = rows(done.folder, "costs")
    assert sum(int(row["tasks"]) for row in costs) == len(list((done.folder / "parts").iterdir()))
    assert all(float(row["core_s"]) > 0.0 for row in costs)


@pytest.mark.long
def test_settings_are_the_sweeps_of_all_configurations_together(done):
    pooled, single = rows(done.folder, "settings"), rows(done.folder, "sensitivity")
    assert sum(int(row["problems"]) for row in pooled) == sum(int(row["problems"]) for row in single)
    assert {row["swept"] for row in pooled} == {"width", "weight", "units", "gamma", "nodes"}
    (narrow,) = [
        row for row in pooled if (row["formulation"], row["swept"], row["value"]) == ("penalty", "width", "0.001")
    ]
    # ϖ τ_max T²/M with the inertia of sway, the larger one
    assert float(narrow["kink_mm"]) == pytest.approx(1e3 * 0.001 * 5000.0 * 0.1**2 / 593.2, rel=0.02)


def comparable(folder):
    """Every table without what a clock measured."""
    found = {}
    for path in sorted((folder / "tables").glob("*.csv")):
        if path.stem in ("solves", "runs", "best_known"):
            found[path.stem] = [{k: v for k, v in row.items() if k not in CLOCKS} for row in rows(folder, path.stem)]
    return found


@pytest.mark.slow  # in seconds: test_task_folder.py, without a solver
def test_an_interrupted_comparison_goes_on_where_it_stopped(few, tmp_path, monkeypatch):
    def asked(name, **more):
        return gbt.compare(
            "case2", formulations=["hard"], solvers=["ipopt"], runs=2, problems=4,
            overrides=["duration_s=0.4", "planner.pieces=2"], out=tmp_path / name, jobs=1, **more,
        )  # fmt: skip

    done = asked("whole")
    carried = []
    whole = CarryOut.__call__

    def counted(self, task):
        carried.append(task.name)
        if len(carried) == 6:
            raise KeyboardInterrupt
        return whole(self, task)

    monkeypatch.setattr(CarryOut, "__call__", counted)
    with pytest.raises(comparing.ComparisonInterruptedError, match=r"5 of \d+ tasks are finished and kept"):
        asked("again")
    finished = carried[:5]
    assert sorted(path.name for path in (tmp_path / "again" / "parts").iterdir()) == sorted(finished)
    again = asked("again")
    assert not set(finished) & set(carried[6:])
    assert comparable(again.folder) == comparable(done.folder)
    carried.clear()
    asked("again")
    assert carried == []
    # the compiled solver steers for hard limits unless all of the work is asked for; what is there is kept then
    assert asked("again", full=True).tables["closed_loop"][0]["runs"] == 2
    assert carried == ["loop-case2-hard-ipopt-0.csv", "loop-case2-hard-ipopt-1.csv"]
    with pytest.raises(gbt.ConfigurationError, match="holds another comparison"):
        asked("again")


def test_a_formulation_that_no_chosen_solver_solves_is_refused():
    with pytest.raises(
        gbt.ConfigurationError, match="found 'penalty', which no solver of compiled solves; allowed: elastic"
    ):
        treatments.chosen_pairs(["penalty", "hard"], ["compiled"])
    assert treatments.chosen_pairs(FORMULATIONS, ["compiled"])


def test_slow_pairs_get_a_share_of_the_work_unless_all_is_asked_for():
    configurations = load_config("case2"), load_config("case3")
    # mixed is for limits on the target, which these have not
    pairs = [one for one in treatments.chosen_pairs(FORMULATIONS, COMPARED_SOLVERS) if one.formulation != "mixed"]
    some, full = (plan.ComparisonPlan(configurations, tuple(pairs), 10, 200, full=full) for full in (False, True))

    def work(of):
        seeds, problems = {}, {}
        for task in plan.measurements(of, [250, 250]):
            if task.kind == "loop":
                seeds[task.pair.name] = seeds.get(task.pair.name, 0) + 1
            if task.kind == "solve":
                problems[task.pair.name] = problems.get(task.pair.name, 0) + len(task.argument[1])
        return seeds, problems

    seeds, problems = work(full)
    assert seeds == {pair.name: 2 * 10 for pair in pairs}
    assert problems == {pair.name: 2 * 2 * 250 for pair in pairs}  # cold and warm; those without a plan are left out
    seeds, problems = work(some)
    compiled = {pair.name for pair in pairs if pair.solver == COMPILED}
    assert {name for name, count in seeds.items() if count == 20} == compiled
    assert {name for name, count in problems.items() if count == 1000} == compiled
    assert seeds["penalty, ipopt"] == 2
    assert problems["penalty, ipopt"] == 300


@pytest.mark.skipif(os.name != "posix", reason="sends a signal")
@pytest.mark.parametrize("jobs", [pytest.param("1", marks=pytest.mark.slow), "2"])
@pytest.mark.long
def test_ctrl_c_keeps_what_is_finished(tmp_path, jobs):
    command = [
        sys.executable, "-m", "gbt_ocp.cli", "compare", "case2", "--formulations", "hard", "--solvers", "ipopt",
        "--runs", "2", "--problems", "4", "--set", "duration_s=6", "--out", str(tmp_path / "out"), "--jobs", jobs,
    ]  # fmt: skip
    process = subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        # what a shell starts in the background ignores Ctrl-C, and so would its children
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )  # fmt: skip
    parts = tmp_path / "out" / "parts"
    patience = time.monotonic() + 120.0
    while not (parts.is_dir() and list(parts.glob("record-*"))):
        assert time.monotonic() < patience
        assert process.poll() is None
        time.sleep(0.02)
    process.send_signal(signal.SIGINT)
    out, told = process.communicate(timeout=120)
    assert process.returncode == cli.INTERRUPTED, told
    assert "Traceback" not in told
    assert re.search(r"^interrupted: \d+ of \d+ tasks are finished and kept in .*out; the same command", told, re.M)
    assert out == ""
    assert not (tmp_path / "out" / "report.md").exists()
    assert not list(parts.glob(".*"))


@pytest.mark.long
@pytest.mark.skipif(os.name != "posix", reason="sends a signal")
def test_ctrl_c_while_problems_are_drawn_is_not_lost(tmp_path, monkeypatch):
    def pressed(*arguments):
        os.kill(os.getpid(), signal.SIGINT)
        return draw(*arguments)

    monkeypatch.setattr("gbt_ocp.studies.limits.parts.draw", pressed)
    with pytest.raises(comparing.ComparisonInterruptedError, match=r"1 of 1 tasks are finished and kept"):
        gbt.compare(
            "case2", formulations=["hard"], solvers=["ipopt"], runs=1, problems=2, out=tmp_path / "out", jobs=1,
            overrides=["duration_s=0.4", "planner.pieces=2"],
        )  # fmt: skip


class Fails:
    """A solver that never succeeds."""

    name = IPOPT

    def __init__(self, problem, options):
        self.problem = problem

    def solve(self, start, objectives, guess, *, cold, tightening=0.0, limits=()):
        return Solution(np.full_like(guess, np.nan), False, "Maximum_Iterations_Exceeded", 300)


@pytest.mark.slow
def test_a_formulation_that_fails_is_shown_failing(few, tmp_path, monkeypatch):
    failing = Formulation("never solves", False, {IPOPT: _planner(Fails)})
    kept = {**FORMULATIONS, "failing": failing}
    monkeypatch.setattr(treatments, "FORMULATIONS", kept)
    monkeypatch.setattr(plan, "FORMULATIONS", kept)
    monkeypatch.setitem(COLOURS, "failing", "black")
    found = gbt.compare(
        "case2", formulations=["hard", "failing"], solvers=[IPOPT], runs=1, problems=2, overrides=["duration_s=0.6"],
        out=tmp_path / "out", jobs=1,
    )  # fmt: skip
    mine = [row for row in found.tables["open_loop"] if row["formulation"] == "failing"]
    assert sum(row["problems"] for row in mine) == 2 + 1 + 1  # cold, random, and the one with a plan before it
    assert all((row["solved"], row["kept"], row["iterations_median"]) == (0, 0, 300.0) for row in mine)
    (loop,) = [row for row in found.tables["closed_loop"] if row["formulation"] == "failing"]
    # the first step has nothing to fall back to but braking
    assert loop["fallbacks_braking"] >= 1
    assert sum(loop[f"fallbacks_{word}"] for word in ("shifted", "cold", "braking")) == loop["steps"]
    assert "failing, ipopt: solved no problem" in " ".join(found.verdict)
    assert "failing | ipopt | 0 of " in (found.folder / "report.md").read_text(encoding="utf-8")


@needs_compiler
def test_recorded_problems_are_those_of_the_run():
    configuration = treated(load_config("case2", SHORT), "hard", solver="compiled")
    history = gbt.run(configuration).history
    problems = record(configuration, 8)
    steps = np.round(problems.time / 0.1).astype(int)
    assert np.all(problems.origin == "recorded")
    assert steps[0] == 0
    assert steps[-1] == len(history.t) - 1
    assert np.array_equal(problems.start[:, 0], history.vehicle_pose[steps])
    assert np.array_equal(problems.mean, history.forecast_mean[steps, : problems.mean.shape[1]])
    # solved warm by the treatment that the run was under, each gives the plan of the run
    planner = make_planner(configuration, Pair("hard", COMPILED))
    for number, step in enumerate(steps[1:], start=1):
        instance = problems[number]
        planner.previous = instance.previous
        plan = planner.solve(instance.start, **instance.data)
        assert plan.trajectory.knots[1:, 0] == pytest.approx(history.plan[step], abs=1e-12)


def test_random_problems_depend_on_the_seed_alone():
    configuration = load_config("case5", ["planner.pieces=3"])
    first, again = draw(configuration, 5), draw(configuration, 5)
    assert np.array_equal(first.start, again.start)
    assert np.array_equal(first.covariance, again.covariance)
    assert np.all(np.linalg.eigvalsh(first.covariance) > 0.0)
    other = draw(configuration.model_copy(update={"seed": 1}), 5)
    assert not np.array_equal(first.start, other.start)
    assert not np.array_equal(first.start, draw(load_config("case6", ["planner.pieces=3"]), 5).start)
    assert all(first[k].previous is None for k in range(5))


def test_problems_survive_their_file(tmp_path):
    problems = draw(load_config("case2", SHORT), 3)
    problems.save(tmp_path / "x.npz")
    again = Problems.load(tmp_path / "x.npz")
    assert np.array_equal(again.desired, problems.desired)
    assert again[1].previous is None
    assert [path.name for path in tmp_path.iterdir()] == ["x.npz"]


def test_units_of_the_penalty_are_units_only():
    configuration = load_config("case2", [*SHORT, "planner.formulation=penalty"])
    pair = Pair("elastic", IPOPT)
    swept = {sweep.swept: sweep for sweep in sensitivity.varied_settings(configuration, [pair])}
    assert set(swept) >= {"width", "weight", "units", "gamma", "nodes"}
    name, changes = swept["units"].points[0]
    assert name == "newton, width 50 N, weight 0.2"
    # the yaw axis has another limit, so that only problems without yaw thrust on the kink agree to the last digit
    problems = draw(configuration, 4)
    plain = solve_chunk(configuration, problems, range(4), pair, "cold")
    newton = solve_chunk(configuration, problems, range(4), pair, "cold", **dict(changes))
    assert [row["solved"] for row in plain + newton] == [1] * 8
    assert [row["objective"] for row in newton] == pytest.approx([row["objective"] for row in plain], abs=0.02)


@pytest.mark.parametrize(
    ("asked", "told"),
    [
        (["case2", "--formulations", "hard,best"], "--formulations: found 'best'; allowed: penalty, "),
        (["case2", "--solvers", "snopt"], "--solvers: found 'snopt'; allowed: ipopt, compiled"),
        (["case2", "--formulations", "penalty", "--solvers", "compiled"], "found no pair of penalty with compiled"),
        (["case2", "case2"], "name: found 'case2' twice; allowed: distinct names"),
        (["case2", "--set", "guidance.kind=static"], "guidance.kind: found 'static'; allowed: planner"),
        (["nowhere"], "nowhere"),
        (["case2", "--runs", "0"], "--runs"),
    ],
)
def test_wrong_input_is_refused_in_one_line(asked, told, tmp_path, capsys):
    try:
        code = cli.main(["compare", *asked, "--out", str(tmp_path / "out")])
    except SystemExit as stopped:  # what the parser itself refuses
        code = stopped.code
    assert code == cli.WRONG_INPUT
    error = capsys.readouterr().err
    assert told in error
    assert "Traceback" not in error
    assert not (tmp_path / "out").exists()


@pytest.mark.long
def test_a_folder_of_something_else_is_left_alone(done, few, tmp_path):
    (tmp_path / "mine.txt").write_text("dear diary")
    with pytest.raises(gbt.ConfigurationError, match="not an empty folder"):
        gbt.compare("case2", out=tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["mine.txt"]
    before = (done.folder / "comparison.json").read_bytes()
    with pytest.raises(gbt.ConfigurationError, match="holds another comparison"):
        gbt.compare("case2", solvers=["ipopt"], runs=1, out=done.folder)
    assert (done.folder / "comparison.json").read_bytes() == before
    assert json.loads(before)["problems"] == 6


def test_the_command_line_names_all_treatments():
    assert ", ".join(FORMULATIONS) == COMPARED


def test_soft_limits_and_shooting_answer_the_same_questions(tmp_path):
    configuration = load_config("case2", SHORT)
    problems = draw(configuration, 2)
    for pair in (Pair("soft", IPOPT), Pair("shooting", COMPILED), Pair("continuation", IPOPT)):
        found = solve_chunk(configuration, problems, range(2), pair, "cold")
        assert [row["solved"] for row in found] == [1, 1]
        assert max(row["violation_between"] for row in found) < 0.05
    assert SoftIpoptSolver.name == IPOPT


def test_steps_of_plans_by_integration_resolve_the_motion():
    """A piece of so many Runge-Kutta steps ends where an adaptive integration of the numpy model ends."""
    configuration = load_config("sea2d", ["planner.pieces=1"])
    vehicle = build_vehicle(configuration)
    posed = by_integration(build_problem(configuration, vehicle))
    assert 1 < posed.runge_kutta_steps < 16
    shots = Shots(posed)
    rng = np.random.default_rng(0)
    for _ in range(3):
        z, dz = rng.normal(size=3), rng.normal(size=3) * [1.5, 1.5, 0.4]
        thrust = 0.4 * rng.uniform(-1.0, 1.0, 3) * vehicle.thrust_max * [1.0, 1.0, 0.1]
        state = vehicle.state(z, dz)
        exact = solve_ivp(lambda t, x, held=thrust: vehicle.rates(x, held), (0.0, 1.0), state, rtol=1e-9, atol=1e-9)
        ends = shots.trajectory(shots.form.dynamics.state(z, dz), thrust[None]).knots[1]
        np.testing.assert_allclose(ends[0], vehicle.flat(exact.y[:, -1])[0], atol=0.04)


def test_the_verdict_holds_integration_against_flat_plans():
    pairs = [Pair("elastic", COMPILED), Pair("hard", COMPILED), Pair("soft", COMPILED), Pair("shooting", COMPILED)]
    assert contrasts(pairs)[-1] == (Pair("shooting", COMPILED), Pair("soft", COMPILED))
    row = {"pair": "shooting, compiled", "against": "soft, compiled", "times_faster": 0.5, "solved_more": -0.01}
    row |= {"better": 6, "equal": 1, "worse": 3, "both_solved": 10, "objective_more": 0.02}
    (line,) = integrated_against_flat({"paired": [row]}, pairs)
    assert "0.5 times as fast" in line
    assert "better in 6, equal in 1 and worse in 3 of the 10" in line
    assert integrated_against_flat({"paired": []}, pairs) == []


def test_plans_by_integration_are_no_configuration_of_a_comparison(tmp_path):
    with pytest.raises(gbt.ConfigurationError, match=r"torpedo2d: planner.form: found shooting; allowed: flat"):
        gbt.compare("torpedo2d", out=tmp_path / "out")


@pytest.mark.long
def test_shooting_takes_the_limits_at_sea_with_both_solvers():
    """Standoff, speed and yaw rate: compiled and IPOPT find the same plans, which keep the limits at the nodes."""
    overrides = ["planner.pieces=4", "limits.nodes=3", "duration_s=3.0"]
    # a turn at the vehicle's fastest, with all of its thrust
    overrides += ["limits.speed=4.0", "desired_bearing.speed_mps=sensor", "desired_bearing.period_s=auto"]
    overrides += ["desired_bearing.reverse_s=12.0"]
    # cold, by integration, one of them takes more iterations than a plan of sea2d may
    overrides += ["planner.solver_options.compiled.deadline=300"]
    configuration = load_config("sea2d", overrides)
    problems = draw(configuration, 3)
    rows = {}
    for solver in (COMPILED, IPOPT):
        rows[solver] = solve_chunk(configuration, problems, range(3), Pair("shooting", solver), "cold")
    assert [row["solved"] for row in rows[COMPILED]] == [1, 1, 1]
    both = [pair for pair in zip(*rows.values(), strict=True) if pair[1]["solved"]]
    assert len(both) >= 2, "IPOPT may meet a number that is not finite far from the vehicle"
    for mine, other in both:
        assert mine["violation_nodes"] < 0.01
        # not convex: each may end in another plan that is about as good
        assert mine["objective"] == pytest.approx(other["objective"], abs=0.05)
        assert {"violation_thrust", "violation_certain", "violation_believed"} <= set(mine)


def test_a_plan_by_integration_starts_warm_from_the_thrust_of_the_recorded_one():
    """Not convex, so either start may end in another plan, but in one about as good."""
    configuration = load_config("case2", ["duration_s=2.0", "planner.pieces=3"])
    problems = record(configuration, 4)
    pair = Pair("shooting", COMPILED)
    cold, warm = (solve_chunk(configuration, problems, range(len(problems)), pair, mode) for mode in ("cold", "warm"))
    assert [row["problem"] for row in warm] == [1, 2, 3]
    assert all(row["solved"] for row in cold + warm)
    found, other = ([row["objective"] for row in rows] for rows in (warm, cold[1:]))
    np.testing.assert_allclose(found, other, rtol=0.0, atol=0.02)
    assert [row["iterations"] for row in warm] != [row["iterations"] for row in cold[1:]]
