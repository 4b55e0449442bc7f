import base64
import dataclasses
import io
import re
from html.parser import HTMLParser

import numpy as np
import pytest
import synthetic_run
from PIL import Image

from gbt_ocp.cli import main as cli
from gbt_ocp.experiments.result import Result
from gbt_ocp.reporting.run_report import write_report


def save(folder, dimension=2, **kind):
    history = synthetic_run.history(dimension, steps=150, **kind)
    result = Result(synthetic_run.configuration(dimension), history, synthetic_run.summary(history))
    return result.save(folder, figures=False), history


class Cells(HTMLParser):
    """Rows of all tables; complains of tags that are not closed."""

    def __init__(self, text):
        super().__init__()
        self.rows, self.open = [], []
        self.feed(text)
        assert self.open == []

    def handle_starttag(self, tag, attributes):
        if tag not in ("meta", "img"):
            self.open.append(tag)
        if tag == "tr":
            self.rows.append([])
        if tag in ("td", "th"):
            self.rows[-1].append("")

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if self.open and self.open[-1] in ("td", "th"):
            self.rows[-1][-1] += data


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.long
def test_the_page_has_the_run_in_it_and_loads_nothing(tmp_path, dimension):
    folder, history = save(tmp_path / "run", dimension)
    text = write_report(folder, tmp_path / "page.html").read_text(encoding="utf-8")
    assert not re.search(r"https?://|src='(?!data:)|href=(?!'#)|<script|@import|url\(", text)
    rows = Cells(text).rows
    found = {row[3]: row[0] for row in rows if len(row) == 4}
    summary = synthetic_run.summary(history)
    for key in ("error_settled", "distance_median", "violation_max"):
        assert float(found[key]) == pytest.approx(summary[key], rel=1e-3)
    assert found.keys() >= summary.keys() - {"versions", "fallbacks", "retries"}
    assert ["numpy", np.__version__] in rows
    assert "problem: made_up" in text
    pictures = re.findall(r"data:image/png;base64,([^']+)'", text)
    assert len(pictures) == 6
    for picture in pictures:
        assert Image.open(io.BytesIO(base64.b64decode(picture))).size[0] == 945  # 6.3 in at 150 dpi


def test_the_ledger_counts_what_the_solver_did(tmp_path):
    folder, history = save(tmp_path / "run")
    text = write_report(folder, tmp_path / "page.html").read_text(encoding="utf-8")
    rows = Cells(text).rows
    assert ["solved", "146", "96.7 %"] in rows
    assert ["Infeasible_Problem_Detected", "5", "3.31 %"] in rows
    assert ["shifted", "2"] in rows
    assert ["retries: nugget", "2"] in rows
    assert ["iterations", "17", "17", "17", "17", "17"] in rows
    (times,) = (row for row in rows if row[0] == "time of the solver, ms")
    assert float(times[2]) == pytest.approx(1e3 * np.median(history.solver_time), rel=1e-3)
    assert float(times[5]) == pytest.approx(140.0)
    assert "All 5 plans that were not solved" in text
    assert ["7.7", "Infeasible_Problem_Detected", "braking", "17", "140"] in rows
    assert ["12", "Infeasible_Problem_Detected", "none", "17", "140"] in rows


@pytest.mark.long
def test_times_of_a_long_run_keep_their_digits(tmp_path):
    history = synthetic_run.history(2, steps=150)
    history = dataclasses.replace(history, t=history.t + 86_400.0)
    result = Result(synthetic_run.configuration(2), history, synthetic_run.summary(history))
    text = write_report(result.save(tmp_path / "run", figures=False), tmp_path / "page.html").read_text(
        encoding="utf-8"
    )
    assert ["86407.7", "Infeasible_Problem_Detected", "braking", "17", "140"] in Cells(text).rows
    assert "86415 s in the plane" in text


def test_a_run_without_a_solver_has_a_page_too(tmp_path):
    folder, _ = save(tmp_path / "run", planner=False)
    text = write_report(folder, tmp_path / "page.html").read_text(encoding="utf-8")
    assert "Nothing was solved" in text
    Cells(text)


def test_what_a_user_wrote_is_text_and_no_markup(tmp_path):
    history = synthetic_run.history(2, steps=30)
    configuration = synthetic_run.StandInConfiguration(
        synthetic_run.configuration(2).text + "name: <script>alert(1)</script>\n"
    )
    status = history.solver_status.astype("U40").copy()
    status[4] = "<b>odd</b>"
    history = dataclasses.replace(history, solver_status=status)
    folder = Result(configuration, history, synthetic_run.summary(history)).save(tmp_path / "run", figures=False)
    text = write_report(folder, tmp_path / "page.html").read_text(encoding="utf-8")
    assert "<script" not in text
    assert "<b>" not in text


@pytest.mark.parametrize("command", ["report", "animate"])
@pytest.mark.long
def test_the_command_line_writes_into_the_run_folder_and_says_what_is_wrong(tmp_path, capsys, command):
    folder, _ = save(tmp_path / "run")
    name = {"report": "report.html", "animate": "animation.html"}[command]
    assert cli.main([command, str(folder)]) == 0
    assert capsys.readouterr().out == f"{folder / name}\n"
    assert (folder / name).is_file()
    assert Result.load(folder).history.t.size == 151  # still a run folder

    for arguments, says in (
        ([str(tmp_path)], f"RUN_DIR: found {tmp_path}, without config.yaml, history.npz, summary.json; allowed: "),
        ([str(folder), "--out", str(tmp_path / "page.txt")], f"--out: found {tmp_path / 'page.txt'}; allowed: "),
        ([str(folder), "--out", str(folder / "config.yaml" / "x.html")], "--out: "),
    ):
        assert cli.main([command, *arguments]) == 2
        out, err = capsys.readouterr()
        assert out == ""
        assert err.startswith(says)
        assert len(err.splitlines()) == 1
    (folder / "history.npz").write_bytes(b"broken")
    assert cli.main([command, str(folder)]) == 2
    assert capsys.readouterr().err.startswith(f"RUN_DIR: {folder / 'history.npz'}: not a history")
