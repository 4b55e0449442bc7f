"""What a command waits for before it begins: libraries that take long to import are imported where they are needed."""

import subprocess
import sys

import pytest


@pytest.mark.parametrize(
    ("module", "slow"),
    [
        ("gbt_ocp.cli.main", {"casadi", "joblib", "matplotlib", "scipy"}),
        ("gbt_ocp.experiments.run", {"joblib", "matplotlib", "scipy.interpolate", "scipy.optimize", "scipy.signal",
                                     "scipy.stats"}),
    ],
)  # fmt: skip
def test_libraries_that_take_long_are_not_loaded(module, slow):
    assert loaded_of(slow, f"import {module}") == ""


@pytest.mark.parametrize("command", ["--help", "--version", "list", "schema", "completion bash"])
def test_commands_that_compute_nothing_load_none_of_them(command):
    run = f"from gbt_ocp.cli.main import main; main({command.split()!r})"
    assert loaded_of({"casadi", "joblib", "matplotlib", "scipy"}, run) == ""


def loaded_of(libraries, statements):
    """Those of the libraries that are loaded when the statements have run, in a process of their own."""
    script = f"import atexit, sys\natexit.register(lambda: print(*{libraries!r} & {{*sys.modules}}, file=sys.stderr))\n"
    done = subprocess.run([sys.executable, "-c", script + statements], capture_output=True, text=True, check=True)
    return done.stderr.strip()
