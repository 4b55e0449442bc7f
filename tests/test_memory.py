"""Memory of a long run: a step costs what it adds to ``history.npz``, at most twice."""

import json
import subprocess
import sys
import tracemalloc
from dataclasses import replace

import numpy as np
import pytest

from gbt_ocp.experiments.build.loop import build_loop
from gbt_ocp.experiments.config.loading import load_config
from gbt_ocp.guidance.strategy import Placement
from gbt_ocp.simulation.loop import simulate
from gbt_ocp.tracking.protocol import Forecast

MEGABYTE = 2**20


class Still:
    """A tracker that always says the same, so that a run of minutes is quick."""

    def update(self, time, bearing, own_position):
        pass

    def predict(self, times):
        return Forecast(np.zeros((len(times), 2)), np.tile(np.eye(2), (len(times), 1, 1)))


class Stays:
    def decide(self, time, flat, forecast):
        return Placement(flat[0][:2])


def held(history):
    return sum(array.nbytes for array in vars(history).values())


@pytest.mark.long
def test_minutes_take_at_most_twice_what_the_history_holds():
    loop, start = build_loop(load_config("case2", ["planner.solver=ipopt"]))
    loop = replace(loop, tracker=Still(), guidance=Stays())
    simulate(loop, start, 2.0)
    peaks, sizes = [], []
    tracemalloc.start()
    try:
        for minutes in (0.5, 3.0):
            before = tracemalloc.get_traced_memory()[0]
            tracemalloc.reset_peak()
            sizes.append(held(simulate(loop, start, 60.0 * minutes).history))
            peaks.append(tracemalloc.get_traced_memory()[1] - before)
    finally:
        tracemalloc.stop()
    steps = 1500
    assert sizes[1] - sizes[0] > 500 * steps
    assert peaks[1] - peaks[0] <= 2 * (sizes[1] - sizes[0])


HOUR = """
import json, resource, sys
import gbt_ocp as gbt

def most():  # bytes; ru_maxrss is in kilobytes, and in bytes on macOS
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * (1 if sys.platform == "darwin" else 1024)

name, duration = sys.argv[1], float(sys.argv[2])
gbt.run(name, overrides=["duration_s=120"])
before = most()
history = gbt.run(name, overrides=[f"duration_s={duration}"]).history
print(json.dumps([most() - before, sum(array.nbytes for array in vars(history).values()), len(history.t)]))
"""


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="the resource module is of POSIX")
@pytest.mark.parametrize("name", ["case2", "sea2d"])
def test_an_hour_takes_at_most_twice_what_the_history_holds(name):
    done = subprocess.run([sys.executable, "-c", HOUR, name, "3600"], check=True, capture_output=True, text=True)
    grown, size, steps = json.loads(done.stdout.splitlines()[-1])
    print(f"{name}: {steps} steps, {size / MEGABYTE:.1f} MB of arrays, memory grown by {grown / MEGABYTE:.1f} MB")
    assert size > 10 * MEGABYTE
    assert grown <= 2 * size
