"""A folder of C that stands alone: the planner for one problem, an example, and recorded steps to hold it against."""

from __future__ import annotations

import hashlib
import json
import os
import shlex
import shutil
import subprocess
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from importlib.metadata import version
from pathlib import Path
from typing import Any

import casadi as ca

from gbt_ocp.files import packaged_text
from gbt_ocp.ocp.codegen.library import find_compiler, kernel_files
from gbt_ocp.ocp.codegen.options import CompiledOptions
from gbt_ocp.ocp.codegen.problem_source import from_moments, generate_problem
from gbt_ocp.ocp.export.vectors import record
from gbt_ocp.ocp.planner import TIGHTENINGS, Planner
from gbt_ocp.ocp.solvers.compiled import CompiledSolver


def free_folder(folder: str | Path) -> Path:
    """The path, if it names a new or empty folder.

    Raises
    ------
    FileExistsError
        If there is something.
    """
    target = Path(folder)
    if target.exists() and not (target.is_dir() and not any(target.iterdir())):
        raise FileExistsError(f"found {target}, which is not an empty folder; allowed: a new or empty folder")
    return target


def write_c(planner: Planner, folder: str | Path, steps: Sequence[Mapping[str, Any]] | None = None) -> Path:
    """Write a planner as C99 that needs neither Python nor this package.

    The folder is written whole or not at all.

    Parameters
    ----------
    planner
        With the solver ``compiled``.
    folder
        A new or empty folder.
    steps
        Arguments of :meth:`gbt_ocp.ocp.planner.Planner.solve` for the recorded steps; see
        :func:`gbt_ocp.ocp.export.vectors.record`.

    Raises
    ------
    ValueError
        If the solver is not ``compiled``, the problem cannot be written as C, or the objective needs data and no steps
        are given.
    FileExistsError
        If the folder is there and not empty.
    """
    if not isinstance(planner.solver, CompiledSolver):
        raise ValueError(f"write_c: found solver {planner.solver.name!r}; allowed: 'compiled'")
    target = free_folder(folder)
    problem, options = planner.problem, planner.solver.options
    settings = CompiledOptions.checked(options, problem.pieces)
    generated = generate_problem(problem, settings).files
    vectors = record(problem, options, steps)
    sources = {f"src/{name}": text for name, text in (kernel_files() | generated).items()}
    texts = sources | {"vectors.h": vectors.header} | {name: _template(name) for name in _VERBATIM}
    manifest = {
        "versions": {"gbt_ocp": version("gbt_ocp"), "casadi": ca.CasadiMeta.version()},
        "options": asdict(settings),
        "problem": {
            "flat_outputs": problem.vehicle.flat_dimension,
            "inputs": len(problem.vehicle.thrust_max),
            "dimension": problem.vehicle.position_dimension,
            "pieces": problem.pieces,
            "period_s": problem.period,
            "degree": problem.degree,
            "continuity": problem.joined - 1,
            "limits": _define(generated["gbt_problem.h"], "GBT_COUNT"),
            "from_moments": from_moments(problem),
        },
        "vectors": len(vectors.statuses),
    }
    target.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=target.parent, prefix=f".{target.name}-") as scratch:
        draft = Path(scratch) / target.name
        _write(draft, texts)
        manifest["sizes"] = _sizes(draft, Path(scratch))
        _write(draft, {"README.md": _readme(manifest)})
        manifest["sha256"] = {
            str(path.relative_to(draft)): hashlib.sha256(path.read_bytes()).hexdigest()
            for path in sorted(draft.rglob("*"))
            if path.is_file()
        }
        _write(draft, {"manifest.json": json.dumps(manifest, indent=2) + "\n"})
        if target.exists():
            target.rmdir()
        os.replace(draft, target)
    return target


_VERBATIM = ("Makefile", "CMakeLists.txt", "example.c")


def _template(name: str) -> str:
    return packaged_text("gbt_ocp.ocp.export", "templates", name)


def _write(folder: Path, texts: Mapping[str, str]) -> None:
    for name, text in texts.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")


def _define(header: str, name: str) -> int:
    return int(header.split(f"#define {name} ", 1)[1].split()[0])


def _sizes(draft: Path, scratch: Path) -> dict[str, int | str | None]:
    """Sizes with the compiler at hand; ``None`` without one."""
    nothing: dict[str, int | str | None] = {"compiler": None, "code": None, "planner": None, "workspace": None}
    compiler, make, size = find_compiler(), shutil.which("make"), shutil.which("size")
    if compiler is None or make is None or size is None:
        return nothing
    out = scratch.resolve() / "sizes"  # make runs in another folder
    command = [make, "-C", str(draft), f"OUT={out}", f"CC={shlex.join(compiler)}"]
    built = subprocess.run(command, capture_output=True, text=True, check=False)
    if built.returncode != 0:
        raise RuntimeError(f"the generated code does not compile: {built.stderr.strip()[-2000:]}")
    command = [size, "-t", str(out / "libgbt_planner.a")]
    measured = subprocess.run(command, capture_output=True, text=True, check=True)
    text, data = (int(number) for number in measured.stdout.splitlines()[-1].split()[:2])
    shown = subprocess.run([str(out / "example")], capture_output=True, text=True, check=False)
    words = shown.stdout.splitlines()[-1].split()
    name = subprocess.run([*compiler, "--version"], capture_output=True, text=True, check=False).stdout.splitlines()[0]
    return {
        "compiler": f"{name}, -O2",
        "code": text + data,
        "planner": int(words[words.index("planner") + 1]),
        "workspace": int(words[words.index("workspace") + 1]),
    }


def _readme(manifest: Mapping[str, Any]) -> str:
    problem, sizes = manifest["problem"], manifest["sizes"]

    def shown(name: str) -> str:
        return "not measured" if sizes[name] is None else f"{sizes[name]} bytes"

    return _template("README.md").format(
        attempts=2 * (TIGHTENINGS + 1),
        deadline=manifest["options"]["deadline"],
        flat=problem["flat_outputs"],
        inputs=problem["inputs"],
        dimension=problem["dimension"],
        pieces=problem["pieces"],
        period=problem["period_s"],
        degree=problem["degree"],
        continuity=problem["continuity"],
        count=problem["limits"],
        compiler=sizes["compiler"] or "no compiler",
        code=shown("code"),
        planner=shown("planner"),
        workspace=shown("workspace"),
        call="gbt_plan" if problem["from_moments"] else "gbt_plan_parameters",
        vectors=manifest["vectors"],
    )
