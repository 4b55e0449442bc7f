"""What travels in the wheel, and that it runs away from the checkout."""

import importlib
import os
import shutil
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))


def shipped(folder):
    """Files of a folder that belong to the project, relative to it."""
    return {
        path.relative_to(ROOT / folder).as_posix()
        for path in (ROOT / folder).rglob("*")
        if path.is_file() and "__pycache__" not in path.parts
    }


def test_what_the_build_names_exists():
    for source in PROJECT["tool"]["hatch"]["build"]["targets"]["wheel"]["force-include"]:
        assert shipped(source), source
    for name in (PROJECT["project"]["readme"], *PROJECT["project"]["license-files"]):
        assert (ROOT / name).is_file()
    for entry in PROJECT["project"]["scripts"].values():
        module, _, function = entry.partition(":")
        assert callable(getattr(importlib.import_module(module), function))


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    """A wheel built from the checkout, without the network: hatchling is one of the extra `dev`."""
    pytest.importorskip("hatchling", reason="hatchling is not installed; it comes with the extra `dev`")
    folder = tmp_path_factory.mktemp("wheel")
    command = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(folder)]
    subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True)
    (path,) = folder.glob("*.whl")
    return path


def test_the_wheel_carries_the_package_the_problems_and_the_configurations(wheel):
    names = set(zipfile.ZipFile(wheel).namelist())
    wanted = {f"gbt_ocp/{name}" for name in shipped("gbt_ocp")}
    wanted |= {f"gbt_ocp/_problems/{name}" for name in shipped("problems")}
    wanted |= {f"gbt_ocp/_configs/{name}" for name in shipped("configs")}
    # What is not Python is what gets lost.
    for kind in (".c", ".h", ".yaml", "py.typed", "Makefile", "CMakeLists.txt"):
        assert any(name.endswith(kind) for name in wanted), kind
    metadata = {name for name in names if name.split("/")[0].endswith(".dist-info")}
    assert names - metadata == wanted
    assert any(name.endswith("licenses/LICENSE") for name in metadata)


@pytest.mark.long
def test_the_wheel_runs_away_from_the_checkout(wheel, tmp_path):
    site, elsewhere = tmp_path / "site", tmp_path / "elsewhere"
    zipfile.ZipFile(wheel).extractall(site)
    elsewhere.mkdir()
    # The compiled solver is built from the kernel sources of the wheel, in a cache of its own.
    environment = os.environ | {"PYTHONPATH": str(site), "XDG_CACHE_HOME": str(tmp_path / "cache")}
    where = [sys.executable, "-c", "import gbt_ocp; print(gbt_ocp.__file__)"]
    found = subprocess.run(where, cwd=elsewhere, env=environment, check=True, capture_output=True, text=True)
    assert Path(found.stdout.strip()) == site / "gbt_ocp" / "__init__.py"
    run = [sys.executable, "-m", "gbt_ocp.cli", "run", "case2", "--no-figures", "--quiet", "--set", "duration_s=1"]
    done = subprocess.run(run, cwd=elsewhere, env=environment, check=False, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")
    folder = elsewhere / "runs" / "case2-default-penalty-seed0"
    assert sorted(path.name for path in folder.iterdir()) == ["config.yaml", "history.npz", "summary.json"]


@pytest.mark.slow
def test_the_first_command_of_the_readme_runs_in_a_copy(tmp_path):
    """Installs from the package index, so it needs the network."""
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    command = next(line.strip() for line in readme.splitlines() if line.startswith("    python3 -m venv"))
    copy = tmp_path / "copy"
    shutil.copytree(ROOT, copy, ignore=shutil.ignore_patterns(".git", ".venv", "runs", "__pycache__", ".*_cache"))
    done = subprocess.run(["bash", "-c", command], cwd=copy, check=False, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert len(list(copy.glob("runs/case2-*/figures/*.png"))) == 6
