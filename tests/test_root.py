"""The root of the squared exponential: its kernel, the posterior by Cholesky, and decimal numbers of 80 digits."""

from decimal import Decimal, localcontext

import numpy as np
import pytest
from test_posterior import FUTURE, both_dimensions, target, times, window

from gbt_ocp.models.bearings import unit_bearing
from gbt_ocp.tracking.gp.coregionalization import CoregionalizedHyperparameters, CoregionalizedPosterior
from gbt_ocp.tracking.gp.kernels import KERNELS
from gbt_ocp.tracking.gp.posterior import Hyperparameters, Posterior, condition
from gbt_ocp.tracking.gp.root import MOST_FUNCTIONS, NUGGETS, count_for, functions
from gbt_ocp.tracking.window import Measurements, Window

SE = KERNELS["se"]
ROUNDING = 1.0e-14


def known_at_first(data):
    """A window's rows, and a position that is known to a tenth of a metre when it begins."""
    rows, d = data.measurements(), len(data.bearings[0])
    where = target(rows.times[0], d) + 0.05
    return Measurements(
        np.concatenate([rows.times, np.full(d, rows.times[0])]),
        np.concatenate([rows.directions, np.eye(d)]),
        np.concatenate([rows.values, where]),
        np.concatenate([rows.variances, np.full(d, 0.01)]),
    )


@pytest.mark.parametrize("reach", [0.0, 0.5, 1.0, 2.0])
def test_as_many_functions_as_are_needed_give_the_kernel(reach):
    x = np.linspace(-reach, reach, 9)
    found = functions(x, count_for(x, 1.0, 2))
    np.testing.assert_allclose(found @ found.T, np.exp(-0.5 * (x[:, None] - x[None, :]) ** 2), atol=4e-15)


def test_a_window_of_too_many_length_scales_or_rows_has_no_root():
    assert count_for(np.zeros(3), 1.0, 3) == 1
    assert count_for(np.zeros(7), 1.0, 3) == 3  # as many coefficients as rows
    assert count_for(np.array([0.0, 3.0]), 1.0, 2) <= MOST_FUNCTIONS
    assert count_for(np.array([0.0, 12.0]), 1.0, 2) is None
    assert count_for(np.zeros(2 * MOST_FUNCTIONS + 1), 1.0, 2) is None
    assert count_for(np.zeros(0), 1.0, 2) is None


@both_dimensions
@pytest.mark.parametrize("far", [0.0, 8.0])
def test_with_a_nugget_it_is_the_posterior_by_cholesky(dimension, far):
    """Near the window, where further functions do not count, and far ahead, where only they do."""
    data, centre = known_at_first(window(dimension)), np.arange(1.0, dimension + 1.0)
    theta, asked = Hyperparameters(np.log([1.3]), np.log(2.5), 1e-4), FUTURE + far
    by_cholesky, by_root = (Posterior(SE, theta, data, centre, rounding) for rounding in (0.0, ROUNDING))
    for found, expected in zip(by_root.predict(asked), by_cholesky.predict(asked), strict=True):
        np.testing.assert_allclose(found, expected, atol=1e-9)
    np.testing.assert_allclose(by_root.joint_covariance(asked), by_cholesky.joint_covariance(asked), atol=1e-9)
    assert by_root.noise == by_cholesky.noise
    assert by_root._root is not None
    assert by_cholesky._root is None


def test_the_same_of_a_coregionalised_process():
    data, centre = known_at_first(window(3)), np.zeros(3)
    weights = np.random.default_rng(3).normal(size=(3, 2))
    theta = CoregionalizedHyperparameters((np.log([1.1]), np.log([1.7])), weights, 1e-4)
    by_cholesky, by_root = (
        CoregionalizedPosterior([SE, SE], theta, data, centre, rounding) for rounding in (0.0, ROUNDING)
    )
    for found, expected in zip(by_root.predict(FUTURE), by_cholesky.predict(FUTURE), strict=True):
        np.testing.assert_allclose(found, expected, atol=1e-9)
    np.testing.assert_allclose(by_root.joint_covariance(FUTURE), by_cholesky.joint_covariance(FUTURE), atol=1e-9)
    assert by_root._root is not None
    mixed = CoregionalizedPosterior([SE, KERNELS["matern32"]], theta, data, centre, ROUNDING)
    assert mixed._root is None, "a Matérn kernel has none"


def exact_mean(data, theta, nugget, asked):
    """The posterior mean of a prior with mean zero, in decimal numbers of 80 digits, by Gauss's elimination."""
    with localcontext() as context:
        context.prec = 80
        a = Decimal(theta.amplitude) ** 2

        def kernel(one, other):
            lag = (Decimal(one) - Decimal(other)) / Decimal(theta.length_scale)
            return a * (-lag * lag / 2).exp()

        def dot(one, other):
            return sum(Decimal(x) * Decimal(y) for x, y in zip(one, other, strict=True))

        rows = list(zip(data.times.tolist(), data.directions.tolist(), data.values.tolist(), strict=True))
        system = [[kernel(t, s) * dot(h, g) for s, g, _ in rows] + [Decimal(y)] for t, h, y in rows]
        for i in range(len(rows)):
            system[i][i] += a * Decimal(nugget)
        for i, pivot in enumerate(system):
            for below in system[i + 1 :]:
                share = below[i] / pivot[i]
                below[:] = [x - share * y for x, y in zip(below, pivot, strict=True)]
        weights = [Decimal(0)] * len(rows)
        for i in reversed(range(len(rows))):
            rest = system[i][-1] - sum(x * w for x, w in zip(system[i][i + 1 : -1], weights[i + 1 :], strict=True))
            weights[i] = rest / system[i][i]
        moved = [
            [
                sum(w * kernel(s, t) * Decimal(h[axis]) for w, (t, h, _) in zip(weights, rows, strict=True))
                for axis in range(len(rows[0][1]))
            ]
            for s in asked
        ]
        return np.array(moved, dtype=float)


def dithered(noise=0.0, seed=0):
    """Twenty bearings in two seconds of a smooth motion, from a vehicle that moves about, with noise in radians."""
    found, rng = Window(20), np.random.default_rng(seed)
    for k in range(20):
        t = 0.1 * k
        own = np.array([np.sin(9.0 * t), np.cos(7.0 * t)])
        line, angle = target(t, 2) - own, noise * rng.standard_normal()
        turned = [line[0] - angle * line[1], line[1] + angle * line[0]]
        found.append(t, unit_bearing(own + turned, own), own)
    return found.measurements()


def test_exact_bearings_are_told_better_than_any_nugget_of_cholesky_allows():
    """Rounding decides what is said of what lies ahead: a hundred times less of it does."""
    data, theta, asked = dithered(), Hyperparameters(np.log([1.5]), np.log(3.0), ROUNDING), np.array([1.9, 2.0, 2.4])
    posterior = condition(SE, theta, data, np.zeros(2), ROUNDING)[0]
    by_root, by_cholesky = posterior.predict(asked).mean, condition(SE, theta, data, np.zeros(2))[0].predict(asked).mean
    # in decimal numbers under the nugget that it took: the one whose mean is nearest
    taken = min((*NUGGETS, ROUNDING), key=lambda nugget: np.abs(exact_mean(data, theta, nugget, asked) - by_root).max())
    exact = exact_mean(data, theta, taken, asked)
    off = np.abs(by_root - exact).max(axis=1)
    np.testing.assert_array_less(off, [1e-8, 1e-7, 1e-5])
    assert taken < 1e-16
    np.testing.assert_array_less(100.0 * off, np.abs(by_cholesky - exact).max(axis=1))
    # and what lies ahead is nearer to where the target goes
    truth = target(asked, 2)
    np.testing.assert_array_less(np.linalg.norm(by_root - truth, axis=1), np.linalg.norm(by_cholesky - truth, axis=1))


@pytest.mark.parametrize("noise", [1e-9, 1e-8, 1e-7])
def test_noise_that_a_covariance_cannot_tell_from_rounding_is_not_taken_for_motion(noise):
    """With the least nugget, errors of bearings that are far below its deviation would be carried ahead as motion."""
    theta, asked = Hyperparameters(np.log([1.5]), np.log(3.0), ROUNDING), np.array([2.4])
    errors = {"root": [], "cholesky": [], "least": []}
    for seed in range(10):
        data = dithered(noise, seed)
        found = {
            "root": condition(SE, theta, data, np.zeros(2), ROUNDING)[0].predict(asked).mean,
            "cholesky": condition(SE, theta, data, np.zeros(2))[0].predict(asked).mean,
            "least": exact_mean(data, theta, NUGGETS[0], asked),
        }
        for name, mean in found.items():
            errors[name].append(float(np.linalg.norm(mean - target(asked, 2))))
    means = {name: np.mean(each) for name, each in errors.items()}
    assert means["root"] < 1.5 * means["cholesky"]
    assert means["root"] < 0.5 * means["least"]


@both_dimensions
def test_its_covariance_is_never_negative(dimension):
    data = window(dimension)
    theta = Hyperparameters(np.log([4.0]), np.log(20.0), ROUNDING)
    asked = np.concatenate([times(), FUTURE, FUTURE + 20.0])
    covariance = condition(SE, theta, data.measurements(), np.zeros(dimension), ROUNDING)[0].predict(asked).covariance
    assert np.linalg.eigvalsh(covariance).min() >= 0.0
    np.testing.assert_allclose(covariance[-1], 400.0 * np.eye(dimension), rtol=1e-3, atol=1e-3)
