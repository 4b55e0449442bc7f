"""Run everything that takes long, one after another: the slow tests and every benchmark.

    python scripts/everything.py --out runs/everything          # the same command goes on where it stopped
    python scripts/everything.py --out runs/everything --data docs/data      # and writes the tables that pages quote
    python scripts/everything.py --out runs/quick --quick       # a tenth of the seeds, runs and problems
    python scripts/everything.py --list
    python scripts/everything.py --out runs/everything --only theory_coverage test_faults
    python scripts/everything.py --out runs/everything --tracks FOLDER --logs FOLDER    # recorded tracks and bearings

DIR/summary.md has a row for each: exit code, wall and processor time, and where its output is; above them the machine
and the versions. What ended with exit code 0 is not run again. Exit codes: 0 all ended well, 1 something did not,
2 wrong input, 4 interrupted.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import re
import subprocess
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from time import perf_counter
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
OUT, TRACKS, LOGS = "{out}", "{tracks}", "{logs}"


@dataclass(frozen=True)
class Job:
    """One command.

    Attributes
    ----------
    name
        Folder below the output's, what ``--only`` takes, and name of its file of data.
    command
        Arguments after the interpreter; ``{out}`` is the job's own folder, ``{tracks}`` and ``{logs}`` are what
        ``--tracks`` and ``--logs`` say.
    minutes
        Processor minutes it took where that was measured, else ``None``.
    tables
        The files with its tables below the output's folder, as a pattern; by default what it printed and all Markdown
        in its own folder.
    by_heading
        Whether tables are called as the headings above them, and not as the nearest line.
    """

    name: str
    command: tuple[str, ...]
    minutes: float | None = None
    tables: str = ""
    by_heading: bool = False


COUNTS = {"--count", "--seeds", "--runs", "--problems", "--printed", "--ipopt"}
"""Options of the commands that say how often something is done."""


def quick(job: Job) -> Job:
    """The same with a tenth of its counts, at least one each; ``gbt-ocp benchmark`` has an option of its own for it."""
    before = ("", *job.command)
    command = [
        str(max(1, round(int(part) / 10))) if option in COUNTS and part.isdigit() else part
        for option, part in zip(before, job.command, strict=False)
    ]
    if "benchmark" in job.command:
        command.append("--quick")
    return replace(job, command=tuple(command))


def going_on(arguments: Sequence[str]) -> list[str]:
    """Arguments that go on in a folder that was begun, where a command has an option for that."""
    found = list(arguments)
    if "reproduce" in found and Path(found[found.index("--out") + 1]).exists():
        found[found.index("--out")] = "--resume"
    return found


def study(name: str, runs: int) -> Job:
    """The job of a table or a figure of the paper; all share a folder, since figure 6 is of the runs of the tables."""
    command = own("reproduce", name, "--runs", str(runs), "--out", f"{OUT}/../paper")
    return Job(name, command, tables=f"paper/{name}/report.md")


def own(*arguments: str) -> tuple[str, ...]:
    """The arguments of a command of ``gbt-ocp``."""
    return ("-m", "gbt_ocp.cli", *arguments, "--quiet")


def benchmark(script: str, *arguments: str, name: str = "", minutes: float | None = None) -> Job:
    """The job of a file in ``benchmarks/``."""
    return Job(name or script, (f"benchmarks/{script}.py", *arguments), minutes)


SHOOTING_PEERS = ("--seconds", "30", "--loop-seconds", "0", "--planners", "degree 4, C1; held thrust; alpaqa")

BENCHMARKS = (
    benchmark("theory_optimal_bearings"),
    benchmark("theory_counterexamples"),
    benchmark("theory_coverage"),
    benchmark("tracker"),
    benchmark("measurement_kinds"),
    benchmark("pilot_foreign_loop", "--seeds", "40"),
    benchmark("objectives", "--seeds", "3", "--duration", "15"),
    benchmark("objectives", "--config", "sea2d", "--seeds", "6", "--duration", "120", name="objectives_sea"),
    benchmark("exact_bearings", "--seeds", "3"),
    benchmark("axial", "--seeds", "4"),
    benchmark(
        *("follower", "sea2d", "--seeds", "3", "--duration", "40", "--set", "limits.hard=[]"),
        *("--bandwidth", "0.5", "2", "5"),
    ),
    benchmark("plant_errors", "sea2d", "--seeds", "20", "--out", f"{OUT}/runs"),
    benchmark(
        "plant_errors",
        *("case2", "case5", "--seeds", "20", "--duration", "10", "--out", f"{OUT}/runs"),
        name="plant_errors_cases",
    ),
    benchmark(
        "solver",
        *("--study", "horizon,loop", "--printed", "40", "--figure", f"{OUT}/solver_benchmark.png"),
        name="solver_horizon",
        minutes=2.5,
    ),
    benchmark("solver", "--study", "cold", "--ipopt", "250", name="solver_cold", minutes=3.5),
    benchmark("shooting", "--study", "gap,starts,reach", "--problems", "200", "--out", OUT, name="shooting"),
    benchmark("shooting", "--study", "loop", "--seeds", "4", "--out", f"{OUT}/runs", name="shooting_loop"),
    benchmark("shooting_figure", f"{OUT}/../shooting_loop/runs", f"{OUT}/shooting_reach.png"),
    benchmark("planner_peers", "--seconds", "30", "--figure", f"{OUT}/planner_peers.png"),
    benchmark("filter_noise", "--seeds", "1"),
    benchmark("growth", "--only", "p,n_c,N_c", "--figure", f"{OUT}/growth.png", minutes=1.0),
    benchmark("growth", "--only", "p by integration", name="shooting_growth"),
    benchmark("shooting_cold", "--count", "1000", "--json", f"{OUT}/cold.json"),
    benchmark("planner_peers", *SHOOTING_PEERS, "--pieces", "5", name="shooting_peers"),
    benchmark("planner_peers", *SHOOTING_PEERS, "--pieces", "10", name="shooting_peers_10"),
    benchmark("shooting_closed_loop", "--seeds", "10", "--json", f"{OUT}/loop.json"),
    benchmark("settled_error", "--seeds", "10"),
    benchmark("generated_c", "--seeds", "3", minutes=1.5),
    benchmark("kernel_versions", "--base", "e63aa57", "--repeats", "3", minutes=2.0),
    benchmark("single_precision", "--seeds", "12", "--steps", "40"),
    benchmark("pilot_precision", "--seeds", "10"),
    benchmark("pilot_on_arm"),
    benchmark("sweep_rate"),
    replace(
        benchmark("closed_loop", "--seeds", "10", "--jobs", "2", "--out", f"{OUT}/results.md"),
        tables="closed_loop/results_tables.md",
    ),
    Job(
        "public_scenarios",
        own("benchmark", "--logs", LOGS, "--out", f"{OUT}/benchmark"),
        tables="public_scenarios/benchmark/report.md",
        by_heading=True,
    ),
    benchmark("recorded_logs", LOGS),
    *(study(name, 50) for name in ("table2", "table3", "fig5", "fig6")),
    *(study(name, 10) for name in ("fig4", "fig7", "fig8", "fig9")),
    Job(
        "comparison",
        own("compare", "case2", "case3", "case5", "case6", "--runs", "10", "--problems", "200", "--out", f"{OUT}/all"),
    ),
    Job(
        "comparison_sea",
        own(
            *("compare", "sea2d", "sea3d", "--solvers", "compiled", "--runs", "10", "--problems", "100"),
            *("--set", "duration_s=120", "--out", f"{OUT}/sea"),
        ),
    ),
    benchmark("recorded_tracks", TRACKS, "--seeds", "3"),
    Job("sea_run", own("run", "sea2d", "--out", f"{OUT}/run")),
    benchmark(
        "sea_open_loop",
        *("sea2d", "sea2d_speed", "sea3d", "sea3d_speed", "--seeds", "6", "--out", f"{OUT}/open_loop.jsonl"),
        *("--trackers", "mixture", "held_turn", "motion_gp", "imm_ekf", "ekf"),
    ),
    benchmark(
        *("sea_open_loop", "sea2d", "--clutter", "--seeds", "6", "--out", f"{OUT}/open_loop.jsonl"),
        *("--trackers", "mixture", "motion_gp", "gp"),
        name="sea_strays",
    ),
    benchmark(
        "sea_plans",
        *("sea2d", "sea3d", "sea2d_speed", "sea3d_speed", "--seeds", "40", "--duration", "300", "--jobs", "1"),
        *("--out", f"{OUT}/runs"),
    ),
    benchmark(
        "sea_plans",
        *("sea2d", "sea3d", "sea2d_speed", "sea3d_speed", "--seeds", "40", "--duration", "300", "--jobs", "1"),
        *("--set", "desired_bearing.speed_mps=sensor", "--set", "desired_bearing.reverse_s=12"),
        *("--set", "limits.speed=4", "--out", f"{OUT}/runs"),
        name="sea_by_clock",
    ),
    benchmark(
        "sea_plans",
        *("sea2d", "sea3d", "--effort", "0", "0.1", "0.3", "--seeds", "20", "--out", f"{OUT}/runs"),
        name="sea_effort",
    ),
    benchmark(
        "sea_limit",
        *("sea2d", "sea3d", "sea2d_speed", "sea3d_speed", "--seeds", "10", "--out", f"{OUT}/runs"),
    ),
    benchmark("sea_two", "--seeds", "20", "--out", f"{OUT}/runs"),
    benchmark("sea_recorded", TRACKS, "--seeds", "4", "--duration", "120", "--out", f"{OUT}/runs"),
    *(
        benchmark(
            *("sea_water", group, "--seeds", "20", "--duration", "120", "--out", f"{OUT}/runs"), name=f"sea_{group}"
        )
        for group in ("current", "vehicles", "setpoints")
    ),
    benchmark(
        "sea_closed_loop",
        *("sea2d", "sea3d", "sea2d_speed", "sea3d_speed", "--trackers", "motion_gp", "ekf", "imm_ekf"),
        *("--duration", "120", "--seeds", "20", "--out", f"{OUT}/sea"),
    ),
    benchmark(
        "sea_closed_loop",
        *("sea2d", "--trackers", "mixture", "--starts", "10", "30", "100", "--duration", "120", "--seeds", "20"),
        *("--out", f"{OUT}/starts"),
        name="sea_starts",
    ),
)
"""Every benchmark with the arguments of the documentation, the quick ones first."""

PARTS = {"planner_peers_figure", "shooting_forms", "solver_figure", "solver_instances", "solver_optimality"}
"""Files in ``benchmarks/`` that others import and that do nothing by themselves."""


def slow_tests() -> list[Job]:
    """A job for each file with slow tests; one process, so that times mean something."""
    files = sorted((ROOT / "tests").glob("test_*.py"))
    slow = [path for path in files if "mark.slow" in path.read_text(encoding="utf-8")]
    return [Job(path.stem, ("-m", "pytest", "-m", "slow", "-n", "0", "-s", f"tests/{path.name}")) for path in slow]


def jobs() -> list[Job]:
    """All of them in their order."""
    return [*slow_tests(), *BENCHMARKS]


def machine() -> dict[str, str]:
    """What the times hold for."""
    from gbt_ocp.simulation.summary import installed_versions

    commit = subprocess.run(["git", "rev-parse", "HEAD"], cwd=ROOT, capture_output=True, text=True, check=False)
    model = ""
    if Path("/proc/cpuinfo").is_file():
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace").splitlines()
        model = next((line.partition(":")[2].strip() for line in lines if line.startswith("model name")), "")
    return {
        "system": platform.platform(),
        "processor": f"{model or platform.machine()}, {os.cpu_count()} cores",
        "python": platform.python_version(),
        "commit": commit.stdout.strip() or "unknown",
        **{name: str(version) for name, version in installed_versions().items() if name != "python"},
    }


def carry_out(job: Job, out: Path, recorded: Mapping[str, str]) -> dict[str, Any]:
    """Run one job; its result, also in ``DIR/NAME/result.json``, which is written last."""
    folder = out / job.name
    folder.mkdir(parents=True, exist_ok=True)
    values = {OUT: str(folder), **recorded}
    arguments = going_on([_filled(part, values) for part in job.command])
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "OPENBLAS_NUM_THREADS": "1", "PYTHONUNBUFFERED": "1"}
    described = machine()
    before, began, used = _load(), perf_counter(), os.times()
    with (folder / "output.txt").open("w", encoding="utf-8") as output:
        done = subprocess.run(
            [sys.executable, *arguments],
            cwd=ROOT,
            env=environment,
            stdout=output,
            stderr=subprocess.STDOUT,
            check=False,
        )
    after = os.times()
    found = {
        "command": printed(job),
        "exit": done.returncode,
        "wall_s": perf_counter() - began,
        # of the process and of all that it waited for
        "processor_s": after.children_user + after.children_system - used.children_user - used.children_system,
        "load_before": before,
        "machine": described,
    }
    temporary = folder / ".result.json"
    temporary.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
    temporary.replace(folder / "result.json")
    return found


PRINTED = {TRACKS: "TRACKS", LOGS: "LOGS"}
"""Folders of recorded data in a command that a reader reads."""


def printed(job: Job) -> list[str]:
    """The command as a reader would write it, whatever the folders are called here."""
    own_command = job.command[:2] == ("-m", "gbt_ocp.cli")
    begin, rest = (["gbt-ocp"], job.command[2:]) if own_command else (["python"], job.command)
    return begin + [_filled(part, {f"{OUT}/../paper": "DIR", OUT: "DIR", **PRINTED}) for part in rest]


def _load() -> float:
    """Processes that wanted the processor in the last minute; 0 where the system does not say."""
    return os.getloadavg()[0] if hasattr(os, "getloadavg") else 0.0


def _filled(part: str, values: dict[str, str]) -> str:
    for mark, value in values.items():
        part = part.replace(mark, value)
    return part


def finished(job: Job, out: Path) -> dict[str, Any] | None:
    """The result of a job that has run, ``None`` where there is none that can be read."""
    try:
        found = json.loads((out / job.name / "result.json").read_text(encoding="utf-8"))
        return found if {"exit", "wall_s", "processor_s", "machine"} <= set(found) else None
    except (OSError, ValueError, TypeError):
        return None


def write_summary(out: Path) -> None:
    """Write ``DIR/summary.md`` from the results that there are."""
    rows, machines = [], {}
    for job in jobs():
        found = finished(job, out)
        if found is None:
            continue
        machines[json.dumps(found["machine"])] = found["machine"]
        times = f"{found['wall_s']:.1f} | {found['processor_s']:.1f} | {found['load_before']:.1f}"
        rows.append(f"| {job.name} | {found['exit']} | {times} | [output]({job.name}/output.txt) |")
    lines = ["# Everything that takes long", ""]
    for described in machines.values():
        lines += [", ".join(f"{name} {value}" for name, value in described.items()), ""]
    lines += ["| what | exit code | wall s | processor s | load before | |", "|---|---|---|---|---|---|", *rows]
    temporary = out / ".summary.md"
    temporary.write_text("\n".join(lines) + "\n", encoding="utf-8")
    temporary.replace(out / "summary.md")


def write_tables(job: Job, out: Path, data: Path) -> None:
    """Write the tables that a job printed, or left as Markdown, as ``DATA/NAME.json``; a job may have none."""
    folder = out / job.name
    texts = sorted(out.glob(job.tables)) if job.tables else [folder / "output.txt", *sorted(folder.rglob("*.md"))]
    if any(re.search(r"\| ?:?---", path.read_text(encoding="utf-8", errors="replace")) for path in texts):
        script = str(ROOT / "scripts" / "write_data.py")
        where = ["--name", job.name, "--result", str(folder / "result.json"), "--data", str(data)]
        where += ["--by-heading"] if job.by_heading else []
        subprocess.run([sys.executable, script, *map(str, texts), *where], check=True)


def listing() -> str:
    """Names, commands and times."""
    lines = []
    for job in jobs():
        minutes = "not measured" if job.minutes is None else f"{job.minutes:g} min"
        lines.append(f"{job.name:<28}{minutes:<14}python {' '.join(job.command)}")
    return "\n".join(lines)


def main(argv: Sequence[str] | None = None) -> int:
    """Run what is asked for; see the module."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--out", type=Path, help="folder of the results")
    parser.add_argument("--only", nargs="+", metavar="NAME", help="these alone")
    parser.add_argument("--tracks", metavar="FOLDER", default="", help="recorded tracks, CSV files with t,x,y")
    parser.add_argument("--logs", metavar="FOLDER", default="", help="recorded bearings, as gbt-ocp replay reads them")
    parser.add_argument("--data", type=Path, metavar="FOLDER", help="write the tables there too: docs/data")
    parser.add_argument("--quick", action="store_true", help="a tenth of the seeds, runs and problems")
    parser.add_argument("--list", action="store_true", help="show what there is")
    arguments = parser.parse_args(argv)
    if arguments.list:
        print(listing())
        return 0
    known = {job.name: job for job in jobs()}
    wrong = [name for name in arguments.only or () if name not in known]
    if wrong or arguments.out is None:
        print(f"found {', '.join(wrong) or 'no --out'}; allowed: --out DIR and names of --list", file=sys.stderr)
        return 2
    out = arguments.out.resolve()
    recorded = {TRACKS: arguments.tracks, LOGS: arguments.logs}
    chosen = [known[name] for name in arguments.only] if arguments.only else list(known.values())
    failed = []
    try:
        for job in chosen:
            before = finished(job, out)
            if before is not None and before["exit"] == 0:
                print(f"{job.name}: finished before", file=sys.stderr)
                continue
            missing = [f"--{PRINTED[key].lower()}" for key in PRINTED if key in job.command and not recorded[key]]
            if missing:
                print(f"{job.name}: needs {', '.join(missing)}, left out", file=sys.stderr)
                continue
            print(f"{job.name}: runs", file=sys.stderr, flush=True)
            found = carry_out(quick(job) if arguments.quick else job, out, recorded)
            print(f"{job.name}: exit code {found['exit']}, {found['processor_s']:.0f} s of processor", file=sys.stderr)
            write_summary(out)
            if arguments.data and not found["exit"] and not arguments.quick:
                write_tables(job, out, arguments.data.resolve())
            failed += [job.name] if found["exit"] else []
    except KeyboardInterrupt:
        print("interrupted; the same command goes on", file=sys.stderr)
        return 4
    if failed:
        print(f"not ended well: {', '.join(failed)}", file=sys.stderr)
    if (out / "summary.md").exists():
        print(out / "summary.md")
    return 1 if failed else 0


if __name__ == "__main__":
    raise SystemExit(main())
