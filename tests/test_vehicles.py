import casadi as ca
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from gbt_ocp.models.fossen import DRAG_SMOOTHING, FALCON_2D, FALCON_3D, FossenParameters, FossenVehicle, rotation
from gbt_ocp.models.vehicles import PlanarPointMass, Unicycle
from gbt_ocp.ocp.trajectory import FlatTrajectory

PLANAR = FossenVehicle(FALCON_2D, (5000.0, 5000.0, 1500.0))
SPATIAL = FossenVehicle(FALCON_3D, (5000.0, 5000.0, 5000.0, 1500.0))
POINT = PlanarPointMass(mass=2.0, drag=0.7, thrust_max=(3.0, 4.0))
# Slow enough that the map's regularisation is far below the tolerance of the integration.
UNICYCLE = Unicycle(thrust_max=(2.0, 3.0), slow_speed=1e-6)
VEHICLES = {"planar": PLANAR, "spatial": SPATIAL, "point": POINT, "unicycle": UNICYCLE}
every_vehicle = pytest.mark.parametrize("vehicle", VEHICLES.values(), ids=VEHICLES)


def flat_inputs(vehicle):
    symbols = [ca.SX.sym(name, vehicle.flat_dimension) for name in ("z", "dz", "ddz")]
    function = ca.Function("inputs", symbols, [vehicle.inputs(*symbols)])
    return lambda *point: np.asarray(function(*point)).ravel()


def wave(vehicle, t):
    """A smooth motion that never stands still, with its first two derivatives."""
    i = np.arange(vehicle.flat_dimension)
    rate, phase, size = 0.9 + 0.35 * i, 0.4 * i, 1.0 + 0.2 * i
    drift = np.where(i == 0, 1.5, 0.1)
    angle = rate * t + phase
    return (
        size * np.sin(angle) + drift * t,
        size * rate * np.cos(angle) + drift,
        -size * rate**2 * np.sin(angle),
    )


def test_thrust_by_hand_in_the_plane():
    # M = (116 + 167.6, 116 + 477.2, 13.1 + 15.9); the rest is Fossen's 3-DOF model written out on paper.
    nu, nu_rate = np.array([1.0, 0.5, 0.2]), np.array([0.1, -0.2, 0.05])
    expected = [
        283.6 * 0.1 - 593.2 * 0.5 * 0.2 + 26.9 * 1.0 + 241.3 * 1.0,
        593.2 * -0.2 + 283.6 * 1.0 * 0.2 + 35.8 * 0.5 + 503.8 * 0.25,
        29.0 * 0.05 + (593.2 - 283.6) * 1.0 * 0.5 + 3.5 * 0.2 + 76.9 * 0.04,
    ]
    np.testing.assert_allclose(expected, [237.24, 81.93, 160.026], rtol=1e-12)
    assert_thrust(PLANAR, FALCON_2D, nu, nu_rate, expected)


def test_thrust_by_hand_in_space():
    nu, nu_rate = np.array([1.0, 0.5, -0.3, 0.2]), np.array([0.1, -0.2, 0.4, 0.05])
    heave = (116.0 + 235.7) * 0.4 + 6.19 * -0.3 - 119.1 * 0.09
    assert_thrust(SPATIAL, FALCON_3D, nu, nu_rate, [237.24, 81.93, heave, 160.026])


def assert_thrust(vehicle, parameters, nu, nu_rate, expected):
    # The smoothing of the drag is allowed half of ε times the coefficient.
    allowed = 0.5 * DRAG_SMOOTHING * np.array(parameters.quadratic_drag) + 1e-9
    for yaw in (0.0, 0.7, -2.4):
        turn = Rotation.from_euler("z", yaw).as_matrix()
        j = np.eye(len(nu))
        j[:2, :2] = turn[:2, :2]
        j_rate = np.zeros_like(j)
        j_rate[:2, :2] = nu[-1] * np.array([[0.0, -1.0], [1.0, 0.0]]) @ turn[:2, :2]
        z = np.append(np.full(len(nu) - 1, 3.0), yaw)
        thrust = flat_inputs(vehicle)(z, j @ nu, j @ nu_rate + j_rate @ nu)
        assert np.all(np.abs(thrust - expected) <= allowed), thrust - expected
        np.testing.assert_allclose(vehicle.rates(np.concatenate([z, nu]), thrust)[len(nu) :], nu_rate, atol=1e-12)


@every_vehicle
def test_thrust_of_the_flat_map_integrated_returns_the_trajectory(vehicle):
    inputs = flat_inputs(vehicle)
    times = np.linspace(0.0, 4.0, 21)
    found = solve_ivp(
        lambda t, x: vehicle.rates(x, inputs(*wave(vehicle, t))),
        (0.0, 4.0),
        vehicle.state(*wave(vehicle, 0.0)[:2]),
        method="DOP853",
        t_eval=times,
        rtol=1e-11,
        atol=1e-11,
    )
    assert found.success
    for t, state in zip(times, found.y.T, strict=True):
        z, dz = vehicle.flat(state)
        np.testing.assert_allclose(z, wave(vehicle, t)[0], atol=1e-6)
        np.testing.assert_allclose(dz, wave(vehicle, t)[1], atol=1e-6)


@every_vehicle
def test_thrust_along_a_plan_integrated_piece_by_piece_returns_the_plan(vehicle):
    # The acceleration of a plan of degree 2 jumps at the boundaries: the integration starts anew at each.
    rng = np.random.default_rng(4)
    top = rng.uniform(-0.8, 0.8, (4, vehicle.flat_dimension))
    plan = FlatTrajectory(0.5, np.array(wave(vehicle, 0.0)[:2]), top)
    inputs = flat_inputs(vehicle)
    state = vehicle.state(*plan.start)
    for i in range(plan.pieces):
        z, dz = plan.knots[i]

        def rates(s, x, z=z, dz=dz, a=top[i]):
            return vehicle.rates(x, inputs(z + s * dz + 0.5 * s * s * a, dz + s * a, a))

        state = solve_ivp(rates, (0.0, 0.5), state, method="DOP853", rtol=1e-11, atol=1e-11).y[:, -1]
        np.testing.assert_allclose(vehicle.flat(state)[0], plan.endpoints[i], atol=1e-6)
        np.testing.assert_allclose(vehicle.flat(state)[1], plan.knots[i + 1, 1], atol=1e-6)


@every_vehicle
def test_derivatives_of_the_inputs_against_central_differences(vehicle):
    symbols = [ca.SX.sym(name, vehicle.flat_dimension) for name in ("z", "dz", "ddz")]
    stacked = ca.vertcat(*symbols)
    jacobian = ca.Function("jacobian", symbols, [ca.jacobian(vehicle.inputs(*symbols), stacked)])
    point = np.concatenate(wave(vehicle, 0.6))
    inputs, step = flat_inputs(vehicle), 1e-5
    columns = []
    for direction in np.eye(len(point)):
        ahead, behind = (inputs(*np.split(point + sign * step * direction, 3)) for sign in (1.0, -1.0))
        columns.append((ahead - behind) / (2.0 * step))
    expected = np.array(columns).T
    np.testing.assert_allclose(np.asarray(jacobian(*np.split(point, 3))), expected, atol=1e-7 * np.abs(expected).max())


@every_vehicle
def test_state_and_flat_output_are_inverse(vehicle):
    z, dz, _ = wave(vehicle, 1.1)
    back_z, back_dz = vehicle.flat(vehicle.state(z, dz))
    np.testing.assert_allclose(back_z, z, atol=1e-14)
    np.testing.assert_allclose(back_dz, dz, atol=1e-14)
    assert vehicle.pose(vehicle.state(z, dz)).shape == (vehicle.position_dimension + 1,)
    np.testing.assert_allclose(
        vehicle.pose(vehicle.state(z, dz))[: vehicle.position_dimension], z[: vehicle.position_dimension]
    )


def test_body_velocity_of_a_vehicle_that_looks_along_y():
    state = PLANAR.state([0.0, 0.0, np.pi / 2], [0.0, 2.0, 0.3])
    np.testing.assert_allclose(PLANAR.velocity(state), [2.0, 0.0, 0.3], atol=1e-15)
    np.testing.assert_allclose(UNICYCLE.velocity(UNICYCLE.state([0.0, 0.0], [3.0, 4.0]))[:2], [5.0, 0.0])
    np.testing.assert_allclose(POINT.velocity(POINT.state([1.0, 2.0], [3.0, 4.0])), [3.0, 4.0, 0.0])
    np.testing.assert_allclose(POINT.pose(POINT.state([1.0, 2.0], [3.0, 4.0])), [1.0, 2.0, 0.0])


@pytest.mark.parametrize("size", [3, 4])
def test_rotation_is_a_turn_about_the_vertical(size):
    j = rotation(0.3, size)
    np.testing.assert_allclose(j[:2, :2], Rotation.from_euler("z", 0.3).as_matrix()[:2, :2])
    np.testing.assert_allclose(j[2:, 2:], np.eye(size - 2))


@pytest.mark.parametrize("vehicle", [PLANAR, SPATIAL], ids=["planar", "spatial"])
def test_coriolis_matrix_is_skew_symmetric_and_does_no_work(vehicle):
    rng = np.random.default_rng(5)
    for nu in rng.standard_normal((20, vehicle.flat_dimension)):
        c = vehicle.coriolis_matrix(nu)
        np.testing.assert_array_equal(c, -c.T)
        assert np.any(c != 0.0)
        assert np.all(np.diag(vehicle.damping_matrix(nu)) > 0.0)


@pytest.mark.parametrize("vehicle", [PLANAR, SPATIAL], ids=["planar", "spatial"])
def test_energy_without_thrust_is_lost_to_drag_alone(vehicle):
    inertia = vehicle.parameters.inertia_diagonal
    rng = np.random.default_rng(6)
    for nu in rng.standard_normal((10, vehicle.flat_dimension)):
        rate = vehicle.rates(np.concatenate([np.zeros_like(nu), nu]), np.zeros_like(nu))[len(nu) :]
        lost = np.sum(np.array(vehicle.parameters.linear_drag) * nu**2)
        lost += np.sum(np.array(vehicle.parameters.quadratic_drag) * np.abs(nu) ** 3)
        assert nu @ (inertia * rate) == pytest.approx(-lost, rel=1e-3)


def test_thrusters_reach_the_acceleration_scale_from_rest():
    for vehicle in (PLANAR, SPATIAL, POINT):
        n = vehicle.flat_dimension
        thrust = flat_inputs(vehicle)(np.zeros(n), np.zeros(n), vehicle.acceleration_scale)
        share = thrust / vehicle.thrust_max
        assert np.all((share > 0.5) & (share < 2.0))


def test_coefficients_that_do_not_fit_are_refused():
    with pytest.raises(ValueError, match=r"found \[3, 4\]"):
        FossenParameters(1.0, 1.0, (0.0,) * 3, (0.0,) * 4, (0.0,) * 3)
    with pytest.raises(ValueError, match="must be positive"):
        FossenParameters(1.0, 1.0, (2.0, 0.0, 0.0), (0.0,) * 3, (0.0,) * 3)
    for limits in ((5000.0, 5000.0), (5000.0, 0.0, 1500.0), (5000.0, np.nan, 1500.0)):
        with pytest.raises(ValueError, match=r"thrust_max: found .*; allowed: 3 finite numbers > 0"):
            FossenVehicle(FALCON_2D, limits)
