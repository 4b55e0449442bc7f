import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gbt_ocp.models.bearings import (
    DesiredBearing,
    condition_number,
    cumulative_bearing_matrix,
    log_map,
    rotate_bearing,
    tangent_basis,
    unit_bearing,
)


def random_bearings(dimension, count=200, seed=0):
    b = np.random.default_rng(seed).standard_normal((count, dimension))
    return b / np.linalg.norm(b, axis=1, keepdims=True)


def near_south_pole(angle, azimuth):
    return np.array([np.sin(angle) * np.cos(azimuth), np.sin(angle) * np.sin(azimuth), -np.cos(angle)])


@pytest.mark.parametrize("dimension", [2, 3])
def test_bearing_points_from_the_vehicle_to_the_target(dimension):
    rng = np.random.default_rng(1)
    own, line, reach = rng.standard_normal(dimension), random_bearings(dimension), rng.uniform(0.1, 90.0, (200, 1))
    np.testing.assert_allclose(unit_bearing(own + reach * line, own), line, atol=1e-12)


@pytest.mark.parametrize("reach", [1e-300, 1e-160, 1e160, 1e300])
def test_bearing_at_extreme_ranges_has_length_one(reach):
    np.testing.assert_allclose(unit_bearing([3.0 * reach, 4.0 * reach], [0.0, 0.0]), [0.6, 0.8], rtol=1e-12)


def test_bearing_to_itself_is_refused():
    with pytest.raises(ValueError, match="undefined"):
        unit_bearing([[1.0, 2.0], [3.0, 4.0]], [3.0, 4.0])


@pytest.mark.parametrize("dimension", [2, 3])
def test_tangent_basis_is_orthonormal_and_right_handed(dimension):
    b = random_bearings(dimension)
    basis = tangent_basis(b)
    assert basis.shape == (200, dimension, dimension - 1)
    np.testing.assert_allclose(np.einsum("kij,ki->kj", basis, b), 0.0, atol=1e-14)
    gram = np.einsum("kij,kil->kjl", basis, basis)
    np.testing.assert_allclose(gram, np.broadcast_to(np.eye(dimension - 1), gram.shape), atol=1e-14)
    # In 2D the bearing, then the basis; in 3D the basis, then the bearing.
    frame = [b[..., None], basis] if dimension == 2 else [basis, b[..., None]]
    np.testing.assert_allclose(np.linalg.det(np.concatenate(frame, axis=-1)), 1.0, atol=1e-13)


def test_tangent_basis_in_space_is_the_smallest_rotation_of_e_x_and_e_y():
    for b in random_bearings(3, count=50):
        axis = np.cross([0.0, 0.0, 1.0], b)
        turn = Rotation.from_rotvec(axis / np.linalg.norm(axis) * np.arccos(b[2])).as_matrix()
        np.testing.assert_allclose(tangent_basis(b), turn[:, :2], atol=1e-12)


def test_the_log_map_in_the_plane_is_the_argument_of_a_quotient_of_complex_numbers():
    expected, measured = random_bearings(2), random_bearings(2, seed=1)
    quotient = (measured[:, 0] + 1j * measured[:, 1]) / (expected[:, 0] + 1j * expected[:, 1])
    np.testing.assert_allclose(log_map(expected, measured)[:, 0], np.angle(quotient), atol=1e-14)


def test_the_log_map_in_space_is_the_rotation_of_a_quaternion():
    """The smallest rotation from one bearing to the other has the quaternion (e × m, 1 + e·m)."""
    expected, measured = random_bearings(3), random_bearings(3, seed=1)
    quaternions = np.column_stack([np.cross(expected, measured), 1.0 + np.sum(expected * measured, axis=1)])
    turns = Rotation.from_quat(quaternions).as_rotvec()
    along = np.einsum("kij,kj->ki", tangent_basis(expected), log_map(expected, measured))
    np.testing.assert_allclose(along, np.cross(turns, expected), atol=1e-12)


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("size", [0.0, 1e-300, 1e-12, 1e-8, 1e-3, 1.0, 3.0, np.pi - 1e-6])
def test_the_log_map_is_the_inverse_of_a_turn_at_every_angle(dimension, size):
    bearings = random_bearings(dimension)
    angle = size * random_bearings(dimension - 1, seed=2) if dimension == 3 else np.full((200, 1), -size)
    found = log_map(bearings, rotate_bearing(bearings, angle))
    # bearings are rounded to 1e-16; near a half turn that is a large part of their distance from opposite
    np.testing.assert_allclose(found, angle, rtol=1e-12, atol=1e-15 / np.sinc(size / np.pi))


@pytest.mark.parametrize("dimension", [2, 3])
def test_opposite_bearings_are_half_a_turn_apart(dimension):
    axes = np.concatenate([np.eye(dimension), -np.eye(dimension)])
    np.testing.assert_array_equal(np.linalg.norm(log_map(axes, -axes), axis=1), np.pi)


@pytest.mark.parametrize("dimension", [2, 3])
def test_the_log_map_broadcasts_and_takes_a_basis(dimension):
    expected, measured = random_bearings(dimension, 4), random_bearings(dimension, 5, seed=1)
    table = log_map(expected[:, None], measured[None], tangent_basis(expected)[:, None])
    assert table.shape == (4, 5, dimension - 1)
    np.testing.assert_allclose(table[2, 3], log_map(expected[2], measured[3]), atol=1e-15)


def test_the_log_map_of_no_number_is_no_number():
    assert np.isnan(log_map([0.0, 0.0, 1.0], [np.nan, 0.0, 1.0])).any()
    assert np.isnan(log_map([1.0, 0.0], [np.nan, 0.0])).all()


@pytest.mark.parametrize("angle", [0.0, 1e-320, 1e-200, 1e-12, 1e-8, 1e-4, 1e-2])
@pytest.mark.parametrize("azimuth", [0.0, 0.7, 2.0, -1.9])
def test_tangent_basis_keeps_its_digits_near_the_south_pole(angle, azimuth):
    b = near_south_pole(angle, azimuth)
    basis = tangent_basis(b)
    np.testing.assert_allclose(basis.T @ b, 0.0, atol=1e-14)
    np.testing.assert_allclose(basis.T @ basis, np.eye(2), atol=1e-14)


def test_tangent_basis_has_no_sign_lottery():
    angle = np.linspace(-2.0 * np.pi, 2.0 * np.pi, 4001)
    planar = tangent_basis(np.stack([np.cos(angle), np.sin(angle)], axis=-1))
    assert np.abs(np.diff(planar, axis=0)).max() < 2.0 * (angle[1] - angle[0])
    # A great circle that passes the south pole at 0.1 rad: the basis turns by at most about 2/0.1 of the step.
    tilted = Rotation.from_euler("x", np.pi / 2 - 0.1).apply(
        np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=-1)
    )
    assert np.abs(np.diff(tangent_basis(tilted), axis=0)).max() < 25.0 * (angle[1] - angle[0])


def test_tangent_basis_of_another_dimension_is_refused():
    with pytest.raises(ValueError, match="found 4"):
        tangent_basis([1.0, 0.0, 0.0, 0.0])


@pytest.mark.parametrize("dimension", [2, 3])
def test_rotation_turns_by_the_length_of_the_angle_towards_its_direction(dimension):
    b = random_bearings(dimension, seed=2)
    angle = np.random.default_rng(3).uniform(-1.0, 1.0, (200, dimension - 1))
    size = np.linalg.norm(angle, axis=1)
    turned = rotate_bearing(b, angle)
    np.testing.assert_allclose(np.arccos(np.einsum("ki,ki->k", b, turned)), size, atol=1e-7)
    along = np.einsum("kij,ki->kj", tangent_basis(b), turned)
    np.testing.assert_allclose(along, np.sin(size)[:, None] * angle / size[:, None], atol=1e-12)


def test_rotation_in_the_plane_is_counter_clockwise():
    np.testing.assert_allclose(rotate_bearing([1.0, 0.0], [np.pi / 2]), [0.0, 1.0], atol=1e-15)


@pytest.mark.parametrize("dimension", [2, 3])
def test_rotation_by_nothing_changes_nothing(dimension):
    b = random_bearings(dimension)
    np.testing.assert_allclose(rotate_bearing(b, np.zeros((200, dimension - 1))), b, atol=1e-15)


@pytest.mark.parametrize("dimension", [2, 3])
def test_cumulative_matrix_is_the_sum_of_tangent_projections(dimension):
    b = random_bearings(dimension, count=7)
    expected = sum(basis @ basis.T for basis in tangent_basis(b))
    np.testing.assert_allclose(cumulative_bearing_matrix(b), expected, atol=1e-13)
    assert condition_number(expected) == pytest.approx(np.linalg.cond(expected), rel=1e-10)


def test_bearings_that_do_not_pin_a_position_down_have_infinite_condition_number():
    assert condition_number(cumulative_bearing_matrix([0.6, 0.8])) == np.inf
    assert condition_number(cumulative_bearing_matrix([[0.6, 0.8], [-0.6, -0.8]])) == np.inf
    # In space one bearing leaves the range open, two that differ do not.
    assert condition_number(cumulative_bearing_matrix([0.0, 0.6, 0.8])) == np.inf
    assert condition_number(cumulative_bearing_matrix([[0.0, 0.6, 0.8], [1.0, 0.0, 0.0]])) < 3.0
    assert condition_number(np.zeros((2, 2))) == np.inf


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("more", [1, 2, 7])
@pytest.mark.parametrize("phase", [0.0, 0.3])
def test_more_than_d_desired_bearings_are_perfectly_conditioned(dimension, more, phase):
    m, period = dimension + more, 0.1
    for axis in ((0.0, 0.0, 1.0), (1.0, -2.0, 0.5), (0.0, 0.0, -3.0)):
        desired = DesiredBearing(dimension, 2.0 * np.pi / (period * m), axis)(phase + period * np.arange(m))
        np.testing.assert_allclose(np.linalg.norm(desired, axis=1), 1.0, atol=1e-14)
        assert condition_number(cumulative_bearing_matrix(desired)) == pytest.approx(1.0, abs=1e-12)
        if dimension == 3:
            np.testing.assert_allclose(desired @ axis / np.linalg.norm(axis), np.sqrt(1.0 / 3.0), atol=1e-14)


def test_desired_bearing_runs_counter_clockwise_from_e_x():
    desired = DesiredBearing(2, 0.5)
    np.testing.assert_allclose(desired(0.0), [1.0, 0.0], atol=1e-15)
    np.testing.assert_allclose(desired(np.pi), [0.0, 1.0], atol=1e-15)


def test_impossible_desired_bearings_are_refused():
    with pytest.raises(ValueError, match="dimension must be 2 or 3, found 4"):
        DesiredBearing(4, 1.0)
    with pytest.raises(ValueError, match="axis must not be zero"):
        DesiredBearing(3, 1.0, (0.0, 0.0, 0.0))
    with pytest.raises(ValueError, match=r"reverse: found 0.0; allowed: a number above 0"):
        DesiredBearing(2, 1.0, reverse=0.0)


@pytest.mark.parametrize("dimension", [2, 3])
def test_a_turn_that_reverses_has_the_rate_in_turn_of_either_sign(dimension):
    desired = DesiredBearing(dimension, -0.3, phase=0.4, reverse=2.0, leg_start=0.7)
    fine = np.linspace(0.7, 8.7, 80001)
    sense = np.where(((fine - 0.7) // 2.0) % 2 == 0, 1.0, -1.0)
    steps = np.diff(fine) * -0.3 * sense[:-1]
    angle = 0.4 + np.concatenate([[0.0], np.cumsum(steps)])
    expected = DesiredBearing(dimension, 1.0)(angle)
    np.testing.assert_allclose(desired(fine), expected, atol=1e-4)
    np.testing.assert_allclose(desired(-7.3 + np.arange(3.0)), desired(0.7 + np.arange(3.0)), atol=1e-12)
    sight = expected[300]
    np.testing.assert_allclose(desired.beginning_at(5.2, sight)(5.2), sight, atol=1e-12)


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("rate", [0.2, -0.2])
@pytest.mark.parametrize("turns", [1.0, -1.0])
def test_legs_begin_in_the_sense_in_which_the_line_of_sight_turns(dimension, rate, turns):
    line = np.array([3.0, 4.0, 0.0])[:dimension]
    velocity = turns * np.array([-4.0, 3.0, 0.0])[:dimension] + 2.0 * line
    begun = DesiredBearing(dimension, rate, reverse=6.0).reversing_from(11.0, line, velocity)
    angle = np.unwrap(np.arctan2(*begun([11.0, 14.0, 17.0, 20.0])[:, 1::-1].T))
    assert angle[0] == pytest.approx(np.arctan2(4.0, 3.0))
    np.testing.assert_allclose(np.diff(angle), turns * 0.6 * np.array([1.0, 1.0, -1.0]), atol=1e-12)
    steady = DesiredBearing(dimension, rate)
    assert steady.reversing_from(11.0, line, velocity) is steady
