"""The generated folder: it compiles without warnings, runs without Python, and says the same."""

import ctypes
import json
import re
import shutil
import subprocess
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from types import SimpleNamespace

import casadi as ca
import numpy as np
import pytest

from gbt_ocp.cli import main as cli
from gbt_ocp.experiments.run import run
from gbt_ocp.guidance.objectives import BearingSimilarity, RangePull
from gbt_ocp.guidance.standoff import ReachableRange
from gbt_ocp.guidance.target_limits import FieldOfView, RangeLimits
from gbt_ocp.models.fossen import FALCON_2D, FALCON_3D, FossenVehicle
from gbt_ocp.models.vehicles import PlanarPointMass
from gbt_ocp.ocp import KeepOut, ThrustLimit, TrajectoryProblem
from gbt_ocp.ocp.binding import Binding
from gbt_ocp.ocp.codegen.library import build_library, find_compiler, kernel_files
from gbt_ocp.ocp.codegen.options import CompiledOptions
from gbt_ocp.ocp.codegen.problem_source import generate_problem
from gbt_ocp.ocp.export.folder import write_c
from gbt_ocp.ocp.export.ipopt_source import write_ipopt_folder
from gbt_ocp.ocp.export.verification import verify_folder
from gbt_ocp.ocp.planner import Planner

pytestmark = [
    pytest.mark.skipif(find_compiler() is None, reason="no C compiler"),
    pytest.mark.skipif(shutil.which("make") is None, reason="no make"),
]


def fossen(dimension, form):
    vehicle = FossenVehicle(FALCON_2D if dimension == 2 else FALCON_3D, [5000.0] * dimension + [1500.0])
    problem = TrajectoryProblem(vehicle, 5, 0.1).maximize(BearingSimilarity(dimension)).maximize(RangePull(dimension))
    limit = ThrustLimit(vehicle, 0.98)
    return problem.subject_to(limit, nodes=4) if form == "hard" else problem.subject_to_penalty(limit, nodes=4)


def of(*problems):
    """The test is done with the folders of these problems."""
    names = [f"{dimension}d-{form}" for dimension, form in problems]
    return pytest.mark.parametrize("folder", problems, ids=names, indirect=True)


PLANE, SPACE = (2, "hard"), (3, "penalty")


@pytest.fixture(scope="module")
def folder(request, tmp_path_factory):
    return write_c(Planner(fossen(*request.param), "compiled"), tmp_path_factory.mktemp("generated") / "planner")


@of(PLANE, SPACE)
@pytest.mark.long
def test_it_compiles_without_warnings_repeats_itself_and_agrees_with_python(folder):
    before = sorted(folder.rglob("*"))
    found = verify_folder(folder, flags="-O2 -Werror")
    assert found.faults == ()
    assert found.vectors == 20
    assert found.difference < 1e-12
    assert sorted(folder.rglob("*")) == before, "verification must leave nothing behind"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("folder", "compiler", "level"), [(PLANE, "gcc", "-O0"), (SPACE, "clang", "-O3")], indirect=["folder"]
)
def test_compilers_and_optimisation_levels_agree(folder, compiler, level, monkeypatch):
    if shutil.which(compiler) is None:
        pytest.skip(f"no {compiler}")
    monkeypatch.setenv("CC", compiler)
    found = verify_folder(folder, flags=f"{level} -Werror")
    assert found.faults == ()
    assert found.difference < 1e-6


@of(SPACE)
@pytest.mark.long
def test_it_runs_clean_under_the_sanitizers(folder, tmp_path):
    flags = "-O1 -fsanitize=address,undefined -fno-sanitize-recover=all"
    (tmp_path / "empty.c").write_text("int main(void) { return 0; }\n")
    tried = subprocess.run(
        [*find_compiler(), *flags.split(), "empty.c", "-o", "empty"], cwd=tmp_path, capture_output=True, check=False
    )
    if tried.returncode != 0 or subprocess.run([tmp_path / "empty"], check=False).returncode != 0:
        pytest.skip("no sanitizers")
    assert verify_folder(folder, flags=flags).faults == ()


@pytest.mark.long
@of(PLANE)
def test_make_builds_the_example_in_place(folder, tmp_path):
    copy = shutil.copytree(folder, tmp_path / "elsewhere")
    subprocess.run(["make", "-s"], cwd=copy, check=True)
    done = subprocess.run([copy / "example"], cwd="/", capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout
    assert "20 vectors, 0 faults" in done.stdout


@of(PLANE)
@pytest.mark.long
def test_wrong_results_and_a_broken_source_are_noticed(folder, tmp_path):
    copy = shutil.copytree(folder, tmp_path / "wrong")
    header = (copy / "vectors.h").read_text()
    name = "vector_endpoints[20]"
    at = header.index("{", header.index("{", header.index(name)) + 1) + 1
    (copy / "vectors.h").write_text(header[:at] + "9.0 + " + header[at:])
    found = verify_folder(copy)
    assert found.faults[0].startswith("example: exit code 1")
    assert found.difference > 1.0
    (copy / "src" / "gbt_plan.c").write_text("#error broken\n")
    assert "broken" in verify_folder(copy).faults[0]


@of(PLANE, SPACE)
def test_code_and_workspace_are_small_and_described(folder):
    manifest = json.loads((folder / "manifest.json").read_text())
    assert manifest["sizes"]["code"] < 100_000
    assert manifest["sizes"]["workspace"] < 64_000
    assert set(manifest["versions"]) == {"gbt_ocp", "casadi"}
    assert "src/gbt_problem.c" in manifest["sha256"]
    assert str(manifest["sizes"]["planner"]) in (folder / "README.md").read_text()


def test_the_kernel_is_plain_c_without_allocation_or_state():
    for name, text in kernel_files().items():
        assert len(text.splitlines()) < 400, name
        assert not re.search(r"\b(malloc|calloc|realloc|free|printf|longjmp) ?\(", text), name
        # at file scope nothing but constants
        for line in re.findall(r"^static (?!const)[^(\n]*;", text, flags=re.MULTILINE):
            pytest.fail(f"{name}: {line}")


@pytest.mark.long
@of(PLANE)
def test_float_is_one_typedef_away(folder, tmp_path):
    copy = shutil.copytree(folder, tmp_path / "single")
    built = subprocess.run(
        ["make", "-s", "CFLAGS=-O2 -DGBT_SINGLE"], cwd=copy, capture_output=True, text=True, check=False
    )
    assert built.returncode == 0, built.stderr
    shown = subprocess.run([copy / "example"], capture_output=True, text=True, check=False).stdout
    difference = float(re.search(r"largest difference (\S+),", shown).group(1))
    assert difference < 1.0, "single precision plans must still be plans"


@pytest.mark.slow
def test_options_travel_into_the_generated_solver(tmp_path):
    folder = write_c(Planner(fossen(2, "hard"), "compiled", {"deadline": 77, "gap": 1e-4}), tmp_path / "planner")
    text = (folder / "src" / "gbt_problem.h").read_text()
    assert ".deadline = 77" in text
    assert ".gap = (gbt_real)0.0001" in text
    assert verify_folder(folder).faults == ()


@pytest.mark.parametrize(
    ("pieces", "options"),
    [(12, CompiledOptions.checked({}, 12)), (5, CompiledOptions(3e-5, 1e-3, 1e-7, 2e-2, 5e-3, 20.0, 31, 57))],
    ids=["derived", "given"],
)
def test_the_kernel_s_default_settings_are_those_of_the_options(pieces, options):
    class Settings(ctypes.Structure):
        _fields_ = [
            (option.name, {"int": ctypes.c_int, "float": ctypes.c_double}[option.type])
            for option in fields(CompiledOptions)
        ]

    problem = replace(fossen(2, "hard"), pieces=pieces)
    library = ctypes.CDLL(str(build_library(kernel_files() | generate_problem(problem, options).files)))
    settings = Settings()
    library.gbt_default_settings(ctypes.byref(settings))
    assert {name: getattr(settings, name) for name, _ in Settings._fields_} == asdict(options)


def test_nothing_is_overwritten_and_nothing_half_written(tmp_path):
    (tmp_path / "planner").mkdir()
    (tmp_path / "planner" / "mine.txt").write_text("mine")
    with pytest.raises(FileExistsError, match="exists and is not empty"):
        write_c(Planner(fossen(2, "hard"), "compiled"), tmp_path / "planner")
    with pytest.raises(ValueError, match="allowed keys"):
        write_c(Planner(fossen(2, "hard"), "compiled", {"fast": 1}), tmp_path / "other")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["planner"]


@pytest.mark.slow
@dataclass(frozen=True)
class Nearest:
    """The squared distance to a goal given as data of its own."""

    @property
    def shapes(self):
        return {"goal": (2, 1)}

    def value(self, point, parameters):
        return -ca.sumsqr(point.z - parameters["goal"])

    def bind(self, pieces, data):
        return {"goal": np.tile(np.reshape(data["goal"], (2, 1)), (pieces, 1, 1))}


@pytest.mark.long
def test_an_objective_with_data_of_its_own_is_generated_from_recorded_steps(tmp_path):
    vehicle = PlanarPointMass(thrust_max=(1.0, 1.0))
    problem = TrajectoryProblem(vehicle, 6, 0.5).maximize(Nearest()).subject_to(ThrustLimit(vehicle), nodes=2)
    planner = problem.subject_to(KeepOut((2.0, 0.1), 0.5), nodes=4).compile("compiled")
    with pytest.raises(ValueError, match="data of its own"):
        write_c(planner, tmp_path / "planner")
    steps = [{"state": np.array([[0.3 * k, 0.0], [0.5, 0.1]]), "goal": [4.0, 0.5]} for k in range(4)]
    folder = write_c(planner, tmp_path / "planner", steps)
    found = verify_folder(folder)
    assert found.faults == ()
    assert found.vectors >= 2
    with pytest.raises(ValueError, match="found solver 'ipopt'"):
        write_c(problem.compile("ipopt"), tmp_path / "other", steps)


def test_the_symmetric_root_is_that_of_numpy():
    problem = fossen(3, "hard")
    library = ctypes.CDLL(str(build_library(kernel_files() | generate_problem(problem).files)))
    rng = np.random.default_rng(0)
    cases = [np.eye(3), np.zeros((3, 3)), np.diag([1.0, 1e-20, 4.0]), np.ones((3, 3)), np.diag([1.0, -1e-18, 0.0])]
    for _ in range(50):
        root = rng.normal(size=(3, rng.integers(1, 4))) * 10.0 ** rng.uniform(-6, 3)
        cases.append(root @ root.T)
    for matrix in cases:
        found = np.empty((3, 3))
        library.gbt_symmetric_root(ctypes.c_void_p(matrix.ctypes.data), ctypes.c_void_p(found.ctypes.data))
        values, vectors = np.linalg.eigh(matrix)
        expected = vectors @ np.diag(np.sqrt(np.maximum(values, 0.0))) @ vectors.T
        # a root magnifies what round-off leaves of a zero eigenvalue
        np.testing.assert_allclose(found, expected, atol=1e-7 * np.sqrt(np.abs(matrix).max() + 1e-300))


def with_target_limits(dimension):
    problem = fossen(dimension, "hard").subject_to_penalty(RangeLimits(dimension, nearest=1.0, farthest=9.0), nodes=4)
    problem = problem.subject_to_penalty(ReachableRange(RangeLimits(dimension, nearest=1.0), 0.3), nodes=1)
    return problem.subject_to_penalty(FieldOfView(dimension, 1.0), nodes=3)


def pointers(*arrays):
    return [ctypes.c_void_p(values.ctypes.data) for values in arrays]


@pytest.mark.parametrize("dimension", [2, 3])
def test_limits_on_the_target_are_bound_from_the_moments_as_in_python(dimension):
    problem = with_target_limits(dimension)
    library = ctypes.CDLL(str(build_library(kernel_files() | generate_problem(problem).files)))
    sizes = {"ends": (5, library.gbt_ends_size()), "knots": (6, library.gbt_knots_size())}
    rng = np.random.default_rng(3)
    for _ in range(20):
        root = rng.normal(size=(6, dimension, dimension))
        mean, covariance = 10.0 * rng.normal(size=(6, dimension)), root @ np.swapaxes(root, 1, 2)
        desired, base = rng.normal(size=(5, dimension)), 1e3 * rng.normal(size=dimension)
        origin = base + rng.normal(size=dimension)
        data = {
            "present": SimpleNamespace(mean=base + mean[0], covariance=covariance[0]),
            "forecast": SimpleNamespace(mean=base + mean[1:], covariance=covariance[1:]),
            "desired": desired,
        }
        binding = Binding(problem)
        blocks = {"ends": binding.objective_parameters(data), "knots": binding.limit_parameters(data)}
        expected = []
        for name, block in blocks.items():
            count, size = sizes[name]
            numbers, parameters = np.empty(count * size), np.vstack(block).T.ravel().copy()
            place = getattr(library, f"gbt_place_{name}")
            place(*pointers(origin, parameters), count, *pointers(numbers))
            expected.append(numbers)
        found = np.empty(sum(count * size for count, size in sizes.values()))
        library.gbt_bind(*pointers(base, origin, mean, covariance, desired, found))
        np.testing.assert_allclose(found, np.concatenate(expected), rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("dimension", [pytest.param(2, marks=pytest.mark.slow), 3])
@pytest.mark.long
def test_a_whole_step_with_limits_on_the_target_is_generated(dimension, tmp_path):
    folder = write_c(Planner(with_target_limits(dimension), "compiled"), tmp_path / "planner")
    assert json.loads((folder / "manifest.json").read_text())["problem"]["from_moments"]
    found = verify_folder(folder)
    assert found.faults == ()
    assert found.vectors == 20
    assert found.difference < 1e-12


def test_ipopt_s_program_is_generated_without_errors_in_it(tmp_path):
    folder = write_ipopt_folder(fossen(2, "penalty"), {}, tmp_path / "ipopt")
    text = (folder / "planner_ipopt.c").read_text()
    assert "IpStdCInterface.h" in text
    assert "#error" not in text


@pytest.mark.long
def test_the_command_line_writes_verifies_and_refuses(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)  # a relative folder, as most people give it
    assert cli.main(["codegen", "case2", "--out", "planner", "--verify"]) == 0
    assert "20 recorded steps" in capsys.readouterr().out
    assert cli.main(["codegen", "case2", "--out", "planner"]) == 2
    assert "not an empty folder" in capsys.readouterr().err
    assert cli.main(["codegen", "case9", "--out", "other"]) == 2
    assert cli.main(["codegen", "case2", "--out", "other", "--prefix", "Bow"]) == 2
    assert "--prefix: found 'Bow'; allowed: " in capsys.readouterr().err
    assert cli.main(["codegen", "case2", "--out", "ipopt", "--prefix", "bow_", "--solver", "ipopt"]) == 0
    assert (tmp_path / "ipopt" / "bow_planner_ipopt.h").is_file()


TUTORIAL = Path(__file__).parents[1] / "docs" / "tutorial" / "new_objective.py"


@pytest.mark.slow
def test_the_tutorial_s_own_objective_is_generated_from_the_command_line(tmp_path, capsys):
    """Its steps are those of a closed loop: what the planner is given in a run of the same problem."""
    folder = tmp_path / "planner"
    assert cli.main(["codegen", str(TUTORIAL), "--out", str(folder), "--verify", "--prefix", "eco_"]) == 0
    found = int(re.search(r"(\d+) recorded steps", capsys.readouterr().out)[1])
    assert found > 10
    history = run(str(TUTORIAL), overrides=["planner.solver=compiled", "duration_s=3"]).history
    text = (folder / "vectors.h").read_text()
    rows = re.search(r"vector_endpoints\[\d+\]\[\d+\] = \{(.*?)\};", text, re.DOTALL)[1]
    recorded = np.array([row.split(",") for row in re.findall(r"[^{}]*\d[^{}]*", rows)], dtype=float)
    planned = history.plan.reshape(len(history.plan), -1)
    assert all(np.abs(planned - row).max(axis=1).min() < 1e-9 for row in recorded)
    refused = ["codegen", str(TUTORIAL), "--out", str(tmp_path / "other"), "--set", "guidance.kind=static"]
    assert cli.main(refused) == 2
    assert "guidance.kind: found static; allowed: planner" in capsys.readouterr().err
