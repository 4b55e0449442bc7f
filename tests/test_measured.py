"""Pages are rendered from docs/data: nothing quoted is missing, and what is wrong is refused by name."""

import importlib.util
import json
import re
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PAGES = sorted((ROOT / "docs").rglob("*.md"))


def module_of(path):
    spec = importlib.util.spec_from_file_location(path.stem, path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


measured = module_of(ROOT / "docs" / "measured.py")
write_data = module_of(ROOT / "scripts" / "write_data.py")


def test_pages_quote_what_there_is_and_no_file_is_unused():
    text = "\n".join(path.read_text(encoding="utf-8") for path in PAGES)
    for path in PAGES:
        shown = measured.rendered(path.read_text(encoding="utf-8"))
        assert not re.search(r"\{\{\s*data", shown), path
    assert {name for name, *_ in measured.PLACEHOLDER.findall(text)} == set(measured.names())


@pytest.mark.parametrize(
    ("quoted", "says"),
    [
        ("data.no_such.thing", "found no docs/data/no_such.json"),
        ("data.fig9.no_such", "found no such key; allowed: coregionalised_and_plain_process"),
        ("data.closed_loop.whole_run[7, allowed]", "found 0 rows and 1 columns"),
        ("data.closed_loop.whole_run[1, no such]", "found 1 rows and 0 columns"),
        ("data.closed_loop.settled[1, worst seed]", "found 1 rows and 3 columns"),
    ],
)
def test_a_page_that_quotes_a_missing_key_is_refused(quoted, says):
    with pytest.raises(measured.MissingError, match=re.escape(says)):
        measured.rendered(f"as in {{{{ {quoted} }}}}")


def test_a_cell_and_a_table_are_those_of_the_file():
    table = measured.read("comparison_sea")["tables"]["table_at_a_distance"]
    (row,) = (row for row in table["rows"] if row[:2] == ["sea3d", "hard"])
    quoted = "{{ data.comparison_sea.table_at_a_distance[sea3d / hard, least range m] }}"
    assert measured.rendered(quoted) == row[table["columns"].index("least range m")]
    plans = "{{ data.comparison_sea.table_at_a_distance[sea3d / hard, plans] }}"
    said = f"of\n{row[table['columns'].index('plans')]}\\. So"
    assert measured.rendered(f"of\n{plans}. So") == said, "no list begins"
    peers = measured.read("shooting_peers")["tables"]["recorded_steps_case2_p_5_hard"]
    (row,) = (row for row in peers["rows"] if row[0] == "this package, held thrust")
    quoted = "{{ data.shooting_peers.recorded_steps_case2_p_5_hard[this package, held thrust, objective, mean] }}"
    assert measured.rendered(quoted) == row[peers["columns"].index("objective, mean")], "commas on both sides"
    shown = measured.rendered("{{ data.comparison_sea.table_at_a_distance }}")
    assert write_data.tables_in(shown) == {"table": table}
    folded = measured.rendered('??? note "All"\n\n    {{ data.comparison_sea.table_at_a_distance }}\n').splitlines()[2:]
    assert [line.removeprefix("    ") for line in folded] == shown.splitlines()


@pytest.mark.parametrize("name", measured.names())
def test_every_file_says_how_it_was_made(name):
    found = json.loads((measured.DATA / f"{name}.json").read_text(encoding="utf-8"))
    assert set(measured.ABOUT) <= set(found)
    assert all(found[about] for about in measured.ABOUT)
    for table in found["tables"].values():
        assert all(len(row) == len(table["columns"]) for row in table["rows"])
        assert table["rows"]


def test_the_list_of_ages_counts_commits():
    ages = measured.ages()
    for name in measured.names():
        assert f"| `{name}` |" in ages
    done = subprocess.run(["git", "-C", str(ROOT), "rev-parse", "HEAD~3"], capture_output=True, text=True, check=False)
    if done.returncode:
        pytest.skip("a copy without its history")
    between = subprocess.run(
        ["git", "-C", str(ROOT), "log", "--format=%h", "HEAD~3..HEAD"], capture_output=True, text=True, check=True
    )
    assert measured.age(done.stdout.strip()).startswith(f"{len(between.stdout.split())} commits (")
    changed = subprocess.run(
        ["git", "-C", str(ROOT), "log", "--format=", "--name-only", "HEAD~3..HEAD"],
        capture_output=True,
        text=True,
        check=True,
    )
    of_package = any(line.startswith(("gbt_ocp/", "problems/", "configs/")) for line in changed.stdout.split())
    assert measured.age(done.stdout.strip()).endswith("none of the package") is not of_package
    assert "does not have" in measured.age("0" * 40)


def test_data_is_written_from_what_a_command_printed(tmp_path):
    result = {
        "command": ["python", "benchmarks/x.py", "--seeds", "4"],
        "load_before": 0.5,
        "machine": {"system": "Linux", "processor": "one, 2 cores", "python": "3.11", "commit": "abc", "numpy": "2.1"},
    }
    printed = "# Errors\n\n| case | m |\n|---|---|\n| 1 | 0.5 |\n| 2 \\| 3 | 1 |\n\nmore\n\n| a |\n|:-:|\n| b |\n"
    path = tmp_path / "data" / "x.json"
    write_data.write(path, write_data.described(write_data.tables_in(printed), result))
    found = json.loads(path.read_text(encoding="utf-8"))
    assert found["tables"] == {
        "errors": {"columns": ["case", "m"], "rows": [["1", "0.5"], ["2 \\| 3", "1"]]},
        "more": {"columns": ["a"], "rows": [["b"]]},
    }
    assert (found["commit"], found["seeds"]) == ("abc", "0 to 3")
    report = "## Findings\n\n- **holds**: It is small. Seen: 0.1 m.\n- **does not hold**: It is 1 | 2. Seen: 3.\n"
    assert write_data.tables_in(report) == {
        "findings": {
            "columns": ["asked", "seen", "verdict"],
            "rows": [["It is small.", "0.1 m.", "holds"], ["It is 1 \\| 2.", "3.", "does not hold"]],
        }
    }
    bar = "sea2d:  50%|#####     | 2/4 [00:01<00:01]\n\n" + printed.partition("\n\n")[2]
    assert list(write_data.tables_in(bar)) == ["table", "more"]
    cut = "| case | m |\n|---|---|\nsea2d: 100%|#####| 4/4 [00:02<00:00]\n| 100% | 0.5 |\n"
    assert write_data.tables_in(cut) == {"table": {"columns": ["case", "m"], "rows": [["100%", "0.5"]]}}
    assert found["command"] == ["python benchmarks/x.py --seeds 4"]
    assert found["versions"] == {"python": "3.11", "numpy": "2.1"}


def test_a_table_without_rows_is_refused_and_not_written(tmp_path, capsys):
    """As of a run that was stopped before its first row."""
    (tmp_path / "output.txt").write_text("| case | m |\n|---|---|\nsweep: 100%\n", encoding="utf-8")
    with pytest.raises(SystemExit):
        write_data.main(
            [str(tmp_path / "output.txt"), "--name", "half", "--result", "none", "--data", str(tmp_path / "data")]
        )
    assert "found a table 'table' without rows" in capsys.readouterr().err
    assert not (tmp_path / "data").exists()


def test_a_table_goes_on_after_what_was_printed_into_it():
    """Bars of sweeps, some after an empty line, and warnings: no row is lost, and one of another table is refused."""
    bar, warning = "\nsweep: 100%|####| 60/60\n", "x.py:3: RuntimeWarning: overflow\n  y = x**2\n"
    found = write_data.tables_in(
        f"| case | m |\n|---|---|\n{bar}| 1 | 0.5 |\n{bar}| 2 | 0.7 |\n{warning}{bar}| 3 | 0.9 |\n"
    )
    assert found == {"table": {"columns": ["case", "m"], "rows": [["1", "0.5"], ["2", "0.7"], ["3", "0.9"]]}}
    for wrong in ("| 1 | 2 |\n", f"| case | m |\n|---|---|\n| 1 | 0.5 |\n{warning}| 1 | 2 | 3 |\n"):
        with pytest.raises(ValueError, match=r"found a row of \d cells that belongs to no table: \| 1"):
            write_data.tables_in(wrong)
