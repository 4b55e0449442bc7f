"""A limit that a user defines in the file of a problem: one function, from the key to the run."""

import json
import os
import subprocess
import sys
from pathlib import Path

import yaml

ROOT = Path(__file__).parents[1]

OWN = '''
import casadi as ca
import numpy as np

from gbt_ocp import TrackingProblem
from gbt_ocp.experiments.config.keys import key
from gbt_ocp.experiments.config.limits import limit


class NorthLimit:
    """y <= north."""

    def __init__(self, north):
        self.lower, self.upper = np.array([-np.inf]), np.array([north])
        self.scale, self.backoff = np.ones(1), np.zeros(1)

    def value(self, point):
        return point.z[1]


@limit("north", "north_m", float | None, key(None, "Largest y in m."))
def north(value, problem):
    yield NorthLimit(value)


problem = TrackingProblem("own", 2, "A target in the north.", target={"kind": "case1"})
'''

SCRIPT = """
import json, sys
import gbt_ocp as gbt
from gbt_ocp.experiments.config.json_schema import json_schema

configuration = gbt.load_config("own.yaml")
free = gbt.run("own.yaml", overrides=["limits.north_m=null", "limits.hard=[]"])
kept = gbt.run(configuration)
try:
    gbt.load_config("own.yaml", overrides=["limits.north_m=far", "limits.hard=[south]"])
except gbt.ConfigurationError as error:
    faults = error.faults
described = json_schema()["$defs"]["LimitsSection"]["properties"]
print(json.dumps({
    "written": configuration.to_mapping()["limits"],
    "free": free.history.vehicle_pose[:, 1].max(),
    "kept": kept.history.vehicle_pose[:, 1].max(),
    "faults": faults,
    "described": described["north_m"]["description"],
    "order": list(described),
}))
"""


def test_a_limit_is_added_from_outside_in_one_place(tmp_path):
    (tmp_path / "own.py").write_text(OWN)
    settings = {
        "problem": "own.py",
        "duration_s": 1.0,
        "planner": {"solver": "ipopt", "formulation": "hard", "pieces": 3},
        "vehicle": {"start": {"position_m": [0.0, 0.0]}},
        "tracker": {"prior": {"position": [0.0, 4.0], "std": 1.0}},
        "limits": {"north_m": 0.3, "hard": ["north"]},
    }
    (tmp_path / "own.yaml").write_text(yaml.safe_dump(settings))
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT], cwd=tmp_path, env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert found["written"]["north_m"] == 0.3
    assert found["written"]["hard"] == ["north"]
    assert found["free"] > 0.4
    assert found["kept"] < 0.3 + 1e-6
    assert [line.split(": ", 1)[1] for line in found["faults"]] == [
        'limits.north_m: found "far"; allowed: null, or a number',
        'limits.hard: found ["south"]; allowed: a list of range, keep_out, separation, depth, speed, speed_min, '
        "turn_radius, pitch, input_rate, yaw_rate, bow_angle, north",
    ]
    assert found["described"] == "Largest y in m. Allowed: null, or a number."
    assert found["order"] == [
        "range", "keep_out", "separation_m", "depth", "speed", "speed_min", "turn_radius_m", "pitch_deg",
        "input_rate", "yaw_rate_deg", "bow_angle_deg", "north_m", "hard", "weight", "width", "nodes",
    ]  # fmt: skip
