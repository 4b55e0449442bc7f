"""The verdict in words: every sentence is made from tables, and names them."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence

from gbt_ocp.experiments.comparison.tables import Row, column
from gbt_ocp.experiments.comparison.treatments import Pair

Tables = Mapping[str, list[Row]]

ROUND_OFF = 1.0e-9
"""Executed violation that still counts as round-off."""


def verdict(tables: Tables, pairs: Sequence[Pair]) -> list[str]:
    """Sentences, the general ones first; each ends with the tables that it rests on."""
    return [
        *_winners(tables, pairs),
        *(_of_pair(tables, pair, pairs[0]) for pair in pairs),
        *_hard_against_penalty(tables, pairs),
        *_nodes(tables, pairs),
        *_closed_loops(tables, pairs),
        *_stiffness(tables),
    ]


def _rows(rows: Iterable[Row], pair: Pair) -> list[Row]:
    return [row for row in rows if (row["formulation"], row["solver"]) == (pair.formulation, pair.solver)]


def _span(values: Iterable[float], form: Callable[[float], str]) -> str:
    """``a`` or ``a to b`` of the finite ones."""
    finite = sorted(value for value in values if math.isfinite(value))
    if not finite:
        return "no number"
    low, high = form(finite[0]), form(finite[-1])
    return low if low == high else f"{low} to {high}"


def _share(value: float) -> str:
    # 99.96 % is not all
    return f"{math.floor(1000.0 * value) / 10.0:g} %"


def _short(value: float) -> str:
    return f"{value:.3g}"


def _winners(tables: Tables, pairs: Sequence[Pair]) -> list[str]:
    table = tables["open_loop"]
    sure, kept = [], []
    for pair in pairs:
        rows = _rows(table, pair)
        if rows and all(row["solved"] == row["problems"] for row in rows):
            sure.append(pair)
            if all(row["kept"] == row["problems"] for row in rows):
                kept.append(pair)
    if not sure:
        return ["No pair solved every problem (table open_loop)."]
    names = "; ".join(pair.name for pair in sure)
    lines = [f"Every problem of every set was solved by: {names} (table open_loop)."]
    if not kept:
        return [*lines, "None of them kept the true limits between the nodes in all of them (table open_loop)."]
    flat = [pair for pair in kept if pair.formulation != "shooting"] or kept
    speed = {pair: max(column(_rows(table, pair), "time_99_ms")) for pair in kept}
    loss = {pair: max(column(_rows(table, pair), "gap_mean")) for pair in flat}
    fastest, closest = min(speed, key=lambda pair: speed[pair]), min(loss, key=lambda pair: loss[pair])
    lines.append(
        f"Of those, {'; '.join(pair.name for pair in kept)} also kept the true limits on the fine grid in every "
        f"problem. The fastest of these is {fastest.name}, with 99 % of the solves of every set below "
        f"{_short(speed[fastest])} ms; the flat one nearest to the best known objective is {closest.name}, whose mean "
        f"gap is at most {_short(loss[closest])} in every set (table open_loop)."
    )
    return lines


def _of_pair(tables: Tables, pair: Pair, first: Pair) -> str:
    rows = _rows(tables["open_loop"], pair)
    text = (
        f"{pair.name}: solved {_span(column(rows, 'solved_share'), _share)} of each set, median "
        f"{_span(column(rows, 'time_median_ms'), _short)} ms, 99 % {_span(column(rows, 'time_99_ms'), _short)} ms, "
        f"mean gap {_span(column(rows, 'gap_mean'), _short)}"
    )
    worst = max(column(rows, "violation_between_max"), default=math.nan)
    broken = sum(row["broken_between"] for row in rows)
    solved = sum(row["solved"] for row in rows)
    if broken:
        text += f", true limits broken between the nodes in {broken} of {solved} solutions, by {_share(worst)} at most"
    else:
        text += f", true limits kept between the nodes in all of {solved} solutions"
    against = [row for row in tables["paired"] if (row["pair"], row["against"]) == (pair.name, first.name)]
    if not against:
        return f"{text} (table open_loop)."
    total = sum(row["both_solved"] for row in against)
    counts = [sum(row[key] for row in against) for key in ("better", "equal", "worse")]
    return (
        f"{text} (table open_loop); {_span(column(against, 'times_faster'), _short)} times as fast as {first.name}, "
        f"objective better in {counts[0]}, equal in {counts[1]} and worse in {counts[2]} of the {total} problems that "
        f"both solved (table paired)."
    )


def _hard_against_penalty(tables: Tables, pairs: Sequence[Pair]) -> list[str]:
    lines = []
    for pair in pairs:
        other = Pair("elastic", pair.solver).name
        rows = [row for row in tables["paired"] if (row["pair"], row["against"]) == (pair.name, other)]
        if rows and pair.formulation == "hard":
            total = sum(row["both_solved"] for row in rows)
            counts = [sum(row[key] for row in rows) for key in ("better", "equal", "worse")]
            sure = sum(row["objective_more_low"] > 0.0 or row["objective_more_high"] < 0.0 for row in rows)
            lines.append(
                f"The penalty and the hard limits, both at their best with {pair.solver}: hard limits are "
                f"{_span(column(rows, 'times_faster'), _short)} times as fast; their objective is better in "
                f"{counts[0]}, equal in {counts[1]} and worse in {counts[2]} of {total} problems, by "
                f"{_span(column(rows, 'objective_more'), _short)} in the mean of a set, of which {sure} of {len(rows)} "
                f"differ from zero beyond the 95 % interval (table paired)."
            )
    return lines


def _nodes(tables: Tables, pairs: Sequence[Pair]) -> list[str]:
    lines = []
    for pair in pairs:
        plain = Pair("hard", pair.solver)
        if pair.formulation == "exchange" and plain in pairs:
            before, after = (_rows(tables["open_loop"], one) for one in (plain, pair))
            lines.append(
                f"With {pair.solver}, the nodes alone left a true limit broken between them in "
                f"{sum(row['broken_between'] for row in before)} of {sum(row['solved'] for row in before)} solutions "
                f"(by {_share(max(0.0, *column(before, 'violation_between_max')))} at most), exchange in "
                f"{sum(row['broken_between'] for row in after)} of {sum(row['solved'] for row in after)} (table "
                f"open_loop)."
            )
    for name in ("hard", "exchange", "elastic"):
        rows = [row for row in tables["sensitivity"] if row["swept"] == "gamma" and row["formulation"] == name]
        tight = [row for row in rows if row["value"] == max(row["value"] for row in rows)]
        if tight:
            lines.append(
                f"At γ = {tight[0]['value']}, {name} ({tight[0]['solver']}) solved "
                f"{sum(row['solved'] for row in tight)} of {sum(row['problems'] for row in tight)} and broke a true "
                f"limit between the nodes in {sum(row['broken_between'] for row in tight)} of them (table sensitivity)."
            )
    return lines


def _closed_loops(tables: Tables, pairs: Sequence[Pair]) -> list[str]:
    lines = []
    for pair in pairs:
        rows = _rows(tables["closed_loop"], pair)
        if rows:
            broken = max(column(rows, "violation_max"))
            counts = {
                word: sum(row[f"fallbacks_{word}"] for row in rows) for word in ("shifted", "cold", "braking", "other")
            }
            used = ", ".join(f"{count} {word}" for word, count in counts.items() if count) or "none"
            errors = "; ".join(f"{row['case']} {_short(row['error_settled'])}" for row in rows)
            lines.append(
                f"In closed loop, {pair.name} ({_span(column(rows, 'runs'), lambda runs: f'{runs:g}')} seeds a case): "
                f"settled error in m {errors}; executed thrust above its limit by "
                f"{'nothing' if broken <= ROUND_OFF else _share(broken)}; fallbacks {used} in "
                f"{sum(row['steps'] for row in rows)} steps (table closed_loop)."
            )
    rows = tables["closed_loop_paired"]
    if rows:
        apart = [row for row in rows if row["error_more_low"] > 0.0 or row["error_more_high"] < 0.0]
        largest = max(rows, key=lambda row: abs(row["error_more"]))
        lines.append(
            f"Settled errors on the same seeds, against {rows[0]['against']}: {len(apart)} of {len(rows)} differences "
            f"have a 95 % interval without zero; the largest is {largest['error_more']:+.2g} m ({largest['pair']}, "
            f"{largest['case']}) (table closed_loop_paired)."
        )
    return lines


def _stiffness(tables: Tables) -> list[str]:
    lines = []
    rows = [
        row for row in tables["sensitivity"] if row["kink_mm"] is not None and row["swept"] not in ("gamma", "nodes")
    ]
    for name, told in (("penalty", "as printed"), ("elastic", "told as inequalities (elastic)")):
        mine = [row for row in rows if row["formulation"] == name]
        if not mine:
            continue
        failing = [row for row in mine if row["solved"] < row["problems"]]
        if not failing:
            low, high = min(column(mine, "kink_mm")), max(column(mine, "kink_mm"))
            lines.append(
                f"The penalty {told} was solved by IPOPT at every setting, with kinks from {_short(low)} to "
                f"{_short(high)} mm of endpoint motion (table sensitivity)."
            )
            continue
        easiest = min(column(failing, "stiffness"))
        below = [row for row in mine if row["stiffness"] < easiest * (1.0 - 1e-9)]
        hardest = max(failing, key=lambda row: row["stiffness"])
        safe = (
            f"every problem up to a stiffness of {_short(max(column(below, 'stiffness')))} "
            if below
            else "at no stiffness every problem "
        )
        worst = [row for row in mine if row["stiffness"] >= hardest["stiffness"] * (1.0 - 1e-9)]
        lines.append(
            f"The penalty {told} was solved by IPOPT in {safe}and not all from {_short(easiest)} on; at the stiffest "
            f"setting ({_short(hardest['stiffness'])}, a kink of {_short(hardest['kink_mm'])} mm of endpoint motion) "
            f"in {sum(row['solved'] for row in worst)} of {sum(row['problems'] for row in worst)} (table sensitivity)."
        )
    return lines
