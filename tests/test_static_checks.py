"""The C of a pilot under static analysis: gcc's analyzer, cppcheck, and clang-tidy find nothing."""

import shutil
import subprocess

import pytest
from pilots_in_c import files_of

import gbt_ocp as gbt
from gbt_ocp.experiments.build.pilot import build_pilot

CASES = [("case2", "seed=0"), ("sea3d", "tracker.kind=ekf"), ("sea2d", "seed=0")]

WITHOUT = {
    # paths that do not fit together: of another number of dimensions, or past a return
    "cppcheck": ["ctuArrayIndex", "ctuuninitvar", "uninitvar"],
    # arguments of one type are vectors; offsets into arrays of a few kilobytes; loops over the steps of a search
    "clang-tidy": [
        *("bugprone-easily-swappable-parameters", "bugprone-implicit-widening-of-multiplication-result"),
        *("bugprone-integer-division", "cert-flp30-c"),
    ],
}
"""Checks that say nothing true of these sources, by tool."""


@pytest.fixture(scope="module", params=CASES, ids=[name for name, _ in CASES])
def sources(request, tmp_path_factory):
    """A folder with all files of a pilot."""
    place = tmp_path_factory.mktemp("sources")
    for name, text in files_of(build_pilot(gbt.load_config(request.param[0], [request.param[1]]))).items():
        (place / name).write_text(text, encoding="utf-8")
    return place


def said(tool, *arguments, folder):
    """The lines of a tool that warn; skips where it is missing."""
    if shutil.which(tool) is None:
        pytest.skip(f"no {tool}")
    done = subprocess.run([tool, *arguments], cwd=folder, capture_output=True, text=True, check=False)
    lines = (done.stdout + done.stderr).splitlines()
    return [line for line in lines if " warning: " in line or " error: " in line or line.startswith("error")]


def units(folder):
    return sorted(path.name for path in folder.glob("gbt_*.c"))


@pytest.mark.slow
def test_the_analyzer_of_gcc_finds_nothing(sources):
    flags = ["-std=c99", "-O2", "-fanalyzer", "-Wall", "-Wextra", "-fno-math-errno", "-I."]
    for unit in units(sources):
        assert said("gcc", *flags, "-c", unit, "-o", "unit.o", folder=sources) == []


@pytest.mark.slow
def test_cppcheck_finds_nothing(sources):
    without = [f"--suppress={name}" for name in WITHOUT["cppcheck"]]
    checks = [
        "--enable=warning,performance,portability",
        "--std=c99",
        "--quiet",
        "--max-configs=48",
        "--template={file}:{line}: warning: {id}",
    ]
    assert said("cppcheck", *checks, *without, "-I.", ".", folder=sources) == []


@pytest.mark.slow
def test_clang_tidy_finds_nothing(sources):
    checks = ",".join(["-*", "bugprone-*", "cert-*", *(f"-{name}" for name in WITHOUT["clang-tidy"])])
    assert (
        said("clang-tidy", "--quiet", f"-checks={checks}", *units(sources), "--", "-std=c99", "-I.", folder=sources)
        == []
    )


@pytest.mark.slow
def test_a_tool_that_finds_something_is_heard(tmp_path):
    (tmp_path / "gbt_wrong.c").write_text(
        "int f(int *a);\nint f(int *a) { int *none = 0; if (a) return *a; return *none; }\n", encoding="utf-8"
    )
    assert said("cppcheck", "--template={file}:{line}: error: {id}", "--quiet", ".", folder=tmp_path)
    assert said("gcc", "-fanalyzer", "-O2", "-c", "gbt_wrong.c", "-o", "unit.o", folder=tmp_path)
