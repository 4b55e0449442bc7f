"""The one command that runs everything long: nothing is forgotten, what is finished is kept."""

import importlib.util
import json
import re
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]


@pytest.fixture
def everything():
    spec = importlib.util.spec_from_file_location("everything", ROOT / "scripts" / "everything.py")
    module = importlib.util.module_from_spec(spec)
    sys.modules["everything"] = module
    spec.loader.exec_module(module)
    yield module
    del sys.modules["everything"]


def test_every_benchmark_and_every_file_with_slow_tests_is_listed(everything):
    run = {Path(job.command[0]).stem for job in everything.BENCHMARKS if job.command[0].startswith("benchmarks/")}
    there = {path.stem for path in (ROOT / "benchmarks").glob("*.py")}
    assert run | everything.PARTS == there
    assert not run & everything.PARTS
    for part in everything.PARTS:  # nobody could run them
        assert "__main__" not in (ROOT / "benchmarks" / f"{part}.py").read_text(encoding="utf-8")
    names = [job.name for job in everything.jobs()]
    assert len(set(names)) == len(names)
    assert {"test_generated_c", "test_faults", "test_fuzzed_configurations"} <= set(names)


def test_every_file_of_data_is_of_a_job_that_makes_it_again(everything):
    made = {path.stem for path in (ROOT / "docs" / "data").glob("*.json")}
    assert made <= {job.name for job in everything.jobs()}


def test_options_are_those_of_the_scripts(everything):
    for job in everything.BENCHMARKS:
        if job.command[0].startswith("benchmarks/"):
            text = (ROOT / job.command[0]).read_text(encoding="utf-8")
            for option in (part for part in job.command[1:] if part.startswith("--")):
                assert f'"{option}"' in text, job
            for option in re.findall(r'"(--[a-z-]+)"[^\n]*required=True', text):
                assert option in job.command, job


def test_a_tenth_of_all_counts_is_quick(everything):
    for job in everything.BENCHMARKS:
        shorter = everything.quick(job).command
        for option, full, few in zip(job.command, job.command[1:], shorter[1:], strict=False):
            expected = str(max(1, round(int(full) / 10))) if option in everything.COUNTS else full
            assert few == expected, job
    (scenarios,) = (everything.quick(job) for job in everything.BENCHMARKS if job.name == "public_scenarios")
    assert "--quick" in scenarios.command


def test_the_command_is_said_without_the_folders_of_this_machine(everything):
    said = {job.name: " ".join(everything.printed(job)) for job in everything.BENCHMARKS}
    assert said["fig4"] == "gbt-ocp reproduce fig4 --runs 10 --out DIR --quiet"
    assert said["recorded_tracks"] == "python benchmarks/recorded_tracks.py TRACKS --seeds 3"


def test_a_study_of_the_paper_goes_on_in_its_folder(everything, tmp_path):
    begun = ["-m", "gbt_ocp.cli", "reproduce", "all", "--out", str(tmp_path)]
    assert everything.going_on(begun)[-2:] == ["--resume", str(tmp_path)]
    assert everything.going_on([*begun[:-1], str(tmp_path / "new")])[-2] == "--out"


def test_what_is_finished_is_kept_and_what_failed_is_run_again(everything, tmp_path, monkeypatch, capsys):
    marks = tmp_path / "marks"
    script = "import pathlib, sys; p = pathlib.Path(sys.argv[1]); p.open('a').write(sys.argv[2]); print('said')"
    good = everything.Job("good", ("-c", script, str(marks), "g"))
    bad = everything.Job("bad", ("-c", f"{script}; sys.exit(int(p.read_text().count('b') < 2))", str(marks), "b"))
    boats = everything.Job("boats", ("-c", script, everything.TRACKS, "t"))
    monkeypatch.setattr(everything, "jobs", lambda: [good, bad, boats])
    out = tmp_path / "out"
    assert everything.main(["--out", str(out)]) == 1
    assert marks.read_text() == "gb"
    assert "boats: needs --tracks, left out" in capsys.readouterr().err
    assert (out / "good" / "output.txt").read_text() == "said\n"
    result = json.loads((out / "good" / "result.json").read_text())
    assert result["exit"] == 0
    assert result["command"] == ["python", "-c", script, str(marks), "g"]
    assert 0.0 < result["processor_s"] < 60.0
    assert result["machine"]["python"].startswith("3.")
    summary = (out / "summary.md").read_text()
    assert "| good | 0 |" in summary
    assert "| bad | 1 |" in summary
    (out / "good" / "result.json").write_text("{")  # a damaged result counts as none
    assert everything.main(["--out", str(out)]) == 0
    assert marks.read_text() == "gbgb"
    assert everything.main(["--out", str(out), "--only", "boats", "--tracks", str(marks)]) == 0
    assert marks.read_text() == "gbgbt"
    assert everything.main(["--out", str(out), "--only", "nobody"]) == 2
    assert everything.main(["--list"]) == 0
    assert capsys.readouterr().out.splitlines()[-1].startswith("boats")


def test_tables_that_a_job_printed_become_data(everything, tmp_path, monkeypatch):
    table = everything.Job("table", ("-c", "print('# Errors\\n\\n| case | m |\\n|---|---|\\n| 1 | 0.5 |')"))
    plain = everything.Job("plain", ("-c", "print('no table')"))
    monkeypatch.setattr(everything, "jobs", lambda: [table, plain])
    assert everything.main(["--out", str(tmp_path / "out"), "--data", str(tmp_path / "data")]) == 0
    assert [path.name for path in (tmp_path / "data").iterdir()] == ["table.json"]
    found = json.loads((tmp_path / "data" / "table.json").read_text(encoding="utf-8"))
    assert found["tables"] == {"errors": {"columns": ["case", "m"], "rows": [["1", "0.5"]]}}
    assert found["commit"] == everything.machine()["commit"]


def test_tables_in_a_folder_that_jobs_share_become_data_of_each(everything, tmp_path, monkeypatch):
    script = "import pathlib, sys; p = pathlib.Path(sys.argv[1]); p.mkdir(parents=True); "
    script += "(p / 'x.md').write_text(sys.argv[2])"
    jobs = [
        everything.Job(
            name, ("-c", script, f"{everything.OUT}/../paper/{name}", f"# {name}\n\n| a |\n|---|\n| 1 |\n"),
            tables=f"paper/{name}/*.md",
        )
        for name in ("one", "two")
    ]  # fmt: skip
    monkeypatch.setattr(everything, "jobs", lambda: jobs)
    assert everything.main(["--out", str(tmp_path / "out"), "--data", str(tmp_path / "data")]) == 0
    for name in ("one", "two"):
        found = json.loads((tmp_path / "data" / f"{name}.json").read_text(encoding="utf-8"))
        assert list(found["tables"]) == [name]
