"""Logs of bearings spoilt at random are refused with the place of the fault, or replayed to finite numbers."""

import csv
import io
import re
import warnings
from collections import Counter

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from test_replay import log_of

from gbt_ocp.experiments.config.faults import ConfigurationError
from gbt_ocp.experiments.replay import replay

QUICK = {"tracker": {"kind": "ekf", "initial_range_m": 40.0, "bearing_std_deg": 1.0}}

CELLS = ["", " ", "nan", "NaN", "inf", "-inf", "x", "1e9", "-1e9", "1e300", "1e-300", "1e999", "0", "-0", "1,5", "1;5"]
CELLS += [
    "0x1F",
    "1_000",
    "٣",
    "\x00",
    '"',
    "\t1",
    "1.7e308",
    "--1",
    "12:30:00",
    "2026-11-25T12:00:00Z",
    "3.14",
    "-3.14",
]


@pytest.fixture(scope="module")
def tables(tmp_path_factory):
    """Rows of right logs, header first, in the plane and in space."""
    found = []
    for dimension in (2, 3):
        path = log_of(tmp_path_factory.mktemp("log") / "log.csv", dimension, duration=6.0)
        with path.open(newline="", encoding="utf-8") as file:
            found.append(list(csv.reader(file)))
    return found


@st.composite
def damages(draw):
    """What is done to a log: a function of its rows, and how they are written."""
    how = draw(
        st.lists(
            st.tuples(
                st.sampled_from(
                    ["cell"] * 4
                    + ["drop cell", "extra cell", "swap rows", "repeat row", "drop row", "column", "rename"]
                    + ["header again", "empty", "cut", "near", "near", "near"]
                ),
                st.integers(0, 10**6),
                st.integers(0, 10**6),
                st.sampled_from(CELLS),
            ),
            min_size=1,
            max_size=2,
        )
    )
    delimiter = draw(st.sampled_from([","] * 8 + [";", "\t", " "]))
    ending = draw(st.sampled_from(["\n"] * 4 + ["\r\n", "\r", "\n\n"]))
    coding = draw(st.sampled_from(["utf-8"] * 6 + ["utf-8-sig", "utf-16", "latin-1"]))
    return how, delimiter, ending, coding


def spoilt(rows, how, delimiter, ending, coding):
    """The bytes of a damaged log."""
    rows = [list(row) for row in rows]
    cut = None
    for kind, i, j, cell in how:
        k, column = 1 + i % max(1, len(rows) - 1), j % len(rows[0])
        if kind == "empty":
            rows = rows[: i % 3]
        elif kind == "cut":
            cut = i
        if len(rows) < 4:
            break
        if kind == "cell" and column < len(rows[k]):
            rows[k][column] = cell
        elif kind == "near" and column < len(rows[k]):
            rows[k][column] = rows[k - 1][column] if k > 1 else rows[k][column]
        elif kind == "drop cell" and rows[k]:
            del rows[k][column % len(rows[k])]
        elif kind == "extra cell":
            rows[k].append(cell)
        elif kind == "swap rows":
            m = 1 + j % (len(rows) - 1)
            rows[k], rows[m] = rows[m], rows[k]
        elif kind == "repeat row":
            rows[k:k] = [list(rows[k])] * (1 + j % 3)
        elif kind == "drop row":
            del rows[k]
        elif kind == "column":
            rows = [row[:column] + row[column + 1 :] for row in rows]
        elif kind == "rename":
            rows[0][column % len(rows[0])] = cell if i % 2 else rows[0][0]
        elif kind == "header again":
            rows.insert(k, list(rows[0]))
    text = io.StringIO()
    for row in rows:
        text.write(delimiter.join(row) + ending)
    data = text.getvalue().encode(coding, errors="replace")
    return data if cut is None else data[: cut % (len(data) + 1)]


def judged(path, bearing_from="x"):
    """``refused`` or ``replayed``; whatever else happens is a fault."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            # what is said of the log is no fault: gaps, and bearings that disagree with the noise
            warnings.filterwarnings("ignore", rf"{re.escape(str(path))}: ", RuntimeWarning)
            found = replay(path, QUICK, bearing_from=bearing_from)
    except ConfigurationError as fault:
        for line in fault.faults:
            assert line.isprintable(), line
            assert line.startswith(str(path)), line
            assert "found" in line or re.search(r"and \d+ more$", line), line
            assert len(line) < 600, line
            if "; allowed: a finite number of" in line:
                assert re.search(r": line \d+: \w+: found ", line), line
        return "refused"
    for track in found.tracks:
        assert np.all(np.isfinite(track.mean))
        assert np.all(np.isfinite(track.covariance))
        assert np.all(np.isfinite(track.ahead_mean))
        spread = track.covariance
        np.testing.assert_allclose(spread, np.swapaxes(spread, 1, 2), rtol=1e-9, atol=1e-9)
        least = np.linalg.eigvalsh(spread)[:, 0]
        assert np.all(least >= -1e-9 * np.abs(spread).max(axis=(1, 2)))
    return "replayed"


@pytest.mark.parametrize("examples", [80, pytest.param(1500, marks=pytest.mark.slow)])
def test_damaged_logs(tmp_path, tables, examples):
    path, counts = tmp_path / "log.csv", Counter()

    @settings(
        max_examples=examples, deadline=None, database=None, derandomize=True, suppress_health_check=list(HealthCheck)
    )
    @given(st.integers(0, 1), damages())
    def once(which, damage):
        path.write_bytes(spoilt(tables[which], *damage))
        counts[judged(path)] += 1

    once()
    print(dict(counts))
    assert min(counts.values()) > 0.15 * examples
    assert len(counts) == 2


def test_an_unclosed_quote_is_named_where_it_stands(tmp_path, tables):
    path = tmp_path / "log.csv"
    path.write_bytes(spoilt(tables[0], [("cell", 1, 0, '"')], ",", "\n", "utf-8"))
    with pytest.raises(ConfigurationError) as caught:
        replay(path, QUICK, bearing_from="x")
    # the damaged cell is in the second row below the header: line 3
    assert caught.value.faults[0].startswith(f'{path}: line 3: t: found ",a,')
    assert judged(path) == "refused"


def test_a_gap_of_thirty_years_leaves_a_covariance(tmp_path, tables):
    path = tmp_path / "log.csv"
    path.write_bytes(spoilt(tables[0], [("cell", 0, 0, "-1e9")], ",", "\n", "utf-8"))
    assert judged(path) == "replayed"
    with pytest.warns(RuntimeWarning, match="1 new track"):
        replay(path, QUICK, bearing_from="x")
