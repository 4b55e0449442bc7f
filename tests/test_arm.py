"""The generated folder on a Cortex-M7: built with arm-none-eabi-gcc, run in an emulator, in both precisions."""

import re
import shutil
import subprocess
from pathlib import Path

import pytest
from test_codegen import fossen

from gbt_ocp.ocp.codegen.library import find_compiler
from gbt_ocp.ocp.export.folder import write_c
from gbt_ocp.ocp.planner import Planner

ARM = Path(__file__).parent / "arm"
COMPILER, EMULATOR = "arm-none-eabi-gcc", "qemu-system-arm"
WARNINGS = ["-Wall", "-Wextra", "-Wpedantic", "-Wdouble-promotion", "-Werror"]
FLAGS = ["-std=c99", "-O2", "-fno-math-errno", "-ffp-contract=off", "-ffunction-sections", "-fdata-sections"]
MACHINE = ["-mcpu=cortex-m7", "-mthumb", "-mfloat-abi=hard"]
STEP = re.compile(
    r"step (\d+) status (\d) recorded (\d) origin (\d) iterations (\d+) objective (\S+) broken (\S+) difference (\S+)"
)

pytestmark = [
    pytest.mark.skipif(find_compiler() is None, reason="no C compiler"),
    pytest.mark.skipif(shutil.which(COMPILER) is None, reason=f"no {COMPILER}"),
]


@pytest.fixture(scope="module", params=["double", "single"])
def program(request, tmp_path_factory):
    """The precision, and a program that repeats the recorded steps; without a warning."""
    place = tmp_path_factory.mktemp("arm")
    folder = write_c(Planner(fossen(2, "hard"), "compiled"), place / "planner")
    own = ["-mfpu=fpv5-d16"] if request.param == "double" else ["-mfpu=fpv5-sp-d16", "-DGBT_SINGLE"]
    command = [COMPILER, *FLAGS, *WARNINGS, *MACHINE, *own, f"-I{folder / 'src'}", f"-I{folder}"]
    command += ["-nostartfiles", "--specs=rdimon.specs", "-Wl,--gc-sections", "-T", str(ARM / "mps2.ld")]
    sources = [*sorted((folder / "src").glob("*.c")), ARM / "startup.c", ARM / "bench.c"]
    command += [*map(str, sources), "-lm", "-o", str(place / "bench.elf")]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0 and "rdimon" in done.stderr:
        pytest.skip("no newlib for semihosting")
    assert done.returncode == 0, done.stderr
    return request.param, place / "bench.elf"


def test_it_plans_on_a_microcontroller_what_was_recorded(program):
    if shutil.which(EMULATOR) is None:
        pytest.skip(f"no {EMULATOR}")
    precision, elf = program
    command = [EMULATOR, "-M", "mps2-an500", "-nographic", "-semihosting", "-icount", "shift=0,align=off,sleep=off"]
    done = subprocess.run(
        [*command, "-kernel", elf], stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False, timeout=300
    )
    assert done.returncode == 0, done.stdout + done.stderr
    steps = [[float(number) for number in found.groups()] for found in STEP.finditer(done.stdout)]
    assert len(steps) == 20
    same = [step for step in steps if step[1] == step[2]]
    differences = sorted(step[7] for step in same)
    if precision == "double":
        assert len(same) == 20
        assert differences[-1] < 1e-9
    else:
        # now and then a step's last bits decide; such plans are answered by a fallback
        assert len(same) >= 18
        assert differences[len(differences) // 2] < 1e-4
    assert all(step[6] <= 1e-6 for step in steps), "every first piece keeps the limits"
    sizes = dict(re.findall(r"(stack|planner) (\d+)", done.stdout))
    assert 500 < int(sizes["stack"]) < 4096
    print(done.stdout.splitlines()[-1])
