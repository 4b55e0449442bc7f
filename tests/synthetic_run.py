"""A made-up run for the tests of results and figures: a vehicle circling a moving target, with every kind of step."""

from dataclasses import dataclass

import numpy as np

from gbt_ocp.simulation.history import History
from gbt_ocp.simulation.summary import installed_versions, summarise

PERIOD = 0.1
CONFIGURATION = """\
problem: made_up
seed: 3
sensor: {{period_s: 0.1}}
vehicle: {{thrust_max: {limits}}}
"""


@dataclass
class StandInConfiguration:
    text: str

    def to_yaml(self) -> str:
        return self.text


def configuration(dimension: int) -> StandInConfiguration:
    limits = [5000.0] * dimension + [1500.0]
    return StandInConfiguration(CONFIGURATION.format(limits=limits))


def history(dimension: int = 2, steps: int = 300, planner: bool = True, tuned: bool = True) -> History:
    rng = np.random.default_rng(7)
    count, forecast, pieces, outputs = steps + 1, 11, 5, dimension + 1
    t = PERIOD * np.arange(count)

    def target_at(time):
        path = [3.0 * np.sin(0.25 * time), 2.0 * np.sin(0.5 * time) + 0.1 * time, 0.08 * time]
        return np.stack(path[:dimension], axis=-1)

    target = target_at(t)
    radius = 0.7 + 3.5 * np.exp(-t / 1.2)
    turn = np.stack([np.cos(2.0 * t), np.sin(2.0 * t), 0.2 * np.sin(t)][:dimension], axis=-1)
    position = target + radius[:, None] * turn
    line = target - position
    bearing = line / np.linalg.norm(line, axis=1, keepdims=True)
    detected = rng.random(count) > 0.03
    pose = np.column_stack([position, 0.3 * np.sin(0.4 * t)])

    times = t[:, None] + PERIOD * np.arange(forecast + 1)
    scale = 2.0 * np.exp(-t / 0.5) + 0.004 * (1.0 + 0.5 * np.sin(t))
    offset = scale[:, None, None] * (1.0 + 0.2 * np.arange(forecast + 1))[None, :, None]
    mean = target_at(times) + offset * rng.normal(size=(count, 1, dimension))
    error = np.linalg.norm(mean - target_at(times), axis=2)
    condition = 1.0 + 400.0 * np.exp(-t / 0.6)
    condition[:3] = np.inf
    bound = error * (8.0 + 3.0 * np.sin(0.7 * t))[:, None]
    bound[:3] = np.inf

    axes = np.arange(outputs)
    thrust = np.array([5000.0] * dimension + [1500.0]) * 0.9 * np.sin(1.3 * t[:, None] + axes)
    peak = np.minimum(1.0, np.abs(np.sin(1.3 * t[:, None] + axes)) + 0.05)
    peak[-1] = np.nan
    status = np.full(count, "solved", dtype="U40")
    fallback = np.full(count, "", dtype="U10")
    solver_time = 0.008 + 0.004 * rng.gamma(2.0, size=count)
    if planner:
        peak[min(40, steps - 1), 0] = 1.08
        for step, answer in ((1, "cold"), (30, "shifted"), (31, "shifted"), (77, "braking"), (120, "")):
            if step < count:
                status[step], fallback[step], solver_time[step] = "Infeasible_Problem_Detected", answer, 0.14
    else:
        status[:], solver_time[:] = "", np.nan
    unknown = np.full(count, np.nan)
    arrays = {
        "t": t,
        "vehicle_pose": pose,
        "vehicle_velocity": np.gradient(pose, PERIOD, axis=0),
        "thrust": thrust,
        "target": target,
        "bearing": np.where(detected[:, None], bearing, np.nan),
        "detected": detected,
        "forecast_mean": mean,
        "forecast_cov": np.broadcast_to(np.eye(dimension), (count, forecast + 1, dimension, dimension)),
        "error": error,
        "length_scale": 3.0 + np.sin(0.3 * t) if tuned else unknown,
        "amplitude": 2.0 + 4.0 * np.exp(-t) if tuned else unknown,
        "condition_number": condition,
        "bound": bound,
        "objective": 3.0 + np.sin(t) if planner else unknown,
        "violation": np.zeros(count) if planner else unknown,
        "solver_status": status,
        "solver_iterations": np.full(count, 17) if planner else np.zeros(count),
        "solver_time": solver_time,
        "plan": rng.normal(size=(count, pieces if planner else 0, outputs)),
        "tracker_time": 0.002 + 0.001 * rng.random(count),
        "nugget": np.full(count, 1e-10),
        "prior_cov": np.broadcast_to(4.0 * np.eye(dimension), (count, dimension, dimension)),
        "fallback": fallback,
        "desired_bearing": bearing,
        "piece_thrust_peak": peak,
        "off_plan": np.zeros(count) if planner else unknown,
    }
    return History.of(arrays)


def summary(run: History) -> dict:
    return summarise(
        run,
        period=PERIOD,
        seed=3,
        wall_s=12.5,
        solver_first_try=run.solver_status == "solved",
        retries={"nugget": 2},
        versions=installed_versions(),
    )
