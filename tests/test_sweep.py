"""Sweeps of short runs without a solver: the same table whoever carries them out, and however often they stop."""

import contextlib
import csv
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from gbt_ocp.cli import main as cli
from gbt_ocp.experiments import run as run_module
from gbt_ocp.experiments.config.faults import ConfigurationError
from gbt_ocp.experiments.result import Result
from gbt_ocp.experiments.sweep import carry_out as sweeping
from gbt_ocp.experiments.sweep import execution, task_folder
from gbt_ocp.experiments.sweep.carry_out import SweepInterrupted, sweep
from gbt_ocp.experiments.sweep.engines import Serial, WorkerDiedError
from gbt_ocp.experiments.sweep.sweep_plan import SweepPlan, plan_sweep, variant
from gbt_ocp.experiments.sweep.table import WALL_CLOCK_COLUMNS, write_table
from gbt_ocp.files import PARTIAL, whole_folder

SHORT = {"problem": "case1", "duration_s": 1.0, "guidance": {"kind": "random"}}
GRID = {"sensor.noise_deg": [0.0, 1.0]}


def table(folder):
    """Rows of runs.csv without what a clock measured."""
    with open(folder / "runs.csv", newline="", encoding="utf-8") as stream:
        return [{k: v for k, v in row.items() if k not in WALL_CLOCK_COLUMNS} for row in csv.DictReader(stream)]


@pytest.fixture(scope="module")
def done(tmp_path_factory):
    return sweep(SHORT, runs=3, grid=GRID, jobs=1, out=tmp_path_factory.mktemp("sweep") / "serial")


@pytest.mark.slow
def test_rows_are_what_single_runs_are(done):
    rows = table(done.folder)
    assert [row["run"] for row in rows] == [str(number) for number in range(6)]
    assert [row["seed"] for row in rows] == ["0", "1", "2"] * 2
    assert [row["sensor.noise_deg"] for row in rows] == ["0.0"] * 3 + ["1.0"] * 3
    single = run_module.run({**SHORT, "sensor": {"noise_deg": 1.0}, "seed": 2}).summary
    last = rows[-1]
    assert float(last["error_mean"]) == single["error_mean"]
    assert last["fallbacks.braking"] == str(single["fallbacks"]["braking"])
    assert json.loads(last["thrust_max"]) == single["thrust_max"]
    assert last["solver_success_rate"] == ""
    assert done.rows[-1]["error_mean"] == single["error_mean"]
    # a run folder is a run folder
    result = Result.load(done.run_folder(done.rows[-1]))
    assert result.history.t.shape == (11,)
    assert done.arrays(done.matching(**{"sensor.noise_deg": 1.0}), "error").shape == (3, *result.history.error.shape)


@pytest.mark.parametrize("who", [{"jobs": 2}, pytest.param({"dask": "local"}, marks=pytest.mark.slow)])
def test_engines_give_the_same_table(done, tmp_path, who):
    if "dask" in who:
        pytest.importorskip("distributed")
    other = sweep(SHORT, runs=3, grid=GRID, out=tmp_path / "other", **who)
    assert table(other.folder) == table(done.folder)


def test_pandas_and_parquet_read_it(done):
    pandas = pytest.importorskip("pandas")
    frame = pandas.read_csv(done.folder / "runs.csv")
    assert frame.groupby("sensor.noise_deg")["error_mean"].count().tolist() == [3, 3]
    pytest.importorskip("pyarrow")
    columns = pandas.read_parquet(done.folder / "runs.parquet")
    assert columns["error_mean"].tolist() == frame["error_mean"].tolist()
    assert columns.columns.tolist() == frame.columns.tolist()


def test_columns_of_mixed_values_are_written(tmp_path):
    rows = [{"a": 1, "b": "tuned", "c": None}, {"a": 0.5, "b": 2.0, "c": [1.0]}, {"a": None, "b": None, "d": True}]
    write_table(tmp_path, rows)
    assert (tmp_path / "runs.csv").read_text() == "a,b,c,d\n1,tuned,,\n0.5,2.0,[1.0],\n,,,True\n"
    if pytest.importorskip("pyarrow"):
        from pyarrow.parquet import read_table

        assert read_table(tmp_path / "runs.parquet").to_pydict() == {
            "a": [1.0, 0.5, None],
            "b": ["tuned", "2.0", None],
            "c": [None, "[1.0]", None],
            "d": [None, None, True],
        }


def test_every_key_of_any_variant_is_a_column_before_the_numbers(tmp_path):
    entries = [{}, {"sensor.noise_deg": 1.0}, {"tracker.window": 7, "sensor.noise_deg": 0.5}, {"tracker.window": 8}]
    found = sweep(SHORT, runs=1, entries=entries, jobs=1, out=tmp_path / "sweep", histories=False)
    rows = table(found.folder)
    assert list(rows[0])[:6] == ["run", "status", "error", "seed", "sensor.noise_deg", "tracker.window"]
    asked = [(row["sensor.noise_deg"], row["tracker.window"]) for row in rows]
    assert asked == [("", ""), ("1.0", ""), ("0.5", "7"), ("", "8")]
    assert [len(found.matching(**entry)) for entry in entries] == [4, 1, 1, 1]


def test_a_label_that_only_some_variants_have_is_not_filled_from_the_summary(tmp_path):
    plain = variant(SHORT, {})
    labelled = variant(SHORT, {"sensor.noise_deg": 1.0}, labels={"steps": "noisy"})  # summaries have steps too
    plan = SweepPlan((plain, labelled), (0,), histories=False)
    sweeping.begin(tmp_path / "sweep", plan)
    sweeping.carry_out(plan, tmp_path / "sweep", Serial())
    assert [row["steps"] for row in table(tmp_path / "sweep")] == ["", "noisy"]


class Stops:
    """An engine that is interrupted after some jobs."""

    def __init__(self, after):
        self.after = after

    def map(self, function, jobs):
        for number, job in enumerate(jobs):
            if number == self.after:
                raise KeyboardInterrupt
            yield job, function(job)


@pytest.mark.long
def test_an_interrupted_sweep_goes_on_where_it_stopped(done, tmp_path, monkeypatch):
    plan = plan_sweep(SHORT, runs=3, grid=GRID)
    folder = tmp_path / "again"
    sweeping.begin(folder, plan)
    with pytest.raises(SweepInterrupted) as caught:
        sweeping.carry_out(plan, folder, Stops(2))
    assert (caught.value.finished, caught.value.planned) == (2, 6)
    assert len(table(folder)) == 2
    carried = []
    monkeypatch.setattr(
        sweeping, "execute", lambda run, **how: carried.append(run.number) or execution.execute(run, **how)
    )
    again = sweep(resume=folder, jobs=1)
    assert carried == [2, 3, 4, 5]
    assert table(again.folder) == table(done.folder)
    sweep(SHORT, runs=3, grid=GRID, jobs=1, resume=folder)
    assert len(carried) == 4


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"runs": 4}, "seeds: 3 from 0 there, 4 from 0 here"),
        ({"grid": {"sensor.noise_deg": [0.0]}}, "2 variants there, 1 here"),
        ({"grid": {"sensor.noise_deg": [0.0, 2.0]}}, 'variant 1: {"sensor.noise_deg": 1.0} there'),
        ({"overrides": ["planner.pieces=4"]}, "variant 0 differs in planner"),
        ({"histories": False}, "other histories are kept there"),
    ],
)
def test_the_folder_of_another_sweep_is_refused_in_one_line(done, changes, words):
    with pytest.raises(ConfigurationError) as caught:
        sweep(SHORT, **{"runs": 3, "grid": GRID, "jobs": 1, "resume": done.folder, **changes})
    (line,) = caught.value.faults
    assert line.startswith(f"--resume: found {done.folder}, the folder of another sweep")
    assert words in line


@pytest.mark.parametrize("damage", ["missing", "empty", "half", "list"])
def test_a_damaged_run_is_run_again(done, tmp_path, capsys, damage):
    folder = shutil.copytree(done.folder, tmp_path / "sweep")
    summary = folder / "runs" / "000002" / "summary.json"
    text = summary.read_text(encoding="utf-8")
    if damage == "missing":
        summary.unlink()
    else:
        summary.write_text({"empty": "", "half": text[: len(text) // 2], "list": "[]"}[damage], encoding="utf-8")
    again = sweep(resume=folder, jobs=1)
    assert table(again.folder) == table(done.folder)
    assert "000002: damaged" in capsys.readouterr().err
    assert json.loads(summary.read_text(encoding="utf-8"))["seed"] == 2


def test_folders_that_hold_no_sweep_or_something_else_are_refused(done, tmp_path):
    for call in (
        lambda: sweep(resume=tmp_path),
        lambda: sweep(SHORT, runs=1, out=done.folder),
        lambda: sweep(SHORT),
        lambda: sweep(runs=1),
        lambda: sweep(SHORT, runs=1, jobs=1, dask="local", out=tmp_path / "x"),
    ):
        with pytest.raises(ConfigurationError) as caught:
            call()
        assert len(caught.value.faults) == 1


def test_a_failed_run_is_recorded_and_stops_nobody(tmp_path, monkeypatch):
    real = run_module.run

    def fails(configuration):
        if configuration.seed == 1:
            raise FloatingPointError("the world\nended")
        return real(configuration)

    monkeypatch.setattr(run_module, "run", fails)
    found = sweep(SHORT, runs=3, jobs=1, out=tmp_path / "sweep", histories=False)
    assert [row["status"] for row in found.rows] == ["done", "failed", "done"]
    assert found.failed[0]["error"] == "FloatingPointError: the world ended"
    assert "fails" in json.loads((tmp_path / "sweep/runs/000001/failure.json").read_text())["traceback"]
    row = table(found.folder)[1]
    assert (row["error"], row["error_mean"]) == ("FloatingPointError: the world ended", "")
    assert [row["run"] for row in found.matching()] == [0, 2]
    assert not (tmp_path / "sweep/runs/000000/history.npz").exists()
    # it is finished: nothing is repeated
    monkeypatch.setattr(run_module, "run", None)
    assert sweep(resume=tmp_path / "sweep", jobs=1).rows == found.rows


def test_single_arrays_can_be_kept_instead_of_histories(tmp_path):
    plan = plan_sweep(SHORT, runs=2, histories=False)
    plan = type(plan)(plan.variants, plan.seeds, False, ("t", "mean_error"))
    sweeping.begin(tmp_path / "sweep", plan)
    found = sweeping.carry_out(plan, tmp_path / "sweep", Serial())
    assert sweeping.resumed_plan(tmp_path / "sweep", plan) == plan
    errors = found.arrays(found.rows, "mean_error")
    assert errors.shape == (2, 11)
    np.testing.assert_array_equal(errors.mean(axis=1), [row["error_mean"] for row in found.rows])


def die_at_seed_one(run, folder, **how):
    """Takes its process down, after it has begun as a run does."""
    if run.seed == 1:
        with sweeping.whole_folder(folder / run.identifier):
            os.kill(os.getpid(), signal.SIGKILL)
    return execution.execute(run, folder, **how)


@pytest.mark.slow
@pytest.mark.skipif(os.name != "posix", reason="kills a process")
def test_a_run_that_kills_its_worker_is_recorded(tmp_path, monkeypatch):
    monkeypatch.setattr(sweeping, "execute", die_at_seed_one)
    found = sweep(SHORT, runs=4, jobs=2, out=tmp_path / "sweep")
    assert [row["status"] for row in found.rows] == ["done", "failed", "done", "done"]
    assert "the process died" in found.rows[1]["error"]
    assert sorted(entry.name for entry in (tmp_path / "sweep/runs").iterdir()) == [f"{n:06d}" for n in range(4)]


def test_a_lost_run_is_recorded(tmp_path, monkeypatch):
    class Lost:
        def map(self, function, jobs):
            place = tmp_path / "sweep" / "runs" / "000001"
            with contextlib.suppress(WorkerDiedError), whole_folder(place) as temporary:
                shutil.copytree(temporary, temporary.with_name(f".000001{PARTIAL}dead"))  # what its worker had begun
                raise WorkerDiedError("killed")
            yield from Serial().map(function, [job for job in jobs if job.seed != 1])
            raise WorkerDiedError("killed")

    plan = plan_sweep(SHORT, runs=3)
    sweeping.begin(tmp_path / "sweep", plan)
    again = []
    monkeypatch.setattr(task_folder, "Processes", lambda count: again.append(count) or Lost())
    found = sweeping.carry_out(plan, tmp_path / "sweep", Lost())
    assert again == [1]
    assert [row["status"] for row in found.rows] == ["done", "failed", "done"]
    assert "the process died" in found.rows[1]["error"]
    assert sorted(entry.name for entry in (tmp_path / "sweep/runs").iterdir()) == [f"{n:06d}" for n in range(3)]


COMMAND = [sys.executable, "-m", "gbt_ocp.cli", "sweep"]


def killed_when(folder, count, arguments, number):
    """Start a sweep and end it, with all its workers, when so many runs are finished; its exit code."""
    process = subprocess.Popen([*COMMAND, *arguments, "--quiet"], stderr=subprocess.PIPE, text=True, process_group=0)
    runs = folder / "runs"
    deadline = time.monotonic() + 120.0
    while process.poll() is None and time.monotonic() < deadline:
        if runs.is_dir() and sum(not entry.name.startswith(".") for entry in runs.iterdir()) >= count:
            break
        time.sleep(0.02)
    os.killpg(process.pid, number)
    _, errors = process.communicate(timeout=60)
    return process.returncode, errors


@pytest.mark.slow
@pytest.mark.skipif(os.name != "posix", reason="kills processes")
@pytest.mark.parametrize("runs", [8, 200])
def test_killed_twice_and_resumed_the_table_is_the_same(tmp_path, runs):
    arguments = ["case1", "--runs", str(runs), "--set", "duration_s=1.0", "guidance.kind=random"]
    folder = tmp_path / "killed"
    for share, where in ((0.25, "--out"), (0.6, "--resume")):
        code, _ = killed_when(
            folder, int(share * runs), [*arguments, "--jobs", "2", where, str(folder)], signal.SIGKILL
        )
        assert code == -signal.SIGKILL
    subprocess.run([*COMMAND, "--resume", str(folder), "--jobs", "2", "--quiet"], check=True, capture_output=True)
    whole = sweep(
        "case1", runs=runs, overrides=["duration_s=1.0", "guidance.kind=random"], jobs=2, out=tmp_path / "whole"
    )
    assert len(table(folder)) == runs
    assert table(folder) == table(whole.folder)
    assert sorted(entry.name for entry in (folder / "runs").iterdir()) == [f"{n:06d}" for n in range(runs)]


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="looks for child processes in /proc")
@pytest.mark.long
def test_workers_take_up_no_further_run_when_the_sweep_is_killed_alone_and_it_is_resumed(tmp_path):
    def state_and_parent(pid):
        try:
            state, parent = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[:2]
        except OSError:
            return "gone", 0
        return state, int(parent)

    def working(pids):
        return [pid for pid in pids if state_and_parent(pid)[0] not in ("gone", "Z", "X")]

    folder = tmp_path / "sweep"
    short, runs = ["duration_s=1.0", "guidance.kind=random"], 20
    arguments = ["case1", "--runs", str(runs), "--set", *short, "--jobs", "2", "--quiet"]
    process = subprocess.Popen([*COMMAND, *arguments, "--out", str(folder)], process_group=0)
    try:
        deadline = time.monotonic() + 120.0
        while not ((folder / "runs").is_dir() and len(list((folder / "runs").glob("[0-9]*"))) >= 4):
            assert process.poll() is None
            assert time.monotonic() < deadline
            time.sleep(0.02)
        everyone = [int(entry.name) for entry in Path("/proc").glob("[0-9]*")]
        workers = [pid for pid in everyone if state_and_parent(pid)[1] == process.pid]
        assert len(workers) >= 2
        process.kill()
        process.wait()
        there = len(list((folder / "runs").glob("[0-9]*")))
        while working(workers) and time.monotonic() < deadline:
            time.sleep(0.05)
        assert not working(workers)
        # what was being run is finished; four more were waiting
        assert len(list((folder / "runs").glob("[0-9]*"))) <= there + 2 < runs
    finally:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
    sweep(resume=folder, jobs=1)
    whole = sweep("case1", runs=runs, overrides=short, jobs=1, out=tmp_path / "whole")
    assert table(folder) == table(whole.folder)
    assert sorted(entry.name for entry in (folder / "runs").iterdir()) == [f"{n:06d}" for n in range(runs)]


@pytest.mark.skipif(os.name != "posix", reason="sends a signal")
@pytest.mark.parametrize("jobs", [pytest.param("1", marks=pytest.mark.slow), "2"])
@pytest.mark.long
def test_interrupt_keeps_what_is_finished_and_says_how_to_go_on(tmp_path, jobs):
    folder = tmp_path / "sweep"
    arguments = ["case1", "--runs", "300", "--set", "duration_s=2.0", "guidance.kind=random", "--jobs", jobs]
    code, errors = killed_when(folder, 3, [*arguments, "--out", str(folder)], signal.SIGINT)
    assert code == 4
    # joblib's own process, its resource tracker, may speak after that
    spoken = [line for line in errors.splitlines() if "resource_tracker" not in line]
    own = [line for line in spoken if line.strip() != "warnings.warn("]
    assert own[-1].endswith(f"go on with: gbt-ocp sweep --resume {folder}")
    assert 3 <= len(table(folder)) < 300


@pytest.mark.long
def test_the_command_prints_the_table_and_judges_the_runs(tmp_path, monkeypatch, capsys):
    short = ["--set", "duration_s=0.5", "guidance.kind=random", "--jobs", "1", "--quiet"]
    folder = tmp_path / "sweep"
    (tmp_path / "list.yaml").write_text("- {sensor.noise_deg: 1.0}\n- {sensor.noise_deg: 2.0}\n")
    more = ["--list", str(tmp_path / "list.yaml"), "--grid", "tracker.window=5,6", "--no-histories"]
    assert cli.main(["sweep", "case1", "--runs", "1", "--seed-from", "7", *more, *short, "--out", str(folder)]) == 0
    assert capsys.readouterr().out == f"{folder / 'runs.csv'}\n"
    found = [(row["seed"], row["sensor.noise_deg"], row["tracker.window"]) for row in table(folder)]
    assert found == [("7", noise, window) for noise in ("1.0", "2.0") for window in ("5", "6")]

    real = run_module.run

    def broken(configuration):
        result = real(configuration)
        result.summary["violation_max"] = 0.1 if configuration.seed == 0 else None
        return result

    monkeypatch.setattr(run_module, "run", broken)
    assert cli.main(["sweep", "case1", "--runs", "2", *short, "--out", str(tmp_path / "broken")]) == 3
    assert "broken by 0.1 of the limit" in capsys.readouterr().err
    monkeypatch.setattr(run_module, "run", None)
    assert cli.main(["sweep", "case1", "--runs", "2", *short, "--out", str(tmp_path / "failed")]) == 1
    assert "2 of 2 runs failed; run 0: TypeError" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        ([], "CONFIG: found nothing"),
        (["case1"], "--runs: found nothing"),
        (["case1", "--runs", "0"], "found '0'; allowed: a whole number >= 1"),
        (["--resume", "x", "--runs", "3"], "CONFIG: found nothing"),
        (["case1", "--runs", "1", "--jobs", "1", "--dask", "local"], "not allowed with argument"),
        (["case1", "--runs", "1", "--out", "x", "--resume", "x"], "not allowed with argument"),
        (["case1", "--runs", "1", "--grid", "a.b"], "--grid: found"),
        (["case1", "--runs", "1", "--grid", "planner.gamma=1", "planner.gamma=0.5"], "planner.gamma twice"),
        (["case1", "--runs", "1", "--resume", "x"], "which holds no sweep"),
    ],
)
def test_a_wrong_command_is_one_line(arguments, says, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert cli.main(["sweep", *arguments]) == 2
    out, err = capsys.readouterr()
    assert says in err
    assert (out, len(err.splitlines())) == ("", 1)


def test_no_scheduler_is_one_line(tmp_path):
    pytest.importorskip("distributed")
    with pytest.raises(ConfigurationError, match="--dask: found nonsense://1"):
        sweep(SHORT, runs=1, dask="nonsense://1", out=tmp_path / "x")
    with pytest.raises(ConfigurationError, match="no scheduler answers"):
        sweep(SHORT, runs=1, dask="tcp://127.0.0.1:9", out=tmp_path / "y")
    assert not list(tmp_path.iterdir())
