"""Held thrust against held acceleration: the tables of docs/shooting.md.

    python benchmarks/shooting.py --study gap,starts,reach,loop [--problems 60] [--seeds 10] [--out DIR]

gap      the same cold problems solved by every form of :mod:`shooting_forms`, for the vehicle as it is, without drag,
         with its yaw locked, and with both,
starts   whether the flat form misses a better optimum: other starts, the endpoints that shooting found among them,
reach    the area that the last endpoint can reach,
loop     closed loops; every run is kept in DIR/loop.csv, and the same command goes on where it was interrupted.

Every solution is judged on its own motion: endpoints by integration (or exactly, where flat), thrust on a fine grid.
"""

from __future__ import annotations

import argparse
import csv
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
from scipy.stats import bootstrap
from shooting_forms import FORMS, Form, Reach, falcon, make, make_in_loop

from gbt_ocp.experiments.build.loop import build_loop
from gbt_ocp.experiments.config.loading import load_config
from gbt_ocp.guidance.objectives import BearingSimilarity, RangePull
from gbt_ocp.models.bearings import DesiredBearing
from gbt_ocp.models.fossen import FossenVehicle
from gbt_ocp.ocp import Objective

PERIOD = 0.1

FREER = ("flat, degree 3, C1", "flat, degree 4, C1")
"""Flat pieces that share only position and velocity."""


def cold_problems(dimension: int, pieces: int, count: int) -> Iterator[tuple[np.ndarray, dict[str, Any]]]:
    """Random states, forecasts and desired bearings: metres away, at about 1 m/s."""
    rng = np.random.default_rng(0)
    ahead = PERIOD * np.arange(1, pieces + 1)
    desired = DesiredBearing(dimension, 2.0 * np.pi / (1.0 if dimension == 2 else 0.4))
    for _ in range(count):
        state = np.zeros((2, dimension + 1))
        state[0, :dimension] = rng.uniform(-5.0, 5.0, dimension)
        state[1] = rng.normal(size=dimension + 1) * ([1.0] * dimension + [0.5])
        mean = rng.normal(size=dimension) + ahead[:, None] * rng.normal(size=dimension)
        root = 0.2 * rng.normal(size=(dimension, dimension))
        forecast = SimpleNamespace(mean=mean, covariance=np.tile(root @ root.T, (pieces, 1, 1)))
        yield state, {"forecast": forecast, "desired": desired(rng.uniform(0.0, 1.0) + ahead)}


def objectives(dimension: int, pull: float) -> tuple[Objective, ...]:
    """The similarity, and the pull of preset default unless ``pull`` is zero."""
    similarity = BearingSimilarity(dimension)
    return (similarity, RangePull(dimension, pull)) if pull > 0.0 else (similarity,)


def without_drag(vehicle: FossenVehicle) -> FossenVehicle:
    """The same masses in a vacuum."""
    none = [0.0] * vehicle.flat_dimension
    return FossenVehicle(replace(vehicle.parameters, linear_drag=none, quadratic_drag=none), vehicle.thrust_max)


def interval(values: np.ndarray) -> str:
    """Mean with its 95 % bootstrap interval."""
    if np.ptp(values) < 1e-9:
        return f"{values.mean():+.3f}"
    rng = np.random.default_rng(0)
    low, high = bootstrap((values,), np.mean, n_resamples=2000, random_state=rng).confidence_interval
    return f"{values.mean():+.3f} ({low:+.3f} to {high:+.3f})"


def print_row(*cells: object) -> None:
    """One line of a Markdown table, at once."""
    print(f"| {' | '.join(str(cell) for cell in cells)} |", flush=True)


def print_header(*cells: str) -> None:
    """Head of a Markdown table."""
    print()
    print_row(*cells)
    print_row(*["---"] * len(cells))


def gap(arguments: argparse.Namespace) -> None:
    """Objective of every form on the same problems."""
    for d, pieces, pull in ((2, 5, 0.0), (2, 5, 0.2), (2, 10, 0.0), (3, 5, 0.0)):
        problems = list(cold_problems(d, pieces, arguments.problems))
        plain = falcon(d)
        studied = [("the vehicle", plain, "", tuple(FORMS))]
        if (d, pieces, pull) == (2, 5, 0.0):
            some = ("flat", "body acceleration", "thrust")
            studied += [
                ("without drag", without_drag(plain), "", some),
                ("yaw locked", plain, ", yaw locked", ("flat", "thrust")),
                ("without drag, yaw locked", without_drag(plain), ", yaw locked", ("flat", "thrust")),
            ]
        else:
            studied = [("the vehicle", plain, "", ("flat", *FREER, "flat, half pieces", "body acceleration", "thrust"))]
        print(f"\nd{d} p{pieces} pull {pull}: {len(problems)} problems")
        print_header(
            "vehicle",
            "held",
            "solved",
            "objective",
            "more than flat",
            "better in",
            "thrust used",
            "peak thrust",
            "iterations",
        )
        for label, vehicle, suffix, names in studied:
            base: tuple[np.ndarray, np.ndarray] | None = None
            for name in names:
                form = make(name + suffix, vehicle, pieces, objectives(d, pull))
                found = [form.solve(state, data) for state, data in problems]
                values = np.array([one.objective for one in found])
                solved = np.array([one.solved for one in found])
                base = (values, solved) if base is None else base
                both, more = solved & base[1], values - base[0]
                peak, iterations = max(one.peak for one in found), np.mean([one.iterations for one in found])
                used = f"{np.mean([one.used for one in found]):.2f}"
                better = f"{np.mean(more[both] > 1e-4):.0%}"
                cells = (
                    f"{values[solved].mean():.3f}",
                    interval(more[both]),
                    better,
                    used,
                    f"{peak:.3f}",
                    f"{iterations:.0f}",
                )
                print_row(label, name, f"{solved.sum()}/{len(found)}", *cells)


def starts(arguments: argparse.Namespace) -> None:
    """Whether the flat form stops at a worse local optimum than it has."""
    d, pieces, random = 2, 5, 8
    rng = np.random.default_rng(1)
    flat, thrust = (make(name, falcon(d), pieces, objectives(d, 0.0)) for name in ("flat", "thrust"))
    columns: dict[str, list[float]] = {
        name: [] for name in ("cold", "from", "best", "shooting", "shooting best", "peak")
    }
    for state, data in cold_problems(d, pieces, arguments.problems):
        shot = thrust.solve(state, data)
        through = flat.through(state, shot.endpoints)
        columns["peak"].append(flat.peak(state, through))
        cold, led = flat.solve(state, data), flat.solve(state, data, through)
        tries = [cold, led, *(flat.solve(state, data, rng.uniform(-1.0, 1.0, flat.shape)) for _ in range(random))]
        shots = [shot, *(thrust.solve(state, data, rng.uniform(-1.0, 1.0, thrust.shape)) for _ in range(2))]
        columns["cold"].append(cold.objective)
        columns["from"].append(led.objective if led.solved else np.nan)
        columns["best"].append(max(one.objective for one in tries if one.solved))
        columns["shooting"].append(shot.objective)
        columns["shooting best"].append(max(one.objective for one in shots if one.solved))
    value = {name: np.array(column) for name, column in columns.items()}
    print("\nOther starts")
    print_header("quantity", "value")
    print_row("problems", len(value["cold"]))
    print_row("flat, from coasting", f"{value['cold'].mean():.3f}")
    print_row("flat, from the endpoints of shooting", f"{np.nanmean(value['from']):.3f}")
    print_row(f"flat, best of these and {random} random starts", f"{value['best'].mean():.3f}")
    print_row("shooting, from coasting", f"{value['shooting'].mean():.3f}")
    print_row("shooting, best of coasting and 2 random starts", f"{value['shooting best'].mean():.3f}")
    print_row("shooting more than flat, both from coasting", interval(value["shooting"] - value["cold"]))
    print_row("shooting more than flat, both at their best", interval(value["shooting best"] - value["best"]))
    print_row(
        "flat through the endpoints of shooting: median peak thrust over its limit", f"{np.median(value['peak']):.2f}"
    )


STATES = {"at rest": (0.0, 0.0, 0.0), "2 m/s ahead": (2.0, 0.0, 0.0), "2 m/s ahead, turning 6 rad/s": (2.0, 0.0, 6.0)}
"""Velocities and yaw rate from which the reach is measured."""

REACHING = ("flat", *FREER, "flat, half pieces", "body acceleration", "thrust")


def reach(arguments: argparse.Namespace) -> None:
    """Area of the convex hull of what the last endpoint reaches."""
    d = 2
    print("\nReach")
    print_header("start", "p", *REACHING)
    for pieces in (1, 2, 5):
        forms = [make(name, falcon(d), pieces, (Reach(d),)) for name in REACHING]
        for label, velocity in STATES.items():
            areas = []
            for form in forms:
                x, y = outline(form, velocity).T
                areas.append(0.5 * abs(float(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)))))
            print_row(label, pieces, f"{areas[0]:.4f} m²", *(f"{area / areas[0]:.2f}" for area in areas[1:]))


def outline(form: Form, velocity: tuple[float, ...], directions: int = 32) -> np.ndarray:
    """Polygon ``(directions, 2)`` around what the last endpoint reaches, by its support in even directions.

    Its sides touch the convex hull, from outside.
    """
    pieces, state = form.problem.pieces, np.array([[0.0] * len(velocity), velocity])
    angles = np.linspace(0.0, 2.0 * np.pi, directions, endpoint=False)
    guesses = [np.zeros(form.shape) for _ in range(3)]
    # turning either way gives a local optimum of its own
    guesses[1][:, -1], guesses[2][:, -1] = 0.5, -0.5
    support = np.zeros(directions)
    for i, angle in enumerate(angles):
        wanted = np.zeros((pieces, 2))
        wanted[-1] = np.cos(angle), np.sin(angle)
        found = [form.solve(state, {"directions": wanted}, guess) for guess in guesses]
        support[i] = max(one.objective for one in found if one.solved)
    step = angles[1] - angles[0]
    # where two neighbouring sides meet, along the first one
    across = (np.roll(support, -1) - support * np.cos(step)) / np.sin(step)
    c, s = np.cos(angles), np.sin(angles)
    return np.stack([support * c - across * s, support * s + across * c], axis=1)


COLUMNS = (
    "case",
    "preset",
    "pull",
    "p",
    "held",
    "seed",
    "least",
    "median",
    "share",
    "objective",
    "yaw_rate",
    "distance",
    "solved",
    "error",
)


SETTLING_S = 2.0
"""Time from which errors count as settled, as in the summary of a run."""


def one_run(case: str, preset: str, pull: float, pieces: int, name: str, seed: int, seconds: float) -> list[float]:
    """A closed loop in which the vehicle goes exactly where the form's model leads.

    The settled error is that of a run: the mean over all predicted positions, the present one among them.
    """
    overrides = [f"preset={preset}", f"planner.pieces={pieces}", "planner.formulation=hard", "planner.solver=compiled"]
    loop, start = build_loop(load_config(case, overrides=overrides, seed=seed))
    d = loop.target.dimension
    form = make_in_loop(name, falcon(d), pieces, objectives(d, pull))
    state = form.start(start)
    predicted = PERIOD * np.arange(loop.forecast + 1)
    ahead = PERIOD * np.arange(1, pieces + 1)
    rows = []
    for k in range(round(seconds / PERIOD) + 1):
        t = k * PERIOD
        own, truth = state[0, :d], loop.target.position(np.array([t]))[0]
        bearing = loop.sensor.measure(k, truth, own, loop.rng)
        assert bearing is not None, "no bearing is missed in these cases"
        loop.tracker.update(t, bearing, own)
        beliefs = loop.tracker.predict(t + predicted)
        error = np.linalg.norm(beliefs.mean - loop.target.position(t + predicted), axis=1).mean()
        forecast = SimpleNamespace(mean=beliefs.mean[1 : pieces + 1], covariance=beliefs.covariance[1 : pieces + 1])
        plan = form.planner.solve(state, forecast, loop.desired(t + ahead))
        line = truth - own
        distance = np.linalg.norm(line)
        similarity = loop.desired(t) @ line / distance
        rows.append((similarity, plan.objective / pieces, abs(state[1, -1]), distance, plan.solved, error))
        state = plan.knots[1]
    found = np.array(rows, dtype=float)
    half = found[len(rows) // 2 :]
    kept = np.mean(half[:, 0] > 0.9)
    return [
        half[:, 0].min(),
        np.median(half[:, 0]),
        kept,
        half[:, 1].mean(),
        *np.median(half[:, 2:4], 0),
        half[:, 4].mean(),
        found[round(SETTLING_S / PERIOD) :, 5].mean(),
    ]


def loop(arguments: argparse.Namespace) -> None:
    """Closed loops, kept run by run."""
    arguments.out.mkdir(parents=True, exist_ok=True)
    path = arguments.out / "loop.csv"
    if not path.exists():
        path.write_text(",".join(COLUMNS) + "\n", encoding="utf-8")
    done = {tuple(row[:6]): row for row in list(csv.reader(path.open(encoding="utf-8")))[1:]}
    print("\nClosed loop")
    print_header(
        "case",
        "preset",
        "pull",
        "p",
        "held",
        "seeds",
        "least",
        "median",
        "share above 0.9",
        "objective / p",
        "yaw rate (rad/s)",
        "distance (m)",
        "solved",
        "settled error (m)",
    )
    for setting in arguments.settings.split(";"):
        case, preset, pull, pieces, name = setting.split(":")
        for seed in range(arguments.seeds):
            key = (case, preset, pull, pieces, name, str(seed))
            if key not in done:
                values = one_run(case, preset, float(pull), int(pieces), name, seed, arguments.seconds)
                done[key] = [*key, *(str(float(value)) for value in values)]
                with path.open("a", encoding="utf-8", newline="") as file:
                    csv.writer(file).writerow(done[key])
        found = np.array(
            [done[case, preset, pull, pieces, name, str(seed)][6:] for seed in range(arguments.seeds)], dtype=float
        )
        least, median = (f"{column.min():.3f} to {column.max():.3f}" for column in found[:, :2].T)
        print_row(
            case,
            preset,
            pull,
            pieces,
            name,
            len(found),
            least,
            median,
            *(f"{np.mean(c):.2f}" for c in found[:, 2:6].T),
            f"{np.mean(found[:, 6]):.4f}",
            f"{np.mean(found[:, 7]):.4f}",
        )


HELD = (
    "flat",
    "flat, degree 3",
    "flat, degree 4",
    "flat, degree 5",
    *FREER,
    "body acceleration",
    "flat, half pieces",
    "thrust",
)
SETTINGS = ";".join(
    [f"case2:paper:0:5:{name}" for name in HELD]
    + [f"case2:paper:0:10:{name}" for name in ("flat", "thrust", FREER[1])]
    + [
        "case2:paper:0.02:5:flat",
        "case2:default:0.2:5:flat",
        "case2:default:0.2:5:thrust",
        f"case2:default:0.2:5:{FREER[1]}",
        "case2:default:0.2:10:flat",
    ]
)
"""Closed loops; ``preset`` chooses the tracker, ``pull`` the planner's range pull."""

STUDIES = {"gap": gap, "starts": starts, "reach": reach, "loop": loop}


def main() -> None:
    """Run the studies that are asked for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--study", default=",".join(STUDIES))
    parser.add_argument("--problems", type=int, default=60)
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--seconds", type=float, default=30.0)
    parser.add_argument(
        "--settings", default=SETTINGS, help="closed loops, case:preset:pull:p:held, parted by semicolons"
    )
    parser.add_argument("--out", type=Path, default=Path("shooting"))
    arguments = parser.parse_args()
    for name in arguments.study.split(","):
        STUDIES[name](arguments)


if __name__ == "__main__":
    main()
