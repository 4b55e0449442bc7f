"""Standard output and error in every state: closed, full, without a reader, of an encoding without Greek letters."""

import io
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from gbt_ocp.cli import main as cli
from gbt_ocp.cli.output import show
from gbt_ocp.experiments.config.json_schema import json_schema
from gbt_ocp.experiments.config.loading import load_config
from gbt_ocp.simulation.history import History

ROOT = Path(__file__).parents[1]


def called(*arguments, **streams):
    """The program in a process of its own."""
    return subprocess.run(
        [sys.executable, "-m", "gbt_ocp.cli", *arguments],
        cwd=ROOT,
        stderr=subprocess.PIPE,
        text=True,
        check=False,
        **streams,
    )


@pytest.mark.parametrize("encoding", ["ascii", "latin-1", "cp1252", "utf-8", "utf-16"])
def test_the_schema_is_json_in_every_encoding_of_standard_output(monkeypatch, encoding):
    stream = io.TextIOWrapper(io.BytesIO(), encoding=encoding)
    monkeypatch.setattr(sys, "stdout", stream)
    assert cli.main(["schema"]) == 0
    assert json.loads(stream.buffer.getvalue().decode(encoding)) == json_schema()


def test_signs_that_standard_output_has_not_are_escaped(monkeypatch):
    stream = io.TextIOWrapper(io.BytesIO(), encoding="ascii")
    monkeypatch.setattr(sys, "stdout", stream)
    show("|ν| <= 1 °")
    assert stream.buffer.getvalue() == rb"|\u03bd| <= 1 \xb0" + os.linesep.encode()


@pytest.mark.parametrize("arguments", [["schema"], ["list"], ["completion", "bash"]])
def test_a_closed_standard_output_is_one_line(capsys, monkeypatch, arguments):
    monkeypatch.setattr(sys, "stdout", None)
    assert cli.main(arguments) == 2
    assert capsys.readouterr().err == "standard output: found it closed; allowed: a terminal, a pipe or a file\n"


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no device that is always full")
def test_a_full_standard_output_is_one_line():
    with Path("/dev/full").open("w") as full:
        done = called("schema", stdout=full)
    assert done.returncode == 2
    assert done.stderr.startswith("standard output: found a file that cannot be written (No space left on device)")
    assert len(done.stderr.splitlines()) == 1


CLOSED = """
import os, sys
for descriptor in map(int, sys.argv[1]):
    os.close(descriptor)
os.execv(sys.executable, [sys.executable, "-m", "gbt_ocp.cli", *sys.argv[2:]])
"""


@pytest.mark.skipif(os.name != "posix", reason="descriptors of POSIX")
@pytest.mark.parametrize(("closed", "code"), [("012", 2), pytest.param("2", 0, marks=pytest.mark.slow)])
def test_streams_that_the_caller_closed_take_no_file_of_the_run(tmp_path, closed, code):
    """IPOPT prints to descriptor 1, which would be whichever file was opened first."""
    arguments = ["run", "case2", "--no-figures", "--out", str(tmp_path / "out"), "--set", "duration_s=0.2"]
    arguments += ["planner.solver=ipopt", "planner.solver_options={print_level: 5}"]
    done = subprocess.run(
        [sys.executable, "-c", CLOSED, closed, *arguments],
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == code, done.stderr
    assert "Traceback" not in done.stderr
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["config.yaml", "history.npz", "summary.json"]
    assert len(History.load_npz(tmp_path / "out" / "history.npz").t) == 3
    assert load_config(tmp_path / "out" / "config.yaml").planner.solver == "ipopt"


def test_a_reader_that_leaves_early_is_no_fault():
    reader, writer = os.pipe()
    os.close(reader)
    done = called("schema", stdout=writer)
    os.close(writer)
    assert (done.returncode, done.stderr) == (0, "")
