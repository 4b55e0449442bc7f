"""The generated folder on a Cortex-M7: built with arm-none-eabi-gcc, run in an emulator, in both precisions."""

import re

import pytest
from arm_board import ARM, NEEDED, program_of, said_by
from test_codegen import fossen

from gbt_ocp.ocp.export.folder import write_c
from gbt_ocp.ocp.planner import Planner

STEP = re.compile(
    r"step (\d+) status (\d) recorded (\d) origin (\d) iterations (\d+) objective (\S+) broken (\S+) difference (\S+)"
)

pytestmark = NEEDED


@pytest.fixture(scope="module", params=["double", "single"])
def program(request, tmp_path_factory):
    """The precision, and a program that repeats the recorded steps; without a warning."""
    place = tmp_path_factory.mktemp("arm")
    folder = write_c(Planner(fossen(2, "hard"), "compiled"), place / "planner")
    sources = [*sorted((folder / "src").glob("*.c")), ARM / "bench.c"]
    return request.param, program_of(place, sources, [folder / "src", folder], request.param)


@pytest.mark.long
def test_it_plans_on_a_microcontroller_what_was_recorded(program):
    precision, elf = program
    said = said_by(elf)
    steps = [[float(number) for number in found.groups()] for found in STEP.finditer(said)]
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
    sizes = dict(re.findall(r"(stack|planner) (\d+)", said))
    assert 500 < int(sizes["stack"]) < 6144
    print(said.splitlines()[-1])
