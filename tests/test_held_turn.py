"""The bank of log-polar filters: its steps against finite differences, samples and particles, and what it tracks."""

import numpy as np
import pytest

from gbt_ocp.experiments.build.trackers import build_tracker
from gbt_ocp.experiments.config.loading import load_config
from gbt_ocp.models.bearings import rotate_bearing, unit_bearing
from gbt_ocp.models.sensors import BearingSensor
from gbt_ocp.models.turning import TurningTarget
from gbt_ocp.tracking.held.ahead import positions_ahead
from gbt_ocp.tracking.held.bank import (
    AZIMUTH,
    CHANGE,
    CLIMB,
    COURSE,
    ELEVATION,
    LEVEL,
    LOG_RANGE,
    TURN,
    Components,
    HeldTurnPrior,
    advanced,
    begun,
)
from gbt_ocp.tracking.held.corrections import corrected
from gbt_ocp.tracking.held.draws import NEW_MANNER, in_every_manner, in_other_manners, let_go, merged
from gbt_ocp.tracking.held.held_turn import HeldTurnTracker
from gbt_ocp.tracking.noise import BearingNoise
from gbt_ocp.tracking.priors import LogNormal, PositionPrior
from gbt_ocp.tracking.protocol import mixed_at_median

SIGMA = np.deg2rad(1.0)
PRIOR = HeldTurnPrior(LogNormal(1.0, 0.5), LogNormal(40.0, 0.7), turn_stds=(0.03, 0.06), speed_stds=(0.05, 0.2))
both_dimensions = pytest.mark.parametrize("dimension", [2, 3])


def some(dimension, count=5, seed=0):
    rng = np.random.default_rng(seed)
    n = 6 if dimension == 2 else 8
    means = rng.normal(size=(count, n)) * 0.3
    means[:, AZIMUTH] = rng.uniform(-3.0, 3.0, count)
    means[:, COURSE] = rng.uniform(-3.0, 3.0, count)
    means[:, LOG_RANGE] = np.log(rng.uniform(10.0, 60.0, count))
    root = 0.1 * rng.normal(size=(count, n, n))
    branches = rng.integers(0, 4, count)
    return Components(rng.normal(size=count), means, root @ np.swapaxes(root, 1, 2), branches)


def cartesian(state):
    """Position relative to the vehicle, by hand."""
    r = np.exp(state[LOG_RANGE])
    if len(state) == 6:
        return r * np.array([np.cos(state[AZIMUTH]), np.sin(state[AZIMUTH])])
    e = state[ELEVATION]
    level = [np.cos(e) * np.cos(state[AZIMUTH]), np.cos(e) * np.sin(state[AZIMUTH])]
    return r * np.array([*level, np.sin(e)])


def ridden(state, step, moved, count=4000):
    """The position a step later, integrated in small steps at the turn rate and speed of the state."""
    place, course = cartesian(state), state[COURSE]
    for _ in range(count):
        middle = course + 0.5 * state[TURN] * step / count
        velocity = np.exp(state[LEVEL] + state[CHANGE]) * np.array([np.cos(middle), np.sin(middle)])
        place = place + step / count * np.append(velocity, state[CLIMB:])[: len(place)]
        course += state[TURN] * step / count
    return place - moved


@both_dimensions
def test_a_step_is_the_motion_of_the_state_and_its_slopes_are_differences(dimension):
    given, step = some(dimension), 0.5
    moved = np.array([0.7, -1.1, 0.3])[:dimension]
    after = advanced(PRIOR, given, step, moved)
    for one in range(len(given)):
        np.testing.assert_allclose(
            cartesian(after.means[one]), ridden(given.means[one], step, moved), atol=1e-3, rtol=1e-5
        )
    small = 1e-6
    for one in range(len(given)):
        n = given.means.shape[1]
        slopes = np.empty((n, n))
        for column in range(n):
            shifted = [given.means[one] + sign * small * np.eye(n)[column] for sign in (1.0, -1.0)]
            ends = [advanced(PRIOR, Components(*_single(given, one, state)), step, moved).means[0] for state in shifted]
            slopes[:, column] = (np.mod(ends[0] - ends[1] + np.pi, 2.0 * np.pi) - np.pi) / (2.0 * small)
        expected = slopes @ given.covariances[one] @ slopes.T
        keep = np.exp(-step / PRIOR.speed_time)
        expected[CHANGE, CHANGE] += PRIOR.branches[1][given.branches[one]] ** 2 * (1.0 - keep**2)
        np.testing.assert_allclose(after.covariances[one], expected, rtol=1e-5, atol=1e-8)


def _single(given, one, state):
    return given.log_weights[[one]], state[None], given.covariances[[one]], given.branches[[one]]


@both_dimensions
def test_an_update_is_that_of_the_textbook_filter(dimension):
    """Conditioning of a joint Gaussian, the information form, for the angles as linear measurements."""
    given = some(dimension)
    angles, noise = np.array([0.3, -0.2])[: dimension - 1], np.full(len(given), 0.01)
    found, density, squares = corrected(given, angles, noise)
    seen = [AZIMUTH, ELEVATION][: dimension - 1]
    for one in range(len(given)):
        m, cov = given.means[one], given.covariances[one]
        h = np.eye(len(m))[seen]
        r = 0.01 * np.eye(len(seen))
        if dimension == 3:
            r[0, 0] /= np.cos(m[ELEVATION]) ** 2
        off = angles - m[seen]
        off[0] = np.angle(np.exp(1j * off[0]))
        information = np.linalg.inv(cov) + h.T @ np.linalg.inv(r) @ h
        mean = m + np.linalg.solve(information, h.T @ np.linalg.solve(r, off))
        np.testing.assert_allclose(found.means[one], mean, atol=1e-8)
        np.testing.assert_allclose(found.covariances[one], np.linalg.inv(information), atol=1e-8)
        spread = h @ cov @ h.T + r
        expected = -0.5 * (off @ np.linalg.solve(spread, off) + np.linalg.slogdet(2.0 * np.pi * spread)[1])
        assert density[one] == pytest.approx(expected)
        assert squares[one] == pytest.approx(off @ np.linalg.solve(spread, off))
    np.testing.assert_allclose(found.log_weights, given.log_weights + density)


@both_dimensions
def test_letting_go_keeps_the_probability_and_draws_the_turn_rate_again(dimension):
    given = some(dimension, 40)
    held, again = let_go(PRIOR, given, 3.0)
    total = np.exp(given.log_weights).sum()
    share = 1.0 - np.exp(-3.0 / PRIOR.hold)
    assert np.exp(held.log_weights).sum() == pytest.approx((1.0 - share) * total)
    assert np.exp(again.log_weights).sum() == pytest.approx(share * total)
    drawn = [TURN, CLIMB][: dimension - 1]
    np.testing.assert_array_equal(again.means[:, drawn], 0.0)
    np.testing.assert_allclose(again.covariances[:, TURN, TURN], PRIOR.branches[0][again.branches] ** 2)
    assert np.all(again.covariances[:, TURN, LOG_RANGE] == 0.0)
    everything = np.exp(given.log_weights) @ given.means[:, LOG_RANGE]
    assert np.exp(again.log_weights) @ again.means[:, LOG_RANGE] == pytest.approx(share * everything)


@pytest.mark.parametrize("probability", [NEW_MANNER, 0.5])
@both_dimensions
def test_another_manner_begins_at_the_speed_that_there_is(dimension, probability):
    """Against the linear map of the state, whose change is a draw of its own; and the shares of all manners."""
    given = some(dimension, 6)
    found = in_other_manners(PRIOR, given, probability)
    assert len(found) == 12
    share = np.exp(found.log_weights).reshape(2, 6) / np.exp(given.log_weights)
    np.testing.assert_allclose(share, [[1.0 - probability] * 6, [probability] * 6])
    np.testing.assert_array_equal(found.means[:6], given.means)
    n = given.means.shape[1]
    into = np.eye(n)
    into[LEVEL, CHANGE], into[CHANGE, CHANGE] = 1.0, 0.0
    for one, other in zip(range(6), range(6, 12), strict=True):
        turn, speed = (values[found.branches[other]] for values in PRIOR.branches)
        assert turn == PRIOR.branches[0][given.branches[one]]
        assert speed != PRIOR.branches[1][given.branches[one]]
        spread = into @ given.covariances[one] @ into.T
        spread[CHANGE, CHANGE] = speed**2
        np.testing.assert_allclose(found.means[other], into @ given.means[one])
        np.testing.assert_allclose(found.covariances[other], spread, atol=1e-12)


def test_merging_is_by_moments_with_angles_across_the_cut():
    rng = np.random.default_rng(1)
    given = some(2, 4)
    given.means[:, COURSE] = [3.1, -3.1, 3.0, 0.5]
    given.means[:, AZIMUTH] = [-3.13, 3.1, -3.0, 0.2]
    found = merged(given, np.array([0, 0, 0, 1]))
    weights = np.exp(given.log_weights[:3])
    draws = np.concatenate(
        [
            rng.multivariate_normal(given.means[k], given.covariances[k], int(3e5 * weights[k] / weights.sum()))
            for k in range(3)
        ]
    )
    for place in (COURSE, AZIMUTH):
        draws[:, place] = np.mod(draws[:, place] - found.means[0, place] + np.pi, 2.0 * np.pi) + found.means[0, place]
        draws[:, place] -= np.pi
    # a normal deviation of course is small here: no draw is cut at the other side
    np.testing.assert_allclose(found.means[0], draws.mean(axis=0), atol=0.01)
    np.testing.assert_allclose(found.covariances[0], np.cov(draws.T), atol=0.02)
    np.testing.assert_allclose(found.means[1], given.means[3])
    np.testing.assert_allclose(np.exp(found.log_weights), [weights.sum(), np.exp(given.log_weights[3])])


@both_dimensions
def test_starts_cover_the_prior(dimension):
    found = begun(PRIOR, np.array([0.4, 0.3])[: dimension - 1], SIGMA**2, 7, 3, 12)
    mean = found.weights @ found.means
    assert mean[LOG_RANGE] == pytest.approx(np.log(40.0))
    apart = found.means - mean
    spread = found.weights @ (found.covariances[:, LOG_RANGE, LOG_RANGE] + apart[:, LOG_RANGE] ** 2)
    assert np.sqrt(spread) == pytest.approx(0.7, rel=0.02)
    speed = found.weights @ (found.covariances[:, LEVEL, LEVEL] + apart[:, LEVEL] ** 2)
    assert np.sqrt(speed) == pytest.approx(0.5, rel=0.02)
    assert np.bincount(found.branches).tolist() == [7 * 3 * 12, 0, 7 * 3 * 12]
    every = in_every_manner(PRIOR, found)
    assert np.bincount(every.branches).tolist() == [7 * 3 * 12] * 4
    assert np.bincount(every.branches, every.weights) == pytest.approx([0.25] * 4)
    assert every.weights @ every.means[:, LEVEL] == pytest.approx(found.weights @ found.means[:, LEVEL])


def orbit(t, dimension, radius=35.0, rate=0.08):
    """An own path round the origin that reverses every 12 s."""
    turned = np.abs(np.mod(t, 24.0) - 12.0)
    angle = rate * turned
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), 15.0 + 0.0 * t], axis=-1)[:, :dimension]


def sailed(dimension, seed, duration, **settings):
    target = TurningTarget(dimension, np.random.default_rng(seed), duration=duration + 30.0,
                           start=np.zeros(dimension), **settings)  # fmt: skip
    t = 0.1 * np.arange(int(10 * duration))
    own, truth = orbit(t, dimension), target.position(t)
    turn = SIGMA * np.random.default_rng(100 + seed).standard_normal((len(t), dimension - 1))
    return t, rotate_bearing(unit_bearing(truth, own), turn), own, target


def test_it_says_what_a_particle_filter_says():
    """20 s with a known start, by 60,000 particles that hold and draw their turn rates under the same law."""
    prior = HeldTurnPrior(LogNormal(1.0, 0.3), LogNormal(35.0, 0.5), turn_stds=(0.04,), hold=15.0, speed_stds=(0.1,))
    t, bearings, own, _ = sailed(2, 3, 20.0)
    tracker = HeldTurnTracker(
        2, noise=BearingNoise(SIGMA), prior=prior, bin_width=0.5, position=PositionPrior(own[0], np.zeros(2), np.eye(2))
    )
    rng, count = np.random.default_rng(0), 60_000
    place, course = rng.normal(size=(count, 2)), rng.uniform(-np.pi, np.pi, count)
    turn, level, change = 0.04 * rng.normal(size=count), 0.3 * rng.normal(size=count), 0.1 * rng.normal(size=count)
    log_weight, gaps, ratios = np.zeros(count), [], []
    for k, time in enumerate(t):
        tracker.update(time, bearings[k], own[k])
        if k:
            new = rng.uniform(size=count) < 1.0 - np.exp(-0.1 / 15.0)
            turn = np.where(new, 0.04 * rng.normal(size=count), turn)
            course = course + 0.1 * turn
            keep = np.exp(-0.1 / prior.speed_time)
            change = keep * change + 0.1 * np.sqrt(1.0 - keep**2) * rng.normal(size=count)
            place = place + 0.1 * np.exp(level + change)[:, None] * np.stack([np.cos(course), np.sin(course)], axis=-1)
        line = place - own[k]
        off = np.angle(np.exp(1j * (np.arctan2(line[:, 1], line[:, 0]) - np.arctan2(*bearings[k][::-1]))))
        log_weight -= 0.5 * (off / SIGMA) ** 2
        weight = np.exp(log_weight - log_weight.max())
        weight /= weight.sum()
        if k in (100, 130, 160, 195):
            mean = weight @ place
            spread = (weight[:, None] * (place - mean)).T @ (place - mean)
            found = tracker.predict([time])
            gaps.append(np.linalg.solve(np.linalg.cholesky(spread), found.mean[0] - mean))
            ratios.append(np.linalg.eigvals(np.linalg.solve(spread, found.covariance[0])).real)
        if 1.0 / np.sum(weight**2) < 0.3 * count:
            chosen = np.searchsorted(np.cumsum(weight), (np.arange(count) + rng.uniform()) / count)
            chosen = np.minimum(chosen, count - 1)
            place, course, turn, level, change = (one[chosen] for one in (place, course, turn, level, change))
            log_weight = np.zeros(count)
    assert np.abs(gaps).max() < 0.7, "in deviations of the particles' posterior"
    # never surer than the particles; the newest bearings, those of a bin that is not full, are still to come
    assert np.all((np.array(ratios) > 0.8) & (np.array(ratios) < 3.0))


def built(dimension, **changes):
    section = {"kind": "held_turn", "noise": {"std_deg": 1.0}, **changes}
    configuration = load_config({"problem": "case2" if dimension == 2 else "case5", "tracker": section})
    return build_tracker(configuration.tracker, np.zeros(dimension), BearingSensor(0.1))


@both_dimensions
def test_a_boat_of_unknown_range_is_tracked_through_its_turns(dimension):
    t, bearings, own, target = sailed(dimension, 1, 100.0)
    tracker = built(dimension)
    errors, squares = [], []
    for k, time in enumerate(t):
        tracker.update(time, bearings[k], own[k])
        if time > 40.0 and k % 20 == 0:
            forecast = tracker.predict(time + np.array([0.0, 10.0]))
            off = forecast.mean - target.position(time + np.array([0.0, 10.0]))
            errors.append(np.linalg.norm(off, axis=1) / np.linalg.norm(own[k] - target.position(time)))
            squares.append(
                [o @ np.linalg.solve(c, o) / dimension for o, c in zip(off, forecast.covariance, strict=True)]
            )
    assert tracker.range_observable
    assert tracker.restarts == 0
    now, later = np.mean(errors, axis=0)
    assert now < 0.04
    assert later < 0.12
    assert np.all(np.mean(squares, axis=0) < 2.5)


def test_a_lost_track_is_begun_again():
    t, bearings, own, target = sailed(2, 2, 120.0)
    tracker = built(2)
    away = np.where(t[:, None] < 50.0, 0.0, np.array([60.0, 80.0]))
    bearings = unit_bearing(target.position(t) + away, own)
    for k, time in enumerate(t):
        tracker.update(time, bearings[k], own[k])
    assert tracker.restarts >= 1
    error = np.linalg.norm(tracker.predict([t[-1]]).mean[0] - target.position(t[-1]) - away[-1])
    assert error < 0.15 * 100.0


@both_dimensions
def test_a_forecast_is_the_filter_carried_on_and_repeats(dimension):
    t, bearings, own, _ = sailed(dimension, 4, 40.0)
    tracker = built(dimension, noise={"std_deg": 1.0, "correlated_deg": 0.2, "own_std_m": 0.2})
    for k, time in enumerate(t):
        tracker.update(time, bearings[k], own[k])
    ahead = t[-1] + np.array([-3.0, 0.0, 1.0, 5.0, 20.0])
    first = tracker.predict(ahead)
    spreads = np.trace(first.covariance, axis1=1, axis2=2)
    assert np.all(np.diff(spreads[1:]) > 0.0)
    assert np.all(np.linalg.eigvalsh(first.covariance) > 0.0)
    for values, again in zip(first, tracker.predict(ahead), strict=True):
        np.testing.assert_array_equal(values, again)
    # led back it is about where it was believed to be
    assert np.linalg.norm(first.mean[0] - first.mean[1]) < 10.0


def test_impossible_settings_are_refused():
    with pytest.raises(ValueError, match=r"components and gate: found 0, inf; allowed"):
        HeldTurnTracker(2, noise=BearingNoise(SIGMA), prior=PRIOR, components=0)
    with pytest.raises(ValueError, match=r"hold.*allowed: numbers > 0"):
        HeldTurnPrior(LogNormal(1.0, 0.5), LogNormal(40.0, 0.7), hold=0.0)


@both_dimensions
def test_moments_ahead_are_those_of_drawn_motions(dimension):
    """20,000 motions that hold their turn rate and draw it again, in small steps."""
    prior = HeldTurnPrior(LogNormal(1.0, 0.3), LogNormal(35.0, 0.5), turn_stds=(0.03,), hold=12.0, speed_stds=(0.1,))
    n = 6 if dimension == 2 else 8
    mean = np.array([0.4, np.log(40.0), 0.7, 0.02, 0.1, 0.05, 0.2, 0.05])[:n]
    deviations = np.array([0.01, 0.03, 0.05, 0.005, 0.03, 0.03, 0.01, 0.02])[:n]
    given = Components(np.zeros(1), mean[None], np.diag(deviations**2)[None], np.zeros(1, dtype=np.intp))
    times = np.arange(0.0, 17.0, 2.0)
    means, covariances = positions_ahead(prior, given, times)
    rng, count, step = np.random.default_rng(0), 20_000, 0.2
    states = mean + deviations * rng.standard_normal((count, n))
    place = Components(np.zeros(count), states, np.zeros((count, n, n)), np.zeros(count, dtype=np.intp)).positions()[0]
    course, turn, change = states[:, COURSE], states[:, TURN], states[:, CHANGE]
    climb = states[:, CLIMB] if dimension == 3 else np.zeros(count)
    keep = np.exp(-step / prior.speed_time)
    for number in range(81):
        if number % 10 == 0:
            node = number // 10
            root = np.linalg.cholesky(np.cov(place.T))
            assert np.abs(np.linalg.solve(root, place.mean(axis=0) - means[0, node])).max() < 0.12
            whitened = np.linalg.solve(root, np.linalg.solve(root, covariances[0, node]).T)
            np.testing.assert_allclose(
                whitened, np.eye(dimension), atol=0.15
            )  # a course off by 0.4 rad is no small one
        speed = np.exp(states[:, LEVEL] + change)
        middle = course + 0.5 * step * turn
        way = np.stack([speed * np.cos(middle), speed * np.sin(middle), climb], axis=-1)[:, :dimension]
        place, course = place + step * way, course + step * turn
        change = keep * change + 0.1 * np.sqrt(1.0 - keep**2) * rng.standard_normal(count)
        again = rng.uniform(size=count) < 1.0 - np.exp(-step / prior.hold)
        turn = np.where(again, 0.03 * rng.standard_normal(count), turn)
        climb = np.where(again, prior.climb_std * rng.standard_normal(count), climb)


def test_a_range_over_decades_is_reported_at_its_median():
    """Samples of a log-normal range on one line of sight: median, and the deviation of its logarithm times it."""
    weights = np.array([0.2, 0.5, 0.3])
    line, ranges = np.array([0.6, 0.8]), np.exp([3.0, 4.0, 5.5])
    spread = 0.3 * ranges[:, None, None] * np.outer(line, line)
    means = (ranges[:, None] * line)[:, None]
    mean, covariance = mixed_at_median(weights, means, (spread @ np.swapaxes(spread, 1, 2))[:, None])
    middle = weights @ [3.0, 4.0, 5.5]
    np.testing.assert_allclose(mean[0], np.exp(middle) * line)
    variance = 0.09 + weights @ (np.array([3.0, 4.0, 5.5]) - middle) ** 2
    np.testing.assert_allclose(covariance[0], np.exp(2.0 * middle) * variance * np.outer(line, line))
