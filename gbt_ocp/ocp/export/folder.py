"""A folder of C that stands alone: the planner for one problem, an example, and recorded steps to hold it against."""

from __future__ import annotations

import hashlib
import json
import re
import shutil
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from importlib.metadata import version
from pathlib import Path
from typing import Any

import casadi as ca

from gbt_ocp.files import packaged_text, whole_folder
from gbt_ocp.ocp.codegen.commands import CommandError, run_command
from gbt_ocp.ocp.codegen.library import CompilerError, find_compiler, kernel_files
from gbt_ocp.ocp.codegen.options import CompiledOptions
from gbt_ocp.ocp.codegen.problem_source import from_moments, generate_problem
from gbt_ocp.ocp.export.building import RUN_S, built, number_after, run_example
from gbt_ocp.ocp.export.names import checked_prefix, identity_header, prefixed
from gbt_ocp.ocp.export.vectors import record
from gbt_ocp.ocp.planner import AnyPlanner
from gbt_ocp.ocp.problem_data import PosedProblem, ProblemData, ShootingData
from gbt_ocp.ocp.solvers.compiled import CompiledSolver


def write_c(
    planner: AnyPlanner,
    folder: str | Path,
    steps: Sequence[Mapping[str, Any]] | None = None,
    prefix: str = "",
    beside: Mapping[str, str] | None = None,
) -> Path:
    """Write a planner as C99 that needs neither Python nor this package.

    The folder is written completely or not at all.

    Parameters
    ----------
    planner
        With the solver ``compiled``.
    folder
        A new or empty folder.
    steps
        Arguments of :meth:`gbt_ocp.ocp.planner.AnyPlanner.solve` for the recorded steps; see
        :func:`gbt_ocp.ocp.export.vectors.record`.
    prefix
        Of all names (files, functions, types, macros in capitals), for programs with several planners; see
        :func:`gbt_ocp.ocp.export.names.prefixed`.
    beside
        Further files by name: C for the same library, and programs beside the example, whose names do not begin with
        ``gbt_``.

    Raises
    ------
    ValueError
        If the solver is not ``compiled``, the problem cannot be written as C, the objective needs data and no steps are
        given, or no name of C begins with the prefix.
    FileExistsError
        If the folder exists and is not empty.
    gbt_ocp.ocp.codegen.library.CompilerError
        If there is a compiler and it cannot build the folder.
    """
    if not isinstance(planner.solver, CompiledSolver):
        raise ValueError(f"write_c: found solver {planner.solver.name!r}; allowed: 'compiled'")
    checked_prefix(prefix)
    problem, options = planner.problem, planner.solver.options
    shooting = isinstance(problem, ShootingData)
    settings = CompiledOptions.checked(options, problem.pieces, shooting=shooting)
    target = Path(folder)
    with whole_folder(target) as draft:
        generated = generate_problem(problem, settings).files
        further = dict(beside or {})
        programs = {name: text for name, text in further.items() if not name.startswith("gbt_")}
        sources = kernel_files(shooting=shooting) | generated
        sources |= {name: text for name, text in further.items() if name not in programs}
        sources["gbt_identity.h"] = identity_header(sources)
        vectors = record(planner, steps)
        texts = {f"src/{name}": text for name, text in sources.items()}
        texts |= programs | {name: _template(name) for name in ("Makefile", "example.c")}
        texts |= {"vectors.h": vectors.header, "CMakeLists.txt": _cmake_lists(sources, sorted(texts))}
        write_texts(draft, texts, prefix)
        manifest = {
            "versions": {"gbt_ocp": version("gbt_ocp"), "casadi": ca.CasadiMeta.version()},
            "prefix": prefix,
            "options": asdict(settings),
            "problem": {
                "flat_outputs": problem.vehicle.flat_dimension,
                "inputs": len(problem.vehicle.thrust_max),
                "dimension": problem.vehicle.position_dimension,
                "pieces": problem.pieces,
                "period_s": problem.period,
                **_form(problem),
                "limits": _define(generated["gbt_problem.h"], "GBT_COUNT"),
                "from_moments": from_moments(problem),
            },
            "vectors": len(vectors.statuses),
            "sizes": _sizes(draft, prefix),
        }
        write_texts(draft, {"README.md": _readme(manifest)}, prefix)
        manifest["sha256"] = {
            str(path.relative_to(draft)): hashlib.sha256(path.read_bytes()).hexdigest()
            for path in sorted(draft.rglob("*"))
            if path.is_file()
        }
        write_texts(draft, {"manifest.json": json.dumps(manifest, indent=2) + "\n"}, "")
    return target


_BETWEEN_FLAT = """Between two plans `src/gbt_follow.h` keeps the vehicle on its plan (2 rad/s is a bandwidth to
begin with), and before the first plan `src/gbt_startup.h` crosses the line of sight until the range is known; each says
how it is called."""

_BETWEEN_HELD = """Until the next plan the vehicle takes the inputs `plan.thrust[0]`, five points of the first
period, as they are or linear in time."""


def _form(problem: PosedProblem) -> dict[str, Any]:
    """What the form of the trajectories is, and its numbers."""
    if isinstance(problem, ProblemData):
        degree, continuity = problem.degree, problem.joined - 1
        text = f"flat, degree {degree}, continuous up to derivative {continuity}"
        return {"form": text, "degree": degree, "continuity": continuity}
    assert isinstance(problem, ShootingData), "there are no others"
    steps = problem.runge_kutta_steps
    return {"form": f"thrust {problem.thrust}, {steps} Runge-Kutta steps a period", "steps": steps}


def _template(name: str) -> str:
    return packaged_text("gbt_ocp.ocp.export", "templates", name)


def write_texts(folder: Path, texts: Mapping[str, str], prefix: str) -> None:
    """Write texts by the name of their file, names in both with the prefix."""
    for name, text in texts.items():
        path = folder / prefixed(name, prefix)
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(prefixed(text, prefix), encoding="utf-8")


def _define(header: str, name: str) -> int:
    return int(header.split(f"#define {name} ", 1)[1].split()[0])


def _cmake_lists(sources: Mapping[str, str], names: Sequence[str]) -> str:
    """``CMakeLists.txt`` with sources, headers that callers of the library need, and programs, all by name."""
    units = sorted(name for name in sources if name.endswith(".c"))
    headers = [name for name in ("gbt_plan.h", "gbt_pilot.h") if name in sources]
    for name in headers:
        # those of the other form of trajectories are included by neither
        included = re.findall(r'#include "(\w+\.h)"', sources[name])
        headers += [found for found in included if found in sources and found not in headers]
    text = _template("CMakeLists.txt")
    for mark, names in (("@SOURCES@", units), ("@HEADERS@", sorted(headers))):
        text = text.replace(mark, "\n  ".join(f"src/{name}" for name in names))
    programs = (name.removesuffix(".c") for name in names if "/" not in name and name.endswith(".c"))
    text = text.replace("@PROGRAMS@", " ".join(programs))
    # CMake takes no more than the numbers of a version
    return text.replace("@VERSION@", ".".join(re.findall(r"\d+", version("gbt_ocp"))[:3]))


def _sizes(draft: Path, prefix: str) -> dict[str, int | str | None]:
    """Sizes with the compiler at hand; ``None`` without one."""
    sizes: dict[str, int | str | None] = {"compiler": None, "code": None, "planner": None, "workspace": None}
    compiler, size = find_compiler(), shutil.which("size")
    if compiler is None or size is None or shutil.which("make") is None:
        return sizes
    try:
        with built(draft, "-O2") as build:
            library = build / f"lib{prefix}gbt_planner.a"
            listed = run_command([size, "-t", str(library)], build, RUN_S).stdout
            shown = run_example(build).stdout
            name = run_command([*compiler, "--version"], build, RUN_S).stdout
    except CommandError as fault:
        raise CompilerError(str(fault)) from fault
    try:
        sizes["code"] = sum(int(number) for number in listed.splitlines()[-1].split()[:2])
        sizes["compiler"] = f"{name.splitlines()[0]}, -O2"
    except (ValueError, IndexError) as fault:
        raise CompilerError(f"{size}: found {listed!r} for the generated library; allowed: its sizes") from fault
    for key, word in (("planner", "planner"), ("workspace", "workspace")):
        found = number_after(word, shown)
        sizes[key] = None if found is None else int(found)
    return sizes


def _readme(manifest: Mapping[str, Any]) -> str:
    problem, sizes = manifest["problem"], manifest["sizes"]

    def shown(name: str) -> str:
        return "not measured" if sizes[name] is None else f"{sizes[name]} bytes"

    return _template("README.md").format(
        deadline=manifest["options"]["deadline"],
        flat=problem["flat_outputs"],
        inputs=problem["inputs"],
        dimension=problem["dimension"],
        pieces=problem["pieces"],
        period=problem["period_s"],
        form=problem["form"],
        between=_BETWEEN_FLAT if "degree" in problem else _BETWEEN_HELD,
        count=problem["limits"],
        compiler=sizes["compiler"] or "no compiler",
        code=shown("code"),
        planner=shown("planner"),
        workspace=shown("workspace"),
        call="gbt_plan" if problem["from_moments"] else "gbt_plan_parameters",
        vectors=manifest["vectors"],
    )
