"""One step of the tracker beside peers at the same job: the table of docs/benchmarks.

    python benchmarks/tracker.py --steps 120 --repeat 3

A step takes in a bearing, tunes where the method tunes, and predicts position and covariance at 12 times. All methods
see the same bearings of a target that an observer circles. Times are the thread's processor time, the least of the
repetitions at each step, and their median over the last half of the steps, when the windows are full.

scikit-learn's Gaussian process has no linear functionals of several outputs; its kernel is written here as its guide
asks for, with the analytic gradient, and every fit starts from the last hyperparameters. Stone Soup's extended Kalman
filter is set up as in its bearings-only tutorial.
"""

from __future__ import annotations

import os

# The matrices are small: several BLAS threads a process only get in each other's way.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
import datetime
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from time import thread_time
from typing import Any

import numpy as np
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import Hyperparameter, Kernel
from stonesoup.models.measurement.nonlinear import Cartesian2DToBearing
from stonesoup.models.transition.linear import CombinedLinearGaussianTransitionModel, ConstantVelocity
from stonesoup.predictor.kalman import ExtendedKalmanPredictor
from stonesoup.types.angle import Bearing
from stonesoup.types.array import StateVector
from stonesoup.types.detection import Detection
from stonesoup.types.hypothesis import SingleHypothesis
from stonesoup.types.prediction import GaussianStatePrediction
from stonesoup.updater.kalman import ExtendedKalmanUpdater

from gbt_ocp.models.bearings import rotate_bearing, tangent_basis, unit_bearing
from gbt_ocp.tracking.displacement.tracker import NoisyGaussianProcessTracker
from gbt_ocp.tracking.gp.gp import GaussianProcessTracker
from gbt_ocp.tracking.noise import BearingNoise

PERIOD, AHEAD, NUGGET = 0.1, 12, 1.0e-8


@dataclass(frozen=True)
class Scene:
    """Bearings of a target that goes straight on, from an observer that circles it twice a second at 1.5 m."""

    times: Any
    target: Any
    own: Any
    bearings: Any

    @classmethod
    def made(cls, steps: int, noise: float) -> Scene:
        """Steps of a tenth of a second, bearing noise in radians."""
        t = PERIOD * np.arange(steps)
        target = np.stack([3.0 + 0.5 * t, 1.0 + np.sin(0.3 * t)], axis=-1)
        own = target - 1.5 * np.stack([np.cos(2.0 * np.pi * t), np.sin(2.0 * np.pi * t)], axis=-1)
        turn = noise * np.random.default_rng(0).standard_normal((steps, 1))
        return cls(t, target, own, rotate_bearing(unit_bearing(target, own), turn))


class BearingKernel(Kernel):
    """``a² exp(-(t - t')²/(2 l²)) h·h'`` of rows ``[t, h]``: covariance of two projections of the position."""

    def __init__(self, amplitude=3.0, length_scale=3.0, span=(0.3, 200.0)):
        self.amplitude, self.length_scale, self.span = amplitude, length_scale, span

    @property
    def hyperparameter_amplitude(self):
        """As scikit-learn wants it."""
        return Hyperparameter("amplitude", "numeric", self.span)

    @property
    def hyperparameter_length_scale(self):
        """As scikit-learn wants it."""
        return Hyperparameter("length_scale", "numeric", self.span)

    def __call__(self, X, Y=None, eval_gradient=False):
        """Covariance of the rows, and its gradient by the logarithms."""
        other = X if Y is None else Y
        square = ((X[:, :1] - other[:, 0]) / self.length_scale) ** 2
        value = self.amplitude**2 * np.exp(-0.5 * square) * (X[:, 1:] @ other[:, 1:].T)
        # hyperparameters come in the order of their names
        return (value, np.stack([2.0 * value, value * square], axis=-1)) if eval_gradient else value

    def diag(self, X):
        """Diagonal of the covariance of the rows."""
        return self.amplitude**2 * np.einsum("ij,ij->i", X[:, 1:], X[:, 1:])

    def is_stationary(self):
        """It is not: the directions count."""
        return False


class ScikitLearn:
    """scikit-learn's regressor on the latest rows, begun from the last hyperparameters."""

    def __init__(self, window: int, restarts: int) -> None:
        self._window, self._restarts = window, restarts
        self._kernel = BearingKernel()
        self._rows: list[Any] = []

    def step(self, time: float, bearing: Any, own: Any) -> Any:
        """Mean and covariance at the times ahead."""
        normal = tangent_basis(bearing)[:, 0]
        self._rows = [*self._rows, (time, normal, normal @ own)][-self._window :]
        inputs = np.array([[t, *h] for t, h, _ in self._rows])
        values = np.array([y for *_, y in self._rows]) - inputs[:, 1:] @ own
        model = GaussianProcessRegressor(
            self._kernel, alpha=NUGGET, n_restarts_optimizer=self._restarts, random_state=0
        )
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # hyperparameters at their bounds
            model.fit(inputs, values)
        self._kernel = model.kernel_
        ahead = np.repeat(time + PERIOD * np.arange(AHEAD), 2)
        mean, covariance = model.predict(np.column_stack([ahead, np.tile(np.eye(2), (AHEAD, 1))]), return_cov=True)
        blocks = covariance.reshape(AHEAD, 2, AHEAD, 2)[np.arange(AHEAD), :, np.arange(AHEAD)]
        return own + mean.reshape(AHEAD, 2), blocks


class StoneSoup:
    """Stone Soup's extended Kalman filter, constant velocity."""

    def __init__(self, scene: Scene, noise: float) -> None:
        self._predictor = ExtendedKalmanPredictor(CombinedLinearGaussianTransitionModel([ConstantVelocity(0.1)] * 2))
        self._noise = np.array([[noise**2]])
        self._began = datetime.datetime(2020, 1, 1)
        self._state: Any = None
        self._start = scene.target[0]

    def step(self, time: float, bearing: Any, own: Any) -> Any:
        """Mean and covariance at the times ahead."""
        now = self._began + datetime.timedelta(seconds=float(time))
        if self._state is None:
            start = [[self._start[0]], [0.0], [self._start[1]], [0.0]]
            prediction = GaussianStatePrediction(start, np.diag([4.0, 1.0, 4.0, 1.0]), timestamp=now)
        else:
            prediction = self._predictor.predict(self._state, timestamp=now)
        model = Cartesian2DToBearing(
            ndim_state=4, mapping=(0, 2), noise_covar=self._noise, translation_offset=own[:, None]
        )
        detection = Detection(
            StateVector([Bearing(np.arctan2(bearing[1], bearing[0]))]), timestamp=now, measurement_model=model
        )
        self._state = ExtendedKalmanUpdater(model).update(SingleHypothesis(prediction, detection))
        places = [
            self._predictor.predict(self._state, timestamp=now + datetime.timedelta(seconds=PERIOD * k))
            for k in range(AHEAD)
        ]
        mean = np.array([np.asarray(place.state_vector, dtype=float).ravel()[[0, 2]] for place in places])
        return mean, np.array([np.asarray(place.covar)[np.ix_([0, 2], [0, 2])] for place in places])


class Ours:
    """A tracker of this package."""

    def __init__(self, tracker: Any) -> None:
        self._tracker = tracker

    def step(self, time: float, bearing: Any, own: Any) -> Any:
        """Mean and covariance at the times ahead."""
        self._tracker.update(time, bearing, own)
        return self._tracker.predict(time + PERIOD * np.arange(AHEAD))


def measured(scene: Scene, make: Callable[[], Any], repeat: int) -> tuple[float, float, float]:
    """Median and 99 % quantile of a step in milliseconds, and the median error in metres of the last half."""
    times = np.full((repeat, len(scene.times)), np.inf)
    errors = np.zeros(len(scene.times))
    for run in range(repeat):
        method = make()
        for k, (t, bearing, own) in enumerate(zip(scene.times, scene.bearings, scene.own, strict=True)):
            began = thread_time()
            mean, _ = method.step(float(t), bearing, own)
            times[run, k] = 1e3 * (thread_time() - began)
            errors[k] = np.linalg.norm(mean[0] - scene.target[k])
    half = len(scene.times) // 2
    least = times.min(axis=0)[half:]
    return float(np.median(least)), float(np.quantile(least, 0.99)), float(np.median(errors[half:]))


def main() -> None:
    """Print the table as Markdown."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--steps", type=int, default=120)
    parser.add_argument("--repeat", type=int, default=3)
    arguments = parser.parse_args()
    print("| bearings | method | window | ms a step, median | 99 % | times ours | error, median (m) |")
    print("|---|---|---|---|---|---|---|")
    exact, noise = Scene.made(arguments.steps, 0.0), np.radians(1.0)
    noisy = Scene.made(arguments.steps, noise)
    for window in (20, 60):
        ours = partial(GaussianProcessTracker, 2, window=window, nugget=NUGGET)
        rows = {
            "this package": lambda make=ours: Ours(make()),
            "scikit-learn, from the last hyperparameters": partial(ScikitLearn, window, 0),
            "scikit-learn, three restarts as well": partial(ScikitLearn, window, 3),
        }
        show("exact", window, exact, rows, arguments.repeat)
    for window in (40, 60):
        tracker = partial(NoisyGaussianProcessTracker, 2, noise=BearingNoise(noise), window=window)
        rows = {
            "this package, averaged": lambda make=tracker: Ours(make()),
            "Stone Soup, extended Kalman filter": partial(StoneSoup, noisy, noise),
        }
        show("1° of noise", window, noisy, rows, arguments.repeat)


def show(bearings: str, window: int, scene: Scene, rows: dict[str, Callable[[], Any]], repeat: int) -> None:
    """Print the rows of one scene; the first is what the others are compared with."""
    first = None
    for name, make in rows.items():
        median, slow, error = measured(scene, make, repeat)
        first = first or median
        kept = "" if "Kalman" in name else window
        print(f"| {bearings} | {name} | {kept} | {median:.2f} | {slow:.2f} | {median / first:.2f} | {error:.2g} |")


if __name__ == "__main__":
    main()
