"""SIGINT and SIGKILL at random moments: what is there is whole, what was finished is kept, the rest is made good."""

import json
import os
import signal
import time
from collections import Counter

import numpy as np
import pytest
from damage import files
from processes import forked, started
from small_folders import KINDS, begin, finished, go_on, little_to_do, result

from gbt_ocp.files import PARTIAL
from gbt_ocp.simulation.history import History
from gbt_ocp.studies.limits.comparison_tables import read_rows

pytestmark = pytest.mark.skipif(os.name != "posix", reason="sends signals")


@pytest.fixture(scope="module", autouse=True)
def small():
    with little_to_do():
        yield


def check_whole(folder):
    """Every file under a final name can be read to its end."""
    for name in files(folder):
        path = folder / name
        if any(part.startswith(".") for part in path.relative_to(folder).parts) or name == "costs.txt":
            continue
        content = path.read_bytes()
        if path.suffix == ".json":
            json.loads(content)
        elif path.name == "history.npz":
            History.load_npz(path)
        elif path.suffix == ".npz":
            with np.load(path) as archive:
                assert all(archive[each].size for each in archive.files), path
        elif path.suffix == ".csv":
            assert content.endswith(b"\n"), path
            assert all(None not in row for row in read_rows(path)), path
        elif path.suffix == ".png":
            assert content.endswith(b"IEND\xaeB`\x82"), path
        elif path.suffix == ".pdf":
            assert content.rstrip().endswith(b"%%EOF"), path
        elif path.suffix in (".yaml", ".md", ".html", ".tex", ".txt"):
            assert content.endswith(b"\n"), path
        else:
            assert path.suffix == ".parquet", path
            assert content.endswith(b"PAR1"), path


class Undisturbed:
    """What a command leaves when it is let alone, its exit code, and how long it took."""

    def __init__(self, kind, folder, start, errors):
        began = time.monotonic()
        process = start(begin(kind, folder), errors)
        self.code = process.wait()
        self.seconds = time.monotonic() - began
        assert self.code in (0, 3), process.told
        self.told, self.result = process.told, result(kind, folder)


def disturbed(kind, place, alone, number, moment, start):
    """Send a signal at a moment, judge what is left, complete it, judge again; the word for what happened."""
    folder, errors = place / kind, place / "errors"
    process = start(begin(kind, folder), errors)
    time.sleep(moment)
    process.send(number)
    code, told = process.wait(), process.told
    case = f"{kind}, {signal.Signals(number).name} after {moment:.3f} s: exit code {code}\n{told}"
    if number == signal.SIGINT and code in (1, -signal.SIGINT) and "gbt_ocp" not in told:
        assert list(place.iterdir()) == [errors], case
        return "before a line of the package was read"  # Python answers for itself
    assert "Traceback" not in told, case
    if number == signal.SIGINT:
        assert code in (4, alone.code), case
        if code == 4:
            assert len(told.splitlines()) == 1, case
            assert told.startswith("interrupted: "), case
        else:
            assert told == alone.told, case
    else:
        assert code in (-signal.SIGKILL, alone.code), case
    # beside the folder lies at most what was being written, under a hidden name
    others = [entry.name for entry in place.iterdir() if entry.name not in (kind, "errors")]
    assert all(name.startswith(".") and PARTIAL in name for name in others), case
    if number == signal.SIGINT:
        assert others == [], case
    there = folder.is_dir()
    check_whole(folder)
    kept = finished(folder)
    if kind == "run" and there:
        assert result(kind, folder) == alone.result, case
    else:
        again = start(go_on(kind, folder), errors)
        assert again.wait() == alone.code, f"{case}\nthen {again.told}"
        assert again.told == alone.told, f"{case}\nthen {again.told}"
        assert result(kind, folder) == alone.result, case
    assert all((folder / name).read_bytes() == content for name, content in kept.items()), case
    assert [entry.name for entry in place.iterdir() if entry.name not in (kind, "errors")] == [], case
    word = "finished" if code == alone.code else "stopped" if number == signal.SIGINT else "killed"
    return f"{word}, {len(kept)} files kept" if kept else word


def moments(kind, tmp_path, count, start, seed):
    """Disturb a command so many times, with both signals in turn."""
    rng = np.random.default_rng([2026, seed])
    alone = Undisturbed(kind, tmp_path / "alone", start, tmp_path / "errors")
    found = Counter()
    for turn in range(count):
        place = tmp_path / str(turn)
        place.mkdir()
        number = (signal.SIGINT, signal.SIGKILL)[turn % 2]
        found[disturbed(kind, place, alone, number, rng.uniform(0.0, alone.seconds), start).partition(",")[0]] += 1
    return found


@pytest.mark.parametrize("kind", [*KINDS[:-1], pytest.param("compare", marks=pytest.mark.slow)])
@pytest.mark.long
def test_a_signal_at_a_random_moment(tmp_path, kind):
    assert sum(moments(kind, tmp_path, 2, forked, KINDS.index(kind)).values()) == 2


@pytest.mark.parametrize("moment", [0.1, 0.5])
def test_an_interrupt_while_the_program_is_loaded_is_one_line(tmp_path, moment):
    process = started(begin("run", tmp_path / "run"), tmp_path / "errors")
    time.sleep(moment)
    process.send(signal.SIGINT)
    code, told = process.wait(), process.told
    if code == 4:
        assert told == "interrupted: nothing was written\n"
    else:  # Python answers for itself
        assert code in (1, -signal.SIGINT)
        assert "gbt_ocp" not in told
    assert not (tmp_path / "run").exists()


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_signals_at_twenty_random_moments(tmp_path, kind, capsys):
    found = moments(kind, tmp_path, 20, forked, 10 + KINDS.index(kind))
    with capsys.disabled():
        print(f"\n{kind}, forked: {dict(found)}")


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["run", "sweep"])
def test_signals_at_twenty_random_moments_of_the_program(tmp_path, kind, capsys):
    """The loading and the end of the program are among the moments."""
    found = moments(kind, tmp_path, 20, started, 20 + KINDS.index(kind))
    with capsys.disabled():
        print(f"\n{kind}, started: {dict(found)}")
