"""The cache of compiled libraries, and compilers that are not what they should be."""

import os
import shlex
import shutil
import signal
import stat
import subprocess
import sys
import time

import pytest

from gbt_ocp.files import temporary_beside
from gbt_ocp.guidance import RangePull
from gbt_ocp.models import PlanarPointMass
from gbt_ocp.ocp import ThrustLimit, TrajectoryProblem
from gbt_ocp.ocp.codegen import cache, library
from gbt_ocp.ocp.codegen.library import CompilerError, build_library, find_compiler, load_library

REAL = find_compiler()

pytestmark = [
    pytest.mark.skipif(REAL is None, reason="no C compiler"),
    pytest.mark.skipif(os.name != "posix", reason="owners and modes are those of POSIX"),
]

SEVEN = {"a.c": "int number(void) { return 7; }\n"}
EIGHT = {"a.c": "int number(void) { return 8; }\n"}


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.setenv("GBT_OCP_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"


def script(path, text):
    """An executable that stands for a compiler; ``$REAL`` in its text is the real one."""
    path.write_text("#!/bin/sh\n" + text.replace("$REAL", shlex.join(REAL)))
    path.chmod(0o755)
    return path


def planner():
    vehicle = PlanarPointMass()
    return TrajectoryProblem(vehicle, 2, 0.1).maximize(RangePull(2)).subject_to(ThrustLimit(vehicle), nodes=1)


def falls_back(match):
    with pytest.raises(CompilerError, match=match) as caught:
        build_library(SEVEN)
    assert len(str(caught.value).splitlines()) == 1
    with pytest.warns(RuntimeWarning, match="auto takes ipopt"):
        assert planner().compile("auto").solver.name == "ipopt"


def test_a_library_is_built_once_for_its_user_alone(folder):
    path = build_library(SEVEN)
    assert stat.S_IMODE(folder.stat().st_mode) == 0o700
    assert [entry.name for entry in folder.iterdir()] == [path.name]
    before = path.stat().st_ino
    assert build_library(SEVEN) == path
    assert path.stat().st_ino == before
    assert load_library(SEVEN).number() == 7


def emptied(path):
    path.write_bytes(b"")


def cut(path):
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])


def changed(path):
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)


def random_bytes(path):
    path.write_bytes(os.urandom(path.stat().st_size))


def another(path):
    path.write_bytes(build_library(EIGHT).read_bytes())


def a_folder(path):
    path.unlink()
    path.mkdir()
    (path / "x").write_text("x")


def a_link(path):
    elsewhere = path.parent.parent / "elsewhere.so"
    path.rename(elsewhere)
    path.symlink_to(elsewhere)


def a_dangling_link(path):
    path.unlink()
    path.symlink_to(path.parent / "nothing")


def writable_by_others(path):
    path.chmod(0o722)


def of_another_user(path):
    if os.geteuid() != 0:
        pytest.skip("only root can give a file away")
    os.chown(path, 12345, -1)


def a_pipe(path):
    path.unlink()
    os.mkfifo(path)


DAMAGES = [
    emptied, cut, changed, random_bytes, another, a_folder, a_link, a_dangling_link, writable_by_others,
    of_another_user, a_pipe,
]  # fmt: skip


@pytest.mark.parametrize("damage", DAMAGES, ids=lambda damage: damage.__name__)
def test_a_library_that_cannot_be_trusted_is_built_again(damage, folder):
    path = build_library(SEVEN)
    damage(path)
    again = build_library(SEVEN)
    status = again.lstat()
    assert stat.S_ISREG(status.st_mode)
    assert status.st_uid == os.geteuid()
    assert stat.S_IMODE(status.st_mode) == 0o700
    assert load_library(SEVEN).number() == 7
    assert len(list(folder.glob("*.so"))) == (2 if damage is another else 1)


@pytest.mark.long
def test_a_damaged_library_of_a_planner_does_not_end_a_run(folder):
    """Cut in the middle of a page, it ended the process with SIGBUS."""
    planner().compile("compiled")
    (path,) = folder.glob("*.so")
    cut(path)
    code = (
        "import numpy as np, sys; sys.path.insert(0, 'tests'); from test_library_cache import planner;"
        "from types import SimpleNamespace as S;"
        "f = S(mean=np.ones((2, 2)), covariance=np.zeros((2, 2, 2)));"
        "print(planner().compile('compiled').solve(np.zeros((2, 2)), f).status)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout.strip()) == (0, "solved"), done.stderr


def test_a_library_that_cannot_be_loaded_is_built_again(folder):
    path = build_library(SEVEN)
    key = path.stem.partition("-")[0]
    path.unlink()
    garbage = folder / "garbage"
    garbage.write_bytes(b"\x7fELF and nothing more")
    garbage.chmod(0o700)
    garbage.rename(folder / f"{key}-{cache._hash(garbage)}.so")  # as its name says, but no library
    assert load_library(SEVEN).number() == 7
    assert [entry.name for entry in folder.iterdir()] == [path.name]


@pytest.mark.parametrize("mode", [0o770, 0o707, 0o777])
def test_a_folder_in_which_others_may_write_is_refused(mode, folder):
    build_library(SEVEN)
    folder.chmod(mode)
    falls_back("cache of compiled code in which other users may write.*chmod go-w.*GBT_OCP_CACHE")


def test_a_folder_of_another_user_is_refused(folder, monkeypatch):
    build_library(SEVEN)
    monkeypatch.setattr(cache.os, "geteuid", lambda: 12345)
    falls_back("cache of compiled code")


def test_a_place_that_cannot_be_used_is_one_line(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("x")
    for place in (tmp_path / "file", tmp_path / "file" / "below", "/proc/nowhere/cache"):
        monkeypatch.setenv("GBT_OCP_CACHE", str(place))
        falls_back("cannot be written.*set GBT_OCP_CACHE")


def test_without_a_home_the_cache_has_no_place(monkeypatch):
    def homeless():
        raise RuntimeError("Could not determine home directory.")

    monkeypatch.delenv("GBT_OCP_CACHE", raising=False)
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    monkeypatch.setattr(library.Path, "home", homeless)
    falls_back("GBT_OCP_CACHE: found nothing, and no home")


def test_machines_and_compilers_do_not_share_libraries(folder, monkeypatch):
    paths = [build_library(SEVEN)]
    monkeypatch.setattr(library, "_machine", lambda: ("Linux", "another", "processor"))
    paths.append(build_library(SEVEN))
    monkeypatch.setenv("CC", f"{shlex.join(REAL)} -DANOTHER")
    paths.append(build_library(SEVEN))
    assert len({path.name.partition("-")[0] for path in paths}) == 3


def test_old_and_surplus_entries_are_removed_and_others_left_alone(folder, monkeypatch):
    old, fresh, unrelated = build_library(SEVEN), build_library(EIGHT), folder / "libmine.so"
    unrelated.write_text("mine")
    earlier = folder / f"{'0' * 32}.so"
    earlier.write_text("of an earlier version")
    long_ago = time.time() - 86400.0 * (cache.KEPT_DAYS + 1.0)
    for path in (old, earlier, unrelated):
        os.utime(path, (long_ago, long_ago))
    left = {name: folder / name for name in ("build-abcd1234", "build-of-mine", ".x.partial-elsewhere-1-00")}
    for path in left.values():
        path.mkdir()
        os.utime(path, (long_ago, long_ago))
    dead = folder / temporary_beside(folder / "build").name.replace(f"-{os.getpid()}-", "-4194304-")
    alive = temporary_beside(folder / "build")
    for path in (dead, alive):
        path.mkdir()
    built = build_library({"a.c": "int number(void) { return 9; }\n"})
    assert set(folder.iterdir()) == {fresh, built, unrelated, left["build-of-mine"], alive}

    monkeypatch.setattr(cache, "MOST_KEPT", 1)
    os.utime(fresh, (time.time() - 100.0,) * 2)
    last = build_library({"a.c": "int number(void) { return 10; }\n"})
    assert set(folder.glob("*.so")) == {built, last, unrelated}


def test_use_keeps_a_library(folder):
    path = build_library(SEVEN)
    long_ago = time.time() - 86400.0 * (cache.KEPT_DAYS + 1.0)
    os.utime(path, (long_ago, long_ago))
    assert build_library(SEVEN) == path
    build_library(EIGHT)
    assert path.exists()


def test_a_build_that_is_killed_leaves_nothing_for_ever(folder, tmp_path, monkeypatch):
    started = tmp_path / "started"
    slow = script(tmp_path / "slow", f'[ "$1" = --version ] && exit 0\ntouch {started}\nexec sleep 60\n')
    code = f"from gbt_ocp.ocp.codegen.library import build_library; build_library({SEVEN!r})"
    process = subprocess.Popen([sys.executable, "-c", code], env={**os.environ, "CC": str(slow)})
    while not started.exists():
        assert process.poll() is None
        time.sleep(0.05)
    process.send_signal(signal.SIGKILL)
    process.wait()
    assert len(list(folder.iterdir())) == 1
    path = build_library(SEVEN)
    assert list(folder.iterdir()) == [path]


def test_cc_is_a_command_with_arguments(folder, tmp_path, monkeypatch):
    (tmp_path / "a folder").mkdir()
    linked = tmp_path / "a folder" / "my cc"
    linked.symlink_to(REAL[0])
    for given, words in (
        (f"{REAL[0]} -DNUMBER=7", [REAL[0], "-DNUMBER=7"]),
        (f"env {REAL[0]} '-DNUMBER=3 + 4'", [shutil.which("env"), REAL[0], "-DNUMBER=3 + 4"]),
        (f"'{linked}' -DNUMBER=7", [str(linked), "-DNUMBER=7"]),
        (f"  {REAL[0]}  -DNUMBER=7 ", [REAL[0], "-DNUMBER=7"]),
    ):
        monkeypatch.setenv("CC", given)
        assert find_compiler() == words
        assert load_library({"a.c": "int number(void) { return NUMBER; }\n"}).number() == 7
    monkeypatch.setenv("CC", "")
    assert find_compiler() == REAL
    monkeypatch.chdir(tmp_path / "a folder")
    monkeypatch.setenv("CC", "'./my cc'")
    assert find_compiler() == [str(linked)], "compilation runs in another folder"
    assert load_library(SEVEN).number() == 7


@pytest.mark.parametrize("given", ["no-such-compiler", "no-such-compiler -m64", "'cc", "''", "-m64"])
def test_a_cc_that_names_no_program_is_named(given, folder, monkeypatch):
    monkeypatch.setenv("CC", given)
    assert find_compiler() is None
    falls_back("no C compiler: CC: found .*, of which there is no program; allowed: ")


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("exit 0", "found nothing written; allowed: a compiler that writes a library"),
        (": > library.so", "found nothing written"),
        ("echo rubbish > library.so", "found a library that cannot be loaded"),
        ('$REAL "$@"; truncate -s 2000 library.so', "found a library that cannot be loaded"),
        ('$REAL "$@"; truncate -s 9000 library.so', "found a library that cannot be loaded"),
        ("mkdir library.so", "found nothing written"),
        ("echo out of paper >&2; exit 3", "failed: out of paper"),
        ("kill -9 $$", "failed"),
        ("exec sleep 60", "not done after 0.5 s"),
        ("sleep 60 & wait", "not done after 0.5 s"),
    ],
)
def test_a_compiler_that_does_not_do_its_work_is_one_line(text, says, folder, tmp_path, monkeypatch):
    monkeypatch.setattr(library, "COMPILE_S", 0.5 if "sleep" in text else 60.0)
    monkeypatch.setenv("CC", str(script(tmp_path / "bad", f'[ "$1" = --version ] && exit 0\n{text}\n')))
    falls_back(says)
    assert list(folder.iterdir()) == []


def test_a_compiler_that_hangs_at_once_is_one_line_and_ended(folder, tmp_path, monkeypatch):
    number = tmp_path / "number"
    monkeypatch.setattr(library, "VERSION_S", 0.5)
    monkeypatch.setenv("CC", str(script(tmp_path / "bad", f"sleep 60 &\necho $! > {number}\nwait\n")))
    falls_back("not done after 0.5 s")
    shown = subprocess.run(["ps", "-o", "stat=", "-p", number.read_text()], capture_output=True, text=True, check=False)
    assert shown.stdout.strip()[:1] in ("", "Z"), "its child is ended, too"


def test_a_program_that_cannot_be_run_is_one_line(folder, tmp_path, monkeypatch):
    (tmp_path / "bad").write_bytes(b"\x7fELF\x00\x00")
    (tmp_path / "bad").chmod(0o755)
    monkeypatch.setenv("CC", str(tmp_path / "bad"))
    falls_back("cannot be started")
