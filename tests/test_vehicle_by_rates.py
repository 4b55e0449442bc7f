"""A vehicle of the user's that is known by its rates alone: what is made of them, plans, runs and C."""

import importlib.util
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from gbt_ocp.cli import main as cli
from gbt_ocp.experiments.build.loop import build_loop
from gbt_ocp.experiments.config.faults import ConfigurationError
from gbt_ocp.experiments.config.loading import load_config
from gbt_ocp.models.contracts import ContractError
from gbt_ocp.models.dynamics import Dynamics, differentiated, integrated
from gbt_ocp.models.known_vehicles import KNOWN_DRIVEN
from gbt_ocp.models.vehicle_by_rates import VehicleByRates
from gbt_ocp.simulation.loop import simulate

FILE = Path(__file__).resolve().parents[1] / "docs" / "tutorial" / "new_driven_vehicle.py"


def boat():
    spec = importlib.util.spec_from_file_location("new_driven_vehicle", FILE)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.OutboardBoat()


def by_hand(state, inputs, own):
    """The boat's rates in numpy: body velocities turned, and M ν̇ + C ν + D ν = τ with matrices."""
    yaw, nu, angle = state[2], state[3:6], state[6]
    turn = np.array([[np.cos(yaw), -np.sin(yaw), 0], [np.sin(yaw), np.cos(yaw), 0], [0, 0, 1]])
    m = np.diag([*own.mass, own.inertia])
    coriolis = np.array([-m[1, 1] * nu[1] * nu[2], m[0, 0] * nu[0] * nu[2], 0.0])
    force = inputs[0] * np.array([np.cos(angle), -np.sin(angle), own.lever * np.sin(angle)])
    return np.concatenate([turn @ nu, np.linalg.solve(m, force - coriolis - own.drag * nu), [inputs[1]]])


def test_numbers_are_those_of_the_rates():
    own, rng = boat(), np.random.default_rng(0)
    vehicle = VehicleByRates(own)
    for _ in range(10):
        state, inputs = rng.normal(size=7), rng.normal(size=2)
        np.testing.assert_allclose(vehicle.rates(state, inputs), by_hand(state, inputs, own), atol=1e-12)
        z, dz = vehicle.flat(state)
        np.testing.assert_allclose(dz, by_hand(state, np.zeros(2), own)[:3], atol=1e-12)
        # the angle of the motor is not told by z and ż: it is that which is expected
        np.testing.assert_allclose(vehicle.state(z, dz), [*state[:6], 0.0], atol=1e-9)
        expected = np.concatenate([rng.normal(size=6), state[6:]])
        np.testing.assert_allclose(vehicle.state_near(z, dz, expected), state, atol=1e-9)
        np.testing.assert_allclose(vehicle.pose(state), state[:3])
        np.testing.assert_allclose(vehicle.velocity(state), state[3:6], atol=1e-9)
    np.testing.assert_array_equal(vehicle.thrust_min, [0.0, -1.5])
    assert (vehicle.states, vehicle.name, vehicle.input_names[2]) == (7, "OutboardBoat", ("thrust", "motor_rate"))
    assert not vehicle.gives_power


class Car:
    """ż is not linear in the rest of the state: the speed is squared."""

    position_dimension, flat_dimension, states = 2, 2, 4
    thrust_max = (1.0, 1.0)

    def rates(self, state, inputs):
        return [state[3] ** 2 * ca.cos(state[2]), state[3] ** 2 * ca.sin(state[2]), inputs[0], inputs[1]]


def test_a_state_is_found_that_has_the_rate():
    vehicle = VehicleByRates(Car())
    near = np.array([0.0, 0.0, 0.5, 1.0])
    found = vehicle.state_near([1.0, 2.0], [1.2, 0.9], near)
    np.testing.assert_allclose(vehicle.flat(found)[1], [1.2, 0.9], atol=1e-5)


@pytest.mark.parametrize(
    ("members", "line"),
    [
        ({"rates": None}, "OutboardBoat.rates: found nothing of this name"),
        ({"thrust_max": None}, "OutboardBoat.thrust_max: found nothing of this name"),
        ({"thrust_max": np.array([1.0, -1.0])}, "OutboardBoat.thrust_max: found .*; allowed: finite numbers > 0"),
        ({"thrust_min": np.array([0.0, 1.0])}, "OutboardBoat.thrust_min: found .*; allowed: 2 numbers <= 0"),
        ({"states": 6}, "OutboardBoat.rates: found"),
        ({"position_dimension": 4}, "OutboardBoat.position_dimension: found 4; allowed: 2, 3"),
        ({"input_names": ("thrust",)}, "OutboardBoat.input_names: found 1; allowed: 2"),
        ({"rates": lambda state, inputs: state[:3]}, "OutboardBoat.rates: found shape"),
        ({"rates": lambda state: state}, "OutboardBoat.rates: found the arguments"),
        ({"pose": lambda state: state}, "OutboardBoat.pose: found shape"),
    ],
)
def test_what_is_wrong_with_one_is_a_line(members, line):
    own = boat()
    for name, value in members.items():
        if value is None:
            delattr(type(own), name)
        else:
            setattr(own, name, value)
    with pytest.raises(ContractError, match=line):
        VehicleByRates(own)


@pytest.mark.parametrize(
    ("overrides", "line"),
    [
        (["planner.form=flat"], "OutboardBoat.inputs: found nothing .*planner.form: shooting"),
        (["desired_bearing.period_s=auto", "limits.range={nearest_m: 5.0}"], "OutboardBoat.steering: found nothing"),
        (["guidance={kind: planner, startup_deviation: 0.2}"], "OutboardBoat.steering: found nothing"),
        (["limits.input_rate=[1.0]"], "input_rate|rate"),
    ],
)
def test_what_the_configuration_asks_in_vain_is_a_line(overrides, line):
    with pytest.raises((ConfigurationError, ValueError), match=line):
        build_loop(load_config(str(FILE), overrides=overrides))


@pytest.mark.parametrize("name", ["torpedo2d", "torpedo3d", "vessel"])
def test_derivatives_of_a_step_are_casadis(name):
    """Put together by the chain rule of the stages, or of the finished step."""
    dynamics = Dynamics(KNOWN_DRIVEN[name].make())
    n, m = dynamics.states, dynamics.inputs
    numbers, multiplier = ca.SX.sym("numbers", n + 2 * m), ca.SX.sym("multiplier", n)
    first, last = numbers[n : n + m], numbers[n + m :]
    end, slopes, bend = differentiated(dynamics, numbers[:n], (first, last), 0.2, numbers, multiplier)
    plain = integrated(dynamics, numbers[:n], (first, last), 0.2, 1)
    theirs = [plain, ca.jacobian(plain, numbers), ca.tril(ca.hessian(ca.dot(multiplier, plain), numbers)[0])]
    compared = ca.Function("compared", [numbers, multiplier], [end, slopes, bend, *theirs])
    rng = np.random.default_rng(0)
    for _ in range(3):
        found = [np.asarray(one) for one in compared(rng.normal(size=n + 2 * m), rng.normal(size=n))]
        for mine, wanted in zip(found[:3], found[3:], strict=True):
            np.testing.assert_allclose(mine, wanted, rtol=1e-9, atol=1e-9)
    given, tidy = [numbers, multiplier], {"cse": True}
    operations = [ca.Function("f", given, [ca.tril(value)], tidy).n_instructions() for value in (bend, theirs[2])]
    assert 1.5 * operations[0] < operations[1]


def test_a_plan_and_a_run(tmp_path):
    """`check`, a run that goes where an independent integration goes, and the summary."""
    assert cli.main(["check", str(FILE)]) == 0
    loop, start = build_loop(load_config(str(FILE)))
    history = simulate(loop, start, 3.0).history
    assert np.all(history.solver_status[history.planned] == "solved")
    state, own = loop.vehicle.state(start[0], start[1]), boat()
    for k in range(len(history.t) - 1):
        held = history.thrust[k]
        state = solve_ivp(lambda t, x, held=held: by_hand(x, held, own), (0.0, 0.1), state, rtol=1e-8, atol=1e-10).y[
            :, -1
        ]
        np.testing.assert_allclose(history.vehicle_pose[k + 1], state[:3], atol=1e-5)


@pytest.mark.long
def test_the_c_of_its_planner(tmp_path):
    out = tmp_path / "c"
    assert cli.main(["codegen", str(FILE), "--out", str(out), "--verify"]) == 0
