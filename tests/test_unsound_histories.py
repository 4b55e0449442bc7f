"""Histories of NaN, archives and YAML that unpack to far more than their size: drawn, or a line that names the file."""

import dataclasses
import itertools
import zipfile

import numpy as np
import pytest
import synthetic_run

from gbt_ocp import files
from gbt_ocp.cli import main as cli
from gbt_ocp.experiments.result import Result
from gbt_ocp.simulation.columns import columns
from gbt_ocp.simulation.history import History

NUMBERS = [one.name for one in columns(History) if one.kind is float]
REFUSED = {"t", "vehicle_pose", "target"}


def spoilt(folder, names, value, dimension=2):
    """A run folder whose arrays of these names hold nothing but one value."""
    history = synthetic_run.history(dimension, steps=12)
    result = Result(synthetic_run.configuration(dimension), history, synthetic_run.summary(history))
    result.save(folder, figures=False)
    arrays = {one.name: getattr(history, one.name) for one in columns(History)}
    np.savez(folder / "history.npz", **{**arrays, **{name: np.full_like(arrays[name], value) for name in names}})
    return folder


def answer(folder, command, capsys):
    """Whether the command refuses the folder, with one line that names the history."""
    name = {"report": "report.html", "animate": "animation.html"}[command]
    code = cli.main([command, str(folder)])
    out, err = capsys.readouterr()
    if code == 0:
        assert (folder / name).stat().st_size > 10_000
        assert err == ""
        return False
    assert code == 2
    assert out == ""
    assert not (folder / name).exists()
    assert len(err.splitlines()) == 1, err
    assert err.startswith(f"RUN_DIR: {folder / 'history.npz'}: "), err
    return True


@pytest.mark.parametrize("command", ["report", "animate"])
@pytest.mark.parametrize(
    "names", [["t"], ["vehicle_pose"], ["target"], ["forecast_mean", "forecast_cov", "error", "bound"], NUMBERS]
)
def test_a_history_of_nan_is_drawn_or_named(tmp_path, capsys, names, command):
    folder = spoilt(tmp_path / "run", names, np.nan)
    assert answer(folder, command, capsys) == bool(REFUSED & set(names))


@pytest.mark.slow
@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 0.0])
def test_every_array_in_turn_is_drawn_or_named(tmp_path, capsys, dimension, value):
    for name, command in itertools.product(NUMBERS, ["report", "animate"]):
        folder = spoilt(tmp_path / f"{name}-{command}", [name], value, dimension)
        refused = name == "t" if value == 0.0 else name in REFUSED
        assert answer(folder, command, capsys) == refused, (name, command)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda t: np.where(t > 1.05, np.nan, t), r"t: found nan at step 11; allowed: times that increase"),
        (lambda t: np.where(t > 1.05, 0.5, t), r"t: found 0\.5 at step 11"),
        (lambda t: t[::-1], r"t: found 1\.1\d* at step 1"),
    ],
)
def test_times_that_do_not_increase_are_refused_where_they_do_not(tmp_path, change, says):
    history = synthetic_run.history(2, steps=12)
    with pytest.raises(ValueError, match=says):
        dataclasses.replace(history, t=change(history.t))


def test_a_configuration_of_nested_aliases_is_refused_at_once(tmp_path, capsys):
    folder = spoilt(tmp_path / "run", [], 0.0)
    path = folder / "config.yaml"
    nested = ["a0: &a0 {x: 1}", *(f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 9)}]" for i in range(1, 10))]
    text = path.read_text(encoding="utf-8")
    path.write_text("\n".join([text, *nested]), encoding="utf-8")
    for command in ("report", "animate"):
        assert cli.main([command, str(folder)]) == 2
        assert capsys.readouterr().err.startswith(f"RUN_DIR: {path}: not valid YAML: found an alias; allowed: values")
    with pytest.raises(ValueError, match="found an alias"):
        Result.load(folder)
    path.write_text(text + "name: 3 * 4 and R&D\n", encoding="utf-8")
    assert Result.load(folder).configuration.name == "3 * 4 and R&D"


def bomb(path, array, megabytes):
    """An archive of a history whose one array holds so many zeros, which shrink to a thousandth."""
    history = synthetic_run.history(2, steps=12)
    history.save_npz(path)
    whole = {one.name: getattr(history, one.name) for one in columns(History)}
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, values in whole.items():
            with archive.open(f"{name}.npy", "w", force_zip64=True) as stream:
                if name != array:
                    np.lib.format.write_array(stream, values)
                    continue
                header = {"descr": "<f8", "fortran_order": False, "shape": (megabytes * 2**17,)}
                np.lib.format.write_array_header_1_0(stream, header)
                for _ in range(megabytes):
                    stream.write(bytes(2**20))


@pytest.mark.parametrize("command", ["report", "animate"])
def test_an_archive_that_unpacks_to_far_more_than_its_size_is_refused(tmp_path, capsys, monkeypatch, command):
    monkeypatch.setattr(files, "UNPACKED", 2**23)
    folder = spoilt(tmp_path / "run", [], 0.0)
    bomb(folder / "history.npz", "objective", 64)
    assert (folder / "history.npz").stat().st_size < 2**18
    read = []
    monkeypatch.setattr(np.lib.npyio.NpzFile, "__getitem__", lambda archive, name: read.append(name))
    assert answer(folder, command, capsys)
    assert read == []  # nothing is unpacked to find out


def test_the_limit_spares_what_runs_leave(tmp_path, monkeypatch):
    """A run of a still target seen by nobody: no array shrinks more, and it is far from the limit."""
    monkeypatch.setattr(files, "UNPACKED", 0)
    history = synthetic_run.history(2, steps=3000, planner=False, tuned=False)
    still = {
        one.name: np.full_like(array, np.nan if one.name == "bearing" else 0.0)
        for one in columns(History)
        if one.kind is float and one.name not in ("t", "tracker_time")
        for array in [getattr(history, one.name)]
    }
    dataclasses.replace(history, **still).save_npz(tmp_path / "history.npz")
    assert len(History.load_npz(tmp_path / "history.npz").t) == 3001
