"""Two live processes that want the same folder: one does the work, the other is refused in a line or writes beside."""

import os

import pytest
from damage import files
from processes import forked
from small_folders import KINDS, begin, go_on, little_to_do, result
from test_run_folder import result as made_up

from gbt_ocp.cli import folders
from gbt_ocp.cli import main as cli
from gbt_ocp.experiments.sweep import execution
from gbt_ocp.experiments.sweep.sweep_plan import plan_sweep
from gbt_ocp.files import FolderBusyError, alone_in, whole_folder

pytestmark = pytest.mark.skipif(os.name != "posix", reason="forks processes")


@pytest.fixture(scope="module", autouse=True)
def small():
    with little_to_do():
        yield


def test_a_folder_is_held_by_one_and_released_at_the_end(tmp_path):
    with alone_in(tmp_path):
        with pytest.raises(FolderBusyError, match="another process at work in it"), alone_in(tmp_path):
            pass
        assert list(tmp_path.iterdir()) == []
    with alone_in(tmp_path):
        pass


@pytest.mark.parametrize("kind", KINDS[1:])
def test_a_folder_in_which_another_is_at_work_is_refused_and_left_alone(tmp_path, capsys, kind):
    folder = tmp_path / kind
    folder.mkdir()
    if kind == "sweep":
        folder.rmdir()
        assert cli.main(begin(kind, folder)) == 0
    before = {name: (folder / name).read_bytes() for name in files(folder)}
    capsys.readouterr()
    with alone_in(folder):
        assert cli.main(go_on(kind, folder)) == 2
    told = capsys.readouterr().err
    assert told == f"{folder}: found another process at work in it; allowed: one at a time (wait for its end)\n"
    assert {name: (folder / name).read_bytes() for name in files(folder)} == before


def test_a_run_that_a_worker_of_a_killed_sweep_finishes_meanwhile_is_taken(tmp_path, monkeypatch):
    folder = tmp_path / "sweep"
    whole = execution.whole_folder

    def slower(target):
        with whole(target) as other:
            (other / "config.yaml").write_text("theirs")
        return whole(target)

    monkeypatch.setattr(execution, "whole_folder", slower)
    (run,) = plan_sweep("case1", runs=1, overrides=["duration_s=0.2", "guidance.kind=random"]).runs()
    assert execution.execute(run, folder) is True
    assert (folder / "000000" / "config.yaml").read_text() == "theirs"


def at_once(kind, tmp_path, count):
    """Start the same command so many times; the exit codes, what was told, and the folder."""
    folder = tmp_path / "here"
    there = [forked(begin(kind, folder), tmp_path / f"errors{number}") for number in range(count)]
    codes = [process.wait() for process in there]
    return folder, codes, [process.told for process in there]


def judged(kind, tmp_path, count):
    """Start, judge, and say how many of the processes did the work."""
    whole = tmp_path / "whole"
    alone = forked(begin(kind, whole), tmp_path / "errors")
    usual = alone.wait()
    assert usual in (0, 3), alone.told
    folder, codes, told = at_once(kind, tmp_path, count)
    case = f"{kind}: {codes}, {told}"
    assert "Traceback" not in "".join(told), case
    assert set(codes) <= {usual, 2}, case
    assert usual in codes, case
    for code, text in zip(codes, told, strict=True):
        assert len(text.splitlines()) == (1 if code == 2 or usual == 3 else 0), case
    beside = [folder.with_name(f"here-{number}") for number in range(2, count + 1)]
    places = [folder, *(place for place in beside if place.exists())]
    for place in places:
        assert result(kind, place) == result(kind, whole), case
        assert not list(place.rglob(".*")), case
    if kind == "run":  # one that comes when the folder is full runs nothing; what has been run is kept
        early = sum("which is not an empty folder" in text for text in told)
        assert len(places) == count - early, case
    left = {path.name for path in tmp_path.iterdir() if not path.name.startswith("errors")}
    assert left == {"whole", *(place.name for place in places)}, case
    return codes.count(usual)


@pytest.mark.parametrize("kind", ["run", "sweep"])
def test_processes_at_once_lose_nothing(tmp_path, kind):
    assert judged(kind, tmp_path, 3 if kind == "run" else 2) == 1


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_processes_at_once_lose_nothing_time_and_again(tmp_path, kind):
    for turn in range(5):
        (tmp_path / str(turn)).mkdir()
        done = judged(kind, tmp_path / str(turn), 3)
        # a comparison that is there whole is made again out of its parts
        assert done == 1 or kind == "compare"


def test_runs_that_come_too_late_each_find_a_place(tmp_path, monkeypatch, capsys):
    """Another run takes the very name that was just found free."""
    taken = []
    free = folders.beside

    def slow(folder):
        found = free(folder)
        if len(taken) < 2:
            taken.append(found)
            with whole_folder(found) as temporary:
                (temporary / "theirs").touch()
        return found

    monkeypatch.setattr(folders, "beside", slow)
    (tmp_path / "asked").mkdir()
    (tmp_path / "asked" / "theirs").touch()
    place, drawn = folders.save_somewhere(made_up(), tmp_path / "asked", figures=False)
    assert (place, drawn) == (tmp_path / "asked-4", True)
    assert (place / "summary.json").is_file()
    assert [path.name for path in taken] == ["asked-2", "asked-3"]
    assert f"the results are in {place}" in capsys.readouterr().err
