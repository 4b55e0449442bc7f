"""Every file of every folder damaged in turn: one line and exit code 2, or the damaged piece is made again."""

import shutil
from collections import Counter
from functools import partial
from pathlib import Path

import pytest
import synthetic_run
from damage import damage, damages, files, repair
from small_folders import begin, go_on, little_to_do, result

from gbt_ocp.cli import main as cli
from gbt_ocp.experiments.result import Result


@pytest.fixture(scope="module", autouse=True)
def small():
    with little_to_do():
        yield


class Kept:
    """A folder of a kind, with the command that takes it up, and what must be the same when that is done."""

    def __init__(self, folder, result, *commands):
        self.folder, self.result, self.commands = folder, result, commands
        self.whole = folder.with_name(f"{folder.name}-whole")
        shutil.copytree(folder, self.whole)

    def everything(self):
        """All damages: the command, the file, and how."""
        return [
            (command, name, how)
            for command in self.commands
            for name in files(self.whole)
            for how in damages(self.whole / name)
        ]

    def outcome(self, command, name, how, capsys, seed=0):
        """Damage, give the command, judge what happened; the word for it."""
        repair(self.folder, self.whole)
        damage(self.folder / name, how, seed)
        capsys.readouterr()
        code = cli.main(command)
        told = capsys.readouterr().err
        case = f"{command[0]}, {name}, {how}: exit code {code}\n{told}"
        assert "Traceback" not in told, case
        assert code in (0, 2), case
        if code == 2:
            assert Path(name).name in told, case
            assert len(told.splitlines()) == 1, case
            return "refused"
        assert self.result(self.folder) == self.result(self.whole), case
        if told:
            assert "again" in told, case
            assert name.split("/")[-2] in told, case
        return "made again" if told else "not needed"

    def outcomes(self, chosen, capsys, seeds=(0,)):
        found = Counter()
        for command, name, how in chosen:
            for seed in seeds if how in ("random", "flipped") else (0,):
                found[self.outcome(command, name, how, capsys, seed)] += 1
        return dict(found)


def run_folder(parent):
    history = synthetic_run.history(steps=12)
    folder = Result(synthetic_run.configuration(2), history, synthetic_run.summary(history)).save(parent / "run")
    page = str(parent / "page.html")
    commands = (["report", str(folder), "--out", page], ["animate", str(folder), "--out", page])
    return Kept(folder, lambda _: Path(page).read_text()[:20], *commands)


def taken_up(kind):
    def make(parent):
        folder = parent / kind
        assert cli.main(begin(kind, folder)) == 0
        return Kept(folder, partial(result, kind), go_on(kind, folder))

    return make


FOLDERS = {"run": run_folder, **{kind: taken_up(kind) for kind in ("sweep", "reproduce", "compare")}}


@pytest.fixture(scope="module")
def kept(request, tmp_path_factory):
    return FOLDERS[request.param](tmp_path_factory.mktemp(request.param))


FEW = {"run": 11, "sweep": 17, "reproduce": 17, "compare": 29}
"""Of so many damages the short form tries one; the numbers are primes, so that files and ways of damage mix."""


@pytest.mark.parametrize("kept", FOLDERS, indirect=True, ids=FOLDERS)
@pytest.mark.long
def test_a_damaged_file_is_named_or_made_again(kept, request, monkeypatch, capsys):
    step = FEW[request.node.callspec.id]
    chosen = kept.everything()
    if kept.folder.name == "compare":  # figures cost more than all the rest; the long form draws them
        monkeypatch.setattr("gbt_ocp.studies.limits.report.write_report", lambda *_: None)
        chosen = [each for each in chosen if not each[1].startswith(("figures", "report"))]
    found = kept.outcomes(chosen[::step], capsys)
    assert sum(found.values()) >= 4
    assert len(found) >= 2


@pytest.mark.slow
@pytest.mark.parametrize("kept", FOLDERS, indirect=True, ids=FOLDERS)
def test_every_damage_to_every_file(kept, request, capsys):
    found = kept.outcomes(kept.everything(), capsys, seeds=range(5))
    with capsys.disabled():
        print(f"\n{request.node.callspec.id}: {sum(found.values())} damages, {found}")
    assert len(found) >= 2
