"""Smoke tests with the lowest stated versions of the run-time dependencies, and with the newest.

    python scripts/check_bounds.py lowest newest

Makes an environment of its own for each, installs the package there, runs an experiment, verifies its generated C and
runs a few files of tests. Exit code 1 if anything fails. Fit for a job of continuous integration.
"""

from __future__ import annotations

import argparse
import re
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
TESTS = (
    "test_compiled_solver.py",
    "test_ipopt.py",
    "test_gp_tracker.py",
    "test_motion_gp.py",
    "test_where_results_go.py",
)


def lowest() -> list[str]:
    """``name==version`` of every run-time dependency, from its lower bound in pyproject.toml."""
    with (ROOT / "pyproject.toml").open("rb") as stream:
        dependencies = tomllib.load(stream)["project"]["dependencies"]
    found = []
    for entry in dependencies:
        bound = re.fullmatch(r"([A-Za-z0-9_.-]+)>=([0-9.]+)(,.*)?", entry)
        if bound is None:
            raise SystemExit(f"pyproject.toml: dependencies: found {entry!r}; allowed: NAME>=VERSION")
        found.append(f"{bound[1]}=={bound[2]}")
    return found


def check(which: str, folder: Path) -> bool:
    """Whether everything works in a fresh environment."""
    python = folder / "environment" / "bin" / "python"
    constraints = folder / "constraints.txt"
    constraints.write_text("\n".join(lowest() if which == "lowest" else []) + "\n", encoding="utf-8")
    pip = [str(python), "-m", "pip", "install", "--quiet"]
    command = str(python.with_name("gbt-ocp"))
    steps = [
        [sys.executable, "-m", "venv", str(folder / "environment")],
        [*pip, "--constraint", str(constraints), str(ROOT), "pytest", "pytest-xdist", "hypothesis", "scikit-learn"],
        [str(python), "-m", "pip", "freeze"],
        [command, "run", "case2", "--set", "duration_s=2", "--out", str(folder / "run"), "--quiet"],
        [command, "codegen", "case2", "--set", "duration_s=2", "--out", str(folder / "c"), "--verify"],
        [str(python), "-m", "pytest", "-q", *(str(ROOT / "tests" / name) for name in TESTS)],
    ]
    for step in steps:
        print(f"{which}: {' '.join(step)}", flush=True)
        if subprocess.run(step, cwd=folder, check=False).returncode != 0:
            print(f"{which}: failed", flush=True)
            return False
    return True


def main() -> int:
    """Check what is asked for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("which", nargs="+", choices=("lowest", "newest"))
    good = True
    for which in parser.parse_args().which:
        with tempfile.TemporaryDirectory(prefix="gbt-ocp-bounds-") as folder:
            good = check(which, Path(folder)) and good
    return 0 if good else 1


if __name__ == "__main__":
    raise SystemExit(main())
