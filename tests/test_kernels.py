import numpy as np
import pytest
from sklearn.gaussian_process import kernels as theirs

from gbt_ocp.tracking.gp.kernels import KERNELS

# Name, log parameters, the same kernel in scikit-learn.
PAIRS = [
    ("se", [0.7], theirs.RBF(0.7)),
    ("matern32", [0.7], theirs.Matern(0.7, nu=1.5)),
    ("matern52", [0.7], theirs.Matern(0.7, nu=2.5)),
    ("rq", [0.7, 1.3], theirs.RationalQuadratic(length_scale=0.7, alpha=1.3)),
]
every_kernel = pytest.mark.parametrize(("name", "parameters", "theirs"), PAIRS, ids=[pair[0] for pair in PAIRS])


def test_every_kernel_is_tested():
    assert {pair[0] for pair in PAIRS} == set(KERNELS)


@every_kernel
def test_kernel_is_scikit_learns(name, parameters, theirs):
    t = np.random.default_rng(0).uniform(0.0, 3.0, 12)
    found = KERNELS[name](t[:, None] - t[None, :], np.log(parameters))
    np.testing.assert_allclose(found, theirs(t[:, None]), atol=1e-13)
    np.testing.assert_allclose(np.diag(found), 1.0, rtol=1e-15)
    assert len(KERNELS[name].names) == len(parameters)
    assert KERNELS[name].names[0] == "length_scale"


@every_kernel
def test_derivatives_against_central_differences(name, parameters, theirs):
    kernel, at, step = KERNELS[name], np.log(parameters), 1e-5
    lag = np.concatenate([[0.0], np.random.default_rng(1).uniform(-3.0, 3.0, 20)])
    value, derivatives = kernel.derivatives(lag, at)
    np.testing.assert_array_equal(value, kernel(lag, at))
    assert len(derivatives) == len(parameters)
    for found, direction in zip(derivatives, np.eye(len(parameters)), strict=True):
        numeric = (kernel(lag, at + step * direction) - kernel(lag, at - step * direction)) / (2.0 * step)
        np.testing.assert_allclose(found, numeric, atol=1e-9)


@every_kernel
def test_far_and_near_lags_stay_finite(name, parameters, theirs):
    for log_scale in (-30.0, 30.0):
        at = np.concatenate([[log_scale], np.log(parameters[1:])])
        value, derivatives = KERNELS[name].derivatives(np.array([0.0, 1e-3, 1e3]), at)
        assert np.all(np.isfinite(value))
        assert np.all(np.isfinite(derivatives))
