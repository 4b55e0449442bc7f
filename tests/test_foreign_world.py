"""The pilot in a simulator that was written elsewhere."""

import re
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("auv_sim_bench", reason="pip install auv-sim-bench")

PAGE = Path(__file__).resolve().parents[1] / "docs" / "howto" / "foreign_world.md"


def loop(steps, seed=1):
    """What the program of the page leaves, after so many steps."""
    (program,) = re.findall(r"^```python\n(.*?)^```$", PAGE.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)
    assert "range(1200)" in program
    program = program.replace("range(1200)", f"range({steps})").replace("errors[600:]", f"errors[{steps // 2}:]")
    names = {}
    exec(compile(program.replace("default_rng(1)", f"default_rng({seed})"), PAGE.name, "exec"), names)
    return names


@pytest.mark.long
def test_the_loop_closes_in_a_world_written_elsewhere(capsys):
    names = loop(400)
    health = names["command"].health
    assert health.planner in ("solved", "given up")
    assert health.bearing_age <= 0.1
    assert np.linalg.norm(names["world"].s.v) > 0.2
    assert "nearest" in capsys.readouterr().out


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_it_settles_there_and_keeps_the_standoff(seed):
    names = loop(1800, seed)
    assert np.median(names["errors"][900:]) < 0.05
    assert np.min(names["ranges"]) >= 30.0
