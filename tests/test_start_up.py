"""What a command waits for before it begins: libraries that take long to import are imported where they are needed."""

import subprocess
import sys

import pytest


@pytest.mark.parametrize(
    ("module", "slow"),
    [
        pytest.param(
            "gbt_ocp.cli.main",
            {"casadi", "joblib", "matplotlib", "scipy"},
            marks=pytest.mark.xfail(strict=True, reason="the registry of trackers imports every tracker"),
        ),
        ("gbt_ocp.experiments.run", {"joblib", "matplotlib", "scipy.interpolate", "scipy.optimize", "scipy.signal",
                                     "scipy.stats"}),
    ],
)  # fmt: skip
def test_libraries_that_take_long_are_not_loaded(module, slow):
    script = f"import sys, {module}; print(*sorted({slow!r} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout == "\n"
