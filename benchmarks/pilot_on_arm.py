"""The generated pilot on an emulated Cortex-M7: flash, memory, and instructions a command.

python benchmarks/pilot_on_arm.py [--only case2 case5 sea2d ekf motion_gp]

A recorded closed loop runs on ``qemu-system-arm -M mps2-an500``, built by ``arm-none-eabi-gcc`` with ``-O2``, or with
``-Os -flto`` for the least flash, by the program of ``tests/test_pilot_on_arm.py``. Instructions are those of
navigation, measurement and command together, not cycles. Flash is code and constants of the library, without libm.
"""

from __future__ import annotations

import argparse
import re
import sys
import tempfile
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))
import numpy as np
import test_pilot_on_arm as board
from arm_board import SMALL, program_of

PILOTS = {
    "case2": ("case 2, `gp`", "case2", "seed=0", 100),
    "case5": ("case 5, `gp`", "case5", "seed=0", 100),
    "sea2d": ("sea2d as shipped, `mixture`", "sea2d", "seed=0", 300),
    "ekf": ("sea2d, `ekf`", "sea2d", "tracker.kind=ekf", 100),
    "motion_gp": ("sea2d, `motion_gp`", "sea2d", "tracker.kind=motion_gp", 100),
}
"""By name: what the table calls it, configuration, what is changed, commands."""

PLACED = r"^ \.(?:text|rodata|data)\S*\s+0x[0-9a-f]+\s+(0x[0-9a-f]+) \S*(?:ltrans|/cc)\S*\.o"
"""Sections of what was compiled for the link, in the linker's map."""


def flash(place: Path, precision: str, flags: list[str]) -> int:
    """Bytes of code and constants of the pilot in a folder, in a program that does little else."""
    (place / "caller.c").write_text(board.CALLER, encoding="utf-8")
    program_of(place, [*sorted(place.glob("gbt_*.c")), place / "caller.c"], [place], precision, flags)
    placed = (place / "map").read_text().split("Linker script and memory map")[1]
    return sum(int(size, 16) for size in re.findall(PLACED, placed, re.MULTILINE))


def row(name: str, precision: str, flags: list[str]) -> list[str]:
    """Sizes in kB and millions of instructions of one pilot."""
    title, problem, change, commands = PILOTS[name]
    with tempfile.TemporaryDirectory() as scratch:
        place = Path(scratch)
        _, steps, sizes = board.steps_on_the_board(place, problem, change, commands, precision, flags)
        code = flash(place, precision, flags)
    took: Any = 1e-6 * steps["instructions"]
    # a plan counts with the commands until the next one, ten a second
    begins = [k for k in np.flatnonzero(steps["planned"]) if k + 10 <= len(took)]
    seconds = np.array([took[k : k + 10].sum() for k in begins])
    built = "-Os -flto" if flags else "-O2"
    sizes_kb = [f"{code / 1000:.1f}", f"{sizes['pilot'] / 1000:.1f} + {sizes['stack'] / 1000:.1f}"]
    ends = [f"{seconds.mean():.0f}", f"{seconds.max():.0f}"]
    return [title, precision, f"`{built}`", *sizes_kb, f"{took.mean():.2f}", f"{took.max():.1f}", *ends]


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--only", nargs="+", choices=list(PILOTS), default=list(PILOTS))
    arguments = parser.parse_args()
    heads = [
        "pilot",
        "precision",
        "built with",
        "flash, kB",
        "RAM: pilot + stack, kB",
        "million instructions a command",
    ]
    heads += ["at most", "a second with a plan", "at most"]
    print("| " + " | ".join(heads) + " |\n|" + "---|" * len(heads))
    for name in arguments.only:
        for precision in ("double", "single"):
            for flags in ([], SMALL):
                print("| " + " | ".join(row(name, precision, flags)) + " |", flush=True)


if __name__ == "__main__":
    main()
