"""The generated folder among others: two in one program, callers in C++, CMake, odd paths, compilers that hang."""

import os
import shutil
import subprocess
import sys
import time
from dataclasses import replace

import pytest
from test_codegen import fossen

from gbt_ocp.ocp.codegen.commands import CommandError, run_command
from gbt_ocp.ocp.codegen.library import CompilerError, find_compiler
from gbt_ocp.ocp.export import building
from gbt_ocp.ocp.export.folder import write_c
from gbt_ocp.ocp.export.ipopt_source import write_ipopt_folder
from gbt_ocp.ocp.export.verification import verify_folder
from gbt_ocp.ocp.planner import Planner

pytestmark = [
    pytest.mark.skipif(find_compiler() is None, reason="no C compiler"),
    pytest.mark.skipif(shutil.which("make") is None, reason="no make"),
]

CALLER = """
#include "{prefix}gbt_plan.h"
static {prefix}gbt_planner planner;
static {prefix}gbt_plan_result plan;
int {name}(double *end)
{{
    enum {{ P = {macro}GBT_PIECES, D = {macro}GBT_DIMENSION }};
    static {prefix}gbt_real state[{macro}GBT_STATE], mean[P * D], covariance[P * D * D], desired[P * D];
    for (int i = 0; i < P; i++) {{
        mean[D * i] = 3;
        desired[D * i] = 1;
        for (int j = 0; j < D; j++) covariance[D * D * i + j * (D + 1)] = ({prefix}gbt_real)0.01;
    }}
    {prefix}gbt_plan_init(&planner);
    {prefix}gbt_plan(&planner, state, mean, covariance, desired, &plan);
    *end = (double)plan.endpoints[P - 1][0];
    return (int)plan.status * 1000 + P * 10 + (int)(sizeof planner == {prefix}gbt_planner_bytes());
}}
"""
"""A function that plans once and says: 1 for the right size, 10 for each piece, 1000 for a status."""

MAIN = """
#include <stdio.h>
#ifdef __cplusplus
extern "C" {
#endif
int first(double *), second(double *);
#ifdef __cplusplus
}
#endif
int main(void)
{
    double a = 0, b = 0;
    const int one = first(&a), two = second(&b);
    printf("%d %d %.9f %.9f\\n", one, two, a, b);
    return 0;
}
"""


def problems():
    """Two of different sizes, and one of the first one's sizes that differs in a number."""
    short = fossen(2, "hard")
    return {"short": short, "long": replace(short, pieces=8), "slow": replace(short, period=0.11)}


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    """A folder of each of these problems without a prefix, and two with one."""
    place = tmp_path_factory.mktemp("folders")
    posed = {name: Planner(problem, "compiled") for name, problem in problems().items()}
    with pytest.MonkeyPatch.context() as patch:
        # sizes are measured in test_codegen.py; here they would only take time
        patch.setattr("gbt_ocp.ocp.export.folder.find_compiler", lambda: None)
        made = {name: write_c(planner, place / name) for name, planner in posed.items()}
        made["bow"] = write_c(posed["short"], place / "bow", prefix="bow_")
        made["stern"] = write_c(posed["long"], place / "stern", prefix="stern_")
    return made


def compiled(sources, flags, folder, compiler="gcc"):
    """Objects of these sources, in a folder."""
    folder.mkdir(exist_ok=True)
    command = [compiler, *flags, "-c", *map(str, sources)]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return sorted(folder.glob("*.o"))


def library(folder, *flags):
    """The planner of a folder as a static library, made once, beside its objects."""
    place = folder.parent / "-".join([folder.name, "library", *flags])
    if not place.exists():
        place.mkdir()
        objects = compiled(sorted((folder / "src").glob("*.c")), ["-std=c99", *flags], place / "objects")
        subprocess.run(["ar", "rcs", "planner.a", *map(str, objects)], cwd=place, check=True)
    return place / "planner.a"


def caller(folder, name, place, prefix="", flags=()):
    """The function above as an object, with the headers of a folder."""
    (place / f"{name}.c").write_text(CALLER.format(prefix=prefix, macro=prefix.upper(), name=name))
    flags = ["-std=c99", "-Wall", "-Werror", f"-I{folder / 'src'}", *flags]
    return compiled([f"../{name}.c"], flags, place / f"{name}_object")[0]


def linked(place, parts):
    """What the linker says of a program of these parts, and the program."""
    (place / "main.c").write_text(MAIN)
    command = ["gcc", "main.c", *map(str, parts), "-lm", "-o", "program"]
    return subprocess.run(command, cwd=place, capture_output=True, text=True, check=False), place / "program"


@pytest.mark.slow
def test_two_planners_with_a_prefix_each_work_in_one_program(folders, tmp_path):
    parts = [
        caller(folders["bow"], "first", tmp_path, "bow_"),
        caller(folders["stern"], "second", tmp_path, "stern_"),
        library(folders["bow"]),
        library(folders["stern"]),
    ]
    done, program = linked(tmp_path, parts)
    assert done.returncode == 0, done.stderr
    together = subprocess.run([program], capture_output=True, text=True, check=True).stdout.split()
    assert together[:2] == ["51", "81"]
    # each alone, without a prefix, ends where it does in the program of both
    for place, name, end in ((tmp_path / "one", "short", together[2]), (tmp_path / "two", "long", together[3])):
        place.mkdir()
        alone = [
            caller(folders[name], "first", place),
            library(folders[name]),
        ]
        (place / "second.c").write_text("int second(double *x) { return (int)*x; }\n")
        done, program = linked(place, [*alone, *compiled(["../second.c"], [], place / "none")])
        assert done.returncode == 0, done.stderr
        assert subprocess.run([program], capture_output=True, text=True, check=True).stdout.split()[2] == end


@pytest.mark.long
def test_every_symbol_type_and_macro_has_the_prefix(folders, tmp_path):
    archive = library(folders["bow"])
    listed = subprocess.run(["nm", "-g", "--defined-only", archive], capture_output=True, text=True, check=True).stdout
    symbols = [line.split()[-1] for line in listed.splitlines() if len(line.split()) == 3]
    assert len(symbols) > 20
    assert [name for name in symbols if not name.startswith("bow_gbt_")] == []
    headers = sorted((folders["bow"] / "src").glob("*.h"))
    assert all(path.name.startswith("bow_gbt_") for path in headers)
    (tmp_path / "all.c").write_text("".join(f'#include "{path.name}"\n' for path in headers))
    command = ["gcc", "-std=c99", "-dM", "-E", f"-I{folders['bow'] / 'src'}", "all.c"]
    defined = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=True).stdout
    names = {line.split()[1].split("(")[0] for line in defined.splitlines()}
    assert "BOW_GBT_PIECES" in names
    assert [name for name in names if name.startswith("GBT_")] == []
    text = "".join(path.read_text() for path in headers)
    assert "typedef" in text
    assert " gbt_" not in text


@pytest.mark.parametrize("prefix", ["Bow_", "1bow", "bow-", "_bow", "bow gbt", "bö", "b" * 33, "bow_\n"])
def test_a_prefix_that_cannot_begin_a_name_is_refused(prefix, tmp_path):
    with pytest.raises(ValueError, match="prefix: found"):
        write_c(Planner(fossen(2, "hard"), "compiled"), tmp_path / "planner", prefix=prefix)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("other", ["long", "slow"])
@pytest.mark.parametrize("as_objects", [False, True])
@pytest.mark.long
def test_two_planners_of_one_prefix_do_not_link(folders, tmp_path, other, as_objects):
    archives = [library(folders["short"]), library(folders[other])]
    if as_objects:
        archives = [path for archive in archives for path in archive.parent.glob("objects/*.o")]
    calls = [caller(folders["short"], "first", tmp_path), caller(folders[other], "second", tmp_path)]
    for libraries in (archives, archives[::-1]):
        done, program = linked(tmp_path, [*calls, *libraries])
        assert done.returncode != 0
        assert "multiple definition of `gbt_plan'" in done.stderr
        assert not program.exists()


def test_a_caller_with_the_headers_of_another_planner_does_not_link(folders, tmp_path):
    call = caller(folders["short"], "first", tmp_path)
    (tmp_path / "second.c").write_text("int second(double *x) { return (int)*x; }\n")
    rest = compiled(["../second.c"], [], tmp_path / "rest")
    for name, flags in (("long", []), ("slow", []), ("short", ["-DGBT_SINGLE"])):
        done, _ = linked(tmp_path, [call, *rest, library(folders[name], *flags)])
        assert done.returncode != 0
        assert "undefined reference to `gbt_plan_init" in done.stderr
    done, _ = linked(tmp_path, [call, *rest, library(folders["short"])])
    assert done.returncode == 0, done.stderr


def test_headers_of_two_planners_of_one_prefix_do_not_compile_together(folders, tmp_path):
    sources = [folders[name] / "src" / "gbt_plan.h" for name in ("short", "long", "short")]
    for second, allowed in ((sources[1], False), (sources[2], True)):
        (tmp_path / "both.c").write_text(f'#include "{sources[0]}"\n#include "{second}"\nint x;\n')
        command = ["gcc", "-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Werror", "-c", "both.c"]
        done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
        assert (done.returncode == 0) is allowed
        assert ("headers of two generated planners" in done.stderr) is not allowed


@pytest.mark.long
def test_two_libraries_loaded_into_one_program_keep_to_themselves(folders, tmp_path):
    """Both without a prefix, each in a shared library of its own, as components of one robot process are."""
    names = []
    for number, (folder, name) in enumerate(((folders["short"], "first"), (folders["long"], "second"))):
        place = tmp_path / name
        shutil.copytree(folder, place)
        subprocess.run(["make", "-s", "CFLAGS=-O1 -fPIC"], cwd=place, check=True)
        call = caller(folder, name, tmp_path, flags=["-fPIC"])
        command = ["gcc", "-shared", "-o", f"lib{number}.so", str(call), str(place / "libgbt_planner.a"), "-lm"]
        subprocess.run(command, cwd=tmp_path, check=True)
        names.append(f"./lib{number}.so")
    done, program = linked(tmp_path, names)
    assert done.returncode == 0, done.stderr
    found = subprocess.run([program], cwd=tmp_path, capture_output=True, text=True, check=True).stdout.split()
    assert found[:2] == ["51", "81"]


@pytest.mark.parametrize("standard", ["c++11", "c++20"])
@pytest.mark.long
def test_headers_are_usable_from_cpp(folders, tmp_path, standard):
    if shutil.which("g++") is None:
        pytest.skip("no g++")
    flags = [f"-std={standard}", "-Wall", "-Wextra", "-Wpedantic", "-Werror"]
    calls = []
    for folder, prefix, name in ((folders["bow"], "bow_", "first"), (folders["stern"], "stern_", "second")):
        text = CALLER.format(prefix=prefix, macro=prefix.upper(), name=name)
        text = text.replace(f"int {name}(", f'extern "C" int {name}(')
        (tmp_path / f"{name}.cpp").write_text(text)
        include = f"-I{folder / 'src'}"
        calls += compiled([f"../{name}.cpp"], [*flags, include], tmp_path / name, "g++")
        # every header by itself, the inner ones too
        for header in sorted((folder / "src").glob("*.h")):
            (tmp_path / "alone.cpp").write_text(f'#include "{header.name}"\n')
            compiled(["../alone.cpp"], [*flags, include], tmp_path / "alone", "g++")
    (tmp_path / "main.cpp").write_text(MAIN)
    calls += compiled(["../main.cpp"], flags, tmp_path / "main", "g++")
    libraries = [library(folders["bow"]), library(folders["stern"])]
    command = ["g++", *map(str, [*calls, *libraries]), "-o", "program"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    found = subprocess.run([tmp_path / "program"], capture_output=True, text=True, check=True).stdout.split()
    assert found[:2] == ["51", "81"]


USER = """
cmake_minimum_required(VERSION 3.10)
project(user LANGUAGES {language})
{found}
add_executable(user main.{ending} first.{ending} second.{ending})
target_link_libraries(user PRIVATE bow_gbt_planner::bow_gbt_planner stern_gbt_planner::stern_gbt_planner)
"""


@pytest.mark.parametrize(
    ("how", "single"),
    [
        ("find_package", False),
        pytest.param("find_package", True, marks=pytest.mark.slow),
        pytest.param("add_subdirectory", False, marks=pytest.mark.slow),
    ],
)
@pytest.mark.long
def test_cmake_installs_a_package_that_other_projects_find(folders, tmp_path, how, single):
    if shutil.which("cmake") is None:
        pytest.skip("no cmake")

    def cmake(*arguments, folder):
        done = subprocess.run(["cmake", *arguments], cwd=folder, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stdout + done.stderr
        assert "warning" not in (done.stdout + done.stderr).lower()

    odd = tmp_path / "my odd $place"
    odd.mkdir()
    found = []
    for name in ("bow", "stern"):
        place = shutil.copytree(folders[name], odd / name)
        if how == "find_package":
            precision = f"-D{name.upper()}_GBT_SINGLE={'ON' if single else 'OFF'}"
            cmake("-S", ".", "-B", "build", precision, "-DCMAKE_BUILD_TYPE=Debug", folder=place)
            cmake("--build", "build", folder=place)
            cmake("--install", "build", "--prefix", str(odd / "installed"), folder=place)
            found.append(f"find_package({name}_gbt_planner REQUIRED)")
            installed = sorted(path.name for path in (odd / "installed/include" / f"{name}_gbt_planner").iterdir())
            kinds = ("identity", "plan", "problem", "real", "solver")
            assert installed == [f"{name}_gbt_{kind}.h" for kind in kinds]
            if not single:
                done = subprocess.run(["ctest", "--test-dir", "build"], cwd=place, capture_output=True, check=False)
                assert done.returncode == 0, done.stdout
            shutil.rmtree(place)
        else:
            found.append(f"add_subdirectory({name})")
    ending, language = ("cpp", "CXX") if how == "find_package" and shutil.which("g++") else ("c", "C")
    (odd / "CMakeLists.txt").write_text(USER.format(found="\n".join(found), ending=ending, language=language))
    (odd / f"main.{ending}").write_text(MAIN)
    for prefix, name in (("bow_", "first"), ("stern_", "second")):
        text = CALLER.format(prefix=prefix, macro=prefix.upper(), name=name)
        text = text.replace(f"int {name}(", f'extern "C" int {name}(') if ending == "cpp" else text
        (odd / f"{name}.{ending}").write_text(text)
    cmake("-S", ".", "-B", "build", f"-DCMAKE_PREFIX_PATH={odd / 'installed'}", folder=odd)
    cmake("--build", "build", folder=odd)
    shown = subprocess.run([odd / "build" / "user"], capture_output=True, text=True, check=True).stdout.split()
    assert shown[:2] == ["51", "81"]


ODD = 'it\'s my $HOME [1]* "q" é #%;`id`\\x\ny'
"""Whatever a shell, make, CMake or C reads as something else."""


@pytest.mark.long
def test_folders_below_odd_paths_are_written_built_and_verified(tmp_path, monkeypatch):
    place = tmp_path / ODD
    (place / "temporary").mkdir(parents=True)
    monkeypatch.setattr("tempfile.tempdir", str(place / "temporary"))
    folder = write_c(Planner(fossen(2, "hard"), "compiled"), place / "planner")
    assert verify_folder(folder, flags="-O0").faults == ()
    # and as a user builds it, in place
    command = ["make", "-s", "check", "CFLAGS=-O0"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "0 faults" in done.stdout
    if shutil.which("gcc-ar") is not None:  # for the least flash
        command = ["make", "-s", "check", "CC=gcc", "AR=gcc-ar", "CFLAGS=-Os -flto", "OUT=small"]
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        assert "0 faults" in done.stdout
    done = subprocess.run(["make", "OUT=two words"], cwd=folder, capture_output=True, text=True, check=False)
    assert "OUT: found 'two words'; allowed: a path without spaces" in done.stderr
    assert (write_ipopt_folder(fossen(2, "hard"), {}, place / "ipopt") / "planner_ipopt.h").is_file()
    assert list((place / "temporary").iterdir()) == []


def pretender(place, text):
    """A compiler of our own: a script that finds the real one beside it in the environment."""
    script = place / "pre tender"
    script.write_text(f"#!{sys.executable}\n{text}")
    script.chmod(0o755)
    return script


def test_a_compiler_that_hangs_is_ended_with_its_children(folders, tmp_path, monkeypatch):
    seconds = f"86400.{time.time_ns()}"  # to know it by
    script = pretender(tmp_path, f"import subprocess\nsubprocess.run(['sleep', '{seconds}'])\n")
    monkeypatch.setattr(building, "find_compiler", lambda: [str(script)])
    monkeypatch.setattr(building, "BUILD_S", 2.0)
    found = verify_folder(folders["short"])
    assert "not done after 2 s" in found.faults[0]
    with pytest.raises(CompilerError, match="not done after 2 s"), building.built(folders["short"], "-O0"):
        pass
    listed = subprocess.run(["ps", "-eo", "args"], capture_output=True, text=True, check=False).stdout
    assert seconds not in listed
    with pytest.raises(CommandError, match="cannot be started"):
        run_command([str(tmp_path / "none")], tmp_path, 1.0)


def test_a_compiler_that_writes_nothing_is_noticed(folders, tmp_path, monkeypatch):
    for text in ("", "import sys\nsys.exit(1)\n"):
        script = pretender(tmp_path, text)
        monkeypatch.setattr(building, "find_compiler", lambda script=script: str(script))
        found = verify_folder(folders["short"])
        assert len(found.faults) == 1
        assert " failed: " in found.faults[0]


@pytest.mark.long
def test_an_example_that_hangs_or_says_nothing_is_noticed(folders, tmp_path, monkeypatch):
    monkeypatch.setattr(building, "RUN_S", 1.0)
    for text, said in (("for (;;);", "not done after 1 s"), ("return 0;", "example printed no result")):
        copy = shutil.copytree(folders["short"], tmp_path / said)
        (copy / "example.c").write_text(f"int main(void) {{ {text} }}\n")
        assert any(said in fault for fault in verify_folder(copy, flags="-O0").faults)


def test_a_make_above_does_not_pass_its_flags_on(folders, monkeypatch):
    monkeypatch.setenv("MAKEFLAGS", "n")  # make -n: it builds nothing
    monkeypatch.setenv("CFLAGS", "-DGBT_SINGLE")
    assert verify_folder(folders["short"]).faults == ()
    assert os.environ["MAKEFLAGS"] == "n"


def test_fast_math_is_refused_where_it_is_compiled(folders, tmp_path):
    for flags in (["-ffast-math"], ["-Ofast"], ["-ffinite-math-only"]):
        for compiler in filter(shutil.which, ("gcc", "clang")):
            command = [compiler, "-std=c99", *flags, "-c", str(folders["short"] / "src" / "gbt_plan.c")]
            done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
            assert done.returncode != 0
            assert "found fast math" in done.stderr
            # a caller may use it, and the planner within a project that uses it is built without
            caller(folders["short"], "first", tmp_path, flags=flags)
            done = subprocess.run([*command, "-fno-fast-math"], cwd=tmp_path, capture_output=True, check=False)
            assert done.returncode == 0
