"""Motion under held inputs in one call, against SciPy's solver of high order, with lag, force and all else."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import gbt_ocp as gbt
from gbt_ocp.experiments.build.loop import build_vehicle
from gbt_ocp.models.fossen import rotation
from gbt_ocp.simulation.held_inputs import HeldInputs
from gbt_ocp.simulation.plant import Held, Motion, Plant

VEHICLES = {2: build_vehicle(gbt.load_config("sea2d")), 3: build_vehicle(gbt.load_config("sea3d"))}


def moving(dimension, rng):
    """A state at some metres a second, and thrust in its limits."""
    vehicle = VEHICLES[dimension]
    n = vehicle.flat_dimension
    state = np.concatenate([rng.normal(size=n), [2.5, 0.4, 0.3, -0.5][: n - 1], [0.6]])
    return vehicle, state, rng.uniform(-1.0, 1.0, n) * vehicle.thrust_max


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize(("lag", "pushed"), [(0.0, False), (0.3, True)])
@pytest.mark.parametrize("duration", [0.02, 0.1, 0.73])
def test_state_and_work_are_those_of_a_solver_of_order_eight(dimension, lag, pushed, duration):
    vehicle, state, asked = moving(dimension, np.random.default_rng(dimension))
    n = vehicle.flat_dimension
    push = np.array([40.0, -25.0, 10.0, 4.0])[-n:] if pushed else None
    acting = 0.3 * asked

    def rates(time, y):
        held = y[2 * n : -1] if lag > 0.0 else asked
        force = held + (rotation(y[n - 1], n).T @ push if pushed else 0.0)
        change = [(asked - held) / lag] if lag > 0.0 else []
        return np.concatenate([vehicle.rates(y[: 2 * n], force), *change, [np.abs(held * y[n : 2 * n]).sum()]])

    x = np.concatenate([state, acting]) if lag > 0.0 else state
    exact = solve_ivp(rates, (0.0, duration), np.append(x, 0.0), "DOP853", rtol=1e-12, atol=1e-13, max_step=0.01)
    found, work = HeldInputs(vehicle, lag, push).advance(x, asked, duration)
    np.testing.assert_allclose(found, exact.y[:-1, -1], rtol=1e-7, atol=2e-8)  # each step to 1e-8
    assert work == pytest.approx(exact.y[-1, -1], rel=1e-5)  # no smooth integrand


def test_what_is_not_exact_enough_is_left_to_the_solver_with_steps_of_its_own():
    """At 3,000 times the speed."""
    vehicle, state, asked = moving(2, np.random.default_rng(0))
    fast = state.copy()
    fast[3:] *= 3000.0
    assert HeldInputs(vehicle, 0.0, None).advance(fast, asked, 0.1) is None
    own = Motion(Plant(vehicle)).advance(fast, Held(asked), 0.1)
    by_time = Motion(Plant(vehicle)).advance(fast, lambda s: asked, 0.1)
    np.testing.assert_array_equal(own, by_time)


def test_a_motion_under_held_inputs_is_that_under_inputs_by_the_time():
    """Through a dead time, thrusters that lag, and a force: commands one after the other."""
    vehicle, begin, _ = moving(3, np.random.default_rng(1))
    ends = []
    for held in (True, False):
        motion = Motion(Plant(vehicle, 0.9, 0.3, 0.04, [20.0, 30.0, 0.0, 1.0]))
        state, rng = begin, np.random.default_rng(2)
        for _ in range(12):
            inputs = rng.uniform(-1.0, 1.0, 4) * vehicle.thrust_max
            state = motion.advance(state, Held(inputs) if held else lambda s, asked=inputs: asked, 0.1)
        ends.append((state, motion.work))
    np.testing.assert_allclose(ends[0][0], ends[1][0], rtol=1e-6, atol=1e-7)
    assert ends[0][1] == pytest.approx(ends[1][1], rel=2e-3)  # by nine points a stretch
