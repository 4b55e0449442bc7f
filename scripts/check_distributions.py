"""Builds wheel and sdist, checks them, and runs a case from each in an environment of its own.

python scripts/check_distributions.py     (needs: pip install build twine)
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import venv
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]


def call(*command: str | Path, cwd: Path) -> None:
    """Run a command, and end if it fails."""
    print("+", *command, flush=True)
    subprocess.run([str(word) for word in command], cwd=cwd, check=True)


def main() -> None:
    """Build, check, install and run."""
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        call(sys.executable, "-m", "build", "--outdir", folder / "dist", ROOT, cwd=folder)
        made = sorted((folder / "dist").iterdir())
        call(sys.executable, "-m", "twine", "check", "--strict", *made, cwd=folder)
        for file in made:
            own = folder / file.suffix.strip(".")
            venv.create(own, with_pip=True)
            call(own / "bin" / "pip", "install", "--quiet", file, cwd=folder)
            call(own / "bin" / "gbt-ocp", "run", "case2", "--set", "duration_s=1", "--out", own / "run", cwd=folder)
            assert (own / "run" / "summary.json").is_file(), file


if __name__ == "__main__":
    main()
