"""Programs for a Cortex-M7: built with arm-none-eabi-gcc, run in an emulator that counts instructions."""

import shutil
import subprocess
from pathlib import Path

import pytest

from gbt_ocp.ocp.codegen.library import find_compiler

ARM = Path(__file__).parent / "arm"
COMPILER, EMULATOR = "arm-none-eabi-gcc", "qemu-system-arm"
WARNINGS = ["-Wall", "-Wextra", "-Wpedantic", "-Wdouble-promotion", "-Werror"]
FLAGS = ["-std=c99", "-O2", "-fno-math-errno", "-ffp-contract=off", "-ffunction-sections", "-fdata-sections"]
MACHINE = ["-mcpu=cortex-m7", "-mthumb", "-mfloat-abi=hard"]
UNITS = {"double": ["-mfpu=fpv5-d16"], "single": ["-mfpu=fpv5-sp-d16", "-DGBT_SINGLE"]}
"""Flags of a precision: the floating-point unit that it needs, and the type."""

NEEDED = [
    pytest.mark.skipif(find_compiler() is None, reason="no C compiler"),
    pytest.mark.skipif(shutil.which(COMPILER) is None, reason=f"no {COMPILER}"),
]


SMALL = ["-Os", "-flto"]
"""Flags of the least flash."""


def program_of(place, sources, headers, precision, more=()):
    """The program of these sources in a folder, without a warning; skips where there is no C library.

    Flags that are given overrule the others.
    """
    found = [f"-I{folder}" for folder in (ARM, *headers)]
    target, begin = [*MACHINE, *UNITS[precision]], place / "startup.o"
    # apart: what the linker makes of all at once leaves out what only the C library calls
    subprocess.run([COMPILER, *FLAGS, *WARNINGS, *target, "-c", ARM / "startup.c", "-o", begin], check=True)
    command = [COMPILER, *FLAGS, *WARNINGS, *target, *found, *more]
    command += ["-nostartfiles", "--specs=rdimon.specs", f"-Wl,--gc-sections,-Map={place / 'map'}"]
    command += ["-T", str(ARM / "mps2.ld"), str(begin), *map(str, sources), "-lm"]
    done = subprocess.run([*command, "-o", str(place / "bench.elf")], capture_output=True, text=True, check=False)
    if done.returncode != 0 and "rdimon" in done.stderr:
        pytest.skip("no newlib for semihosting")
    assert done.returncode == 0, done.stderr
    return place / "bench.elf"


def said_by(program):
    """What a program prints on the emulated board; skips where there is no emulator."""
    if shutil.which(EMULATOR) is None:
        pytest.skip(f"no {EMULATOR}")
    command = [EMULATOR, "-M", "mps2-an500", "-nographic", "-semihosting", "-icount", "shift=0,align=off,sleep=off"]
    done = subprocess.run(
        [*command, "-kernel", program],
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        check=False,
        timeout=900,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout
