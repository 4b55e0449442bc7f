"""The pages about the pilot: their programs and commands run, and their tables are those of the code."""

import re
from dataclasses import fields
from pathlib import Path
from typing import get_args

import pytest

from gbt_ocp.cli.main import main
from gbt_ocp.pilot import PilotHealth
from gbt_ocp.pilot.own_track import Received
from gbt_ocp.pilot.pilot_health import NOTES

PAGES = Path(__file__).resolve().parents[1] / "docs" / "howto"


def text_of(page):
    return (PAGES / page).read_text(encoding="utf-8")


def program(page):
    (found,) = re.findall(r"^```python\n(.*?)^```$", text_of(page), re.MULTILINE | re.DOTALL)
    return found


def first_cells(page, heading):
    rows = text_of(page).split(f"| {heading} |", 1)[1].split("\n\n")[0]
    return re.findall(r"^\| (.*?) \|", rows, re.MULTILINE)


@pytest.mark.long
def test_twenty_lines_give_the_error_of_a_run(capsys):
    lines = program("simulator.md")
    assert len([line for line in lines.splitlines() if line]) <= 20
    exec(compile(lines, "simulator.md", "exec"), {})
    online, run = map(float, capsys.readouterr().out.split())
    assert abs(online - run) <= 1e-9
    assert 0.0 < run < 0.2


def test_the_vehicle_in_the_loop_is_recorded_and_goes_on(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    names = {}
    exec(compile(program("in_the_loop.md"), "in_the_loop.md", "exec"), names)
    assert names["command"].health.received["no navigation"] > 0  # those of before the first navigation
    assert names["command"].health.bearing_age < 1.0
    assert main(["replay", "dive.jsonl", "--quiet"]) == 0
    assert "70 of 70 answers the same" in capsys.readouterr().out
    assert main(["replay", "dive-2.jsonl", "--quiet"]) == 0


def test_each_note_and_value_of_health_is_on_its_page():
    assert [cell.strip("`") for cell in first_cells("health.md", "note")] == list(NOTES)
    shown = re.findall(r"`(\w+)`", " ".join(first_cells("health.md", "value")))
    assert shown == [one.name for one in fields(PilotHealth) if one.name != "notes"]


def test_each_answer_is_on_the_page_about_order():
    table = text_of("simulator.md").split("## In which order")[1]
    for word in set(get_args(Received)) - {"refused"}:
        assert f"`{word}`" in table
