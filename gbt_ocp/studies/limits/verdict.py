"""The verdict in words: every sentence is made from tables, and names them."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence

from gbt_ocp.simulation.summary import FALLBACKS
from gbt_ocp.studies.limits.comparison_tables import Row, Tables, column
from gbt_ocp.studies.limits.treatments import Pair

ROUND_OFF = 1.0e-9
"""Executed violation that still counts as round-off."""

TRUSTED = 0.99
"""Share of the problems solved with the true limits kept from which a pair may be called the fastest or the best."""


def verdict(tables: Tables, pairs: Sequence[Pair]) -> list[str]:
    """Sentences, the general ones first; each ends with the tables that it rests on."""
    # of those that fit a configuration
    pairs = [pair for pair in pairs if _rows(tables["open_loop"], pair)]
    return [
        *_winners(tables, pairs),
        *(_of_pair(tables, pair, pairs[0]) for pair in pairs),
        *_hard_against_penalty(tables, pairs),
        *integrated_against_flat(tables, pairs),
        *_nodes(tables, pairs),
        *_closed_loops(tables, pairs),
        *_at_a_distance(tables, pairs),
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


def _signed_share(value: float) -> str:
    return f"{100.0 * value:+.3g} %"


def _excess(value: float) -> str:
    """A violation in per cent, rounded up: it is what a limit was broken by at most."""
    return f"{math.ceil(1e4 * value - 1e-6) / 100.0:g} %" if math.isfinite(value) else "no finite number"


def _short(value: float) -> str:
    return f"{value:.3g}"


def _winners(tables: Tables, pairs: Sequence[Pair]) -> list[str]:
    table = tables["open_loop"]
    measured = [pair for pair in pairs if _rows(table, pair)]
    if not measured:
        return []
    sums = {
        pair: {key: sum(row[key] for row in _rows(table, pair)) for key in ("problems", "solved", "kept")}
        for pair in measured
    }
    sure = [pair for pair in measured if sums[pair]["solved"] == sums[pair]["problems"]]
    names = "; ".join(pair.name for pair in sure)
    lines = [
        f"Every problem of every set was solved by: {names} (table open_loop)."
        if sure
        else "No pair solved every problem (table open_loop)."
    ]
    share = {pair: sums[pair]["kept"] / sums[pair]["problems"] for pair in measured}
    order = sorted(measured, key=lambda pair: -share[pair])
    ranks = "; ".join(f"{one.name} {_share(share[one])}" for one in order)
    lines.append(
        f"Share of all problems that were solved with the true limits kept on the fine grid between the nodes: {ranks} "
        "(table open_loop)."
    )
    trusted = [pair for pair in measured if share[pair] >= TRUSTED]
    if not trusted:
        return [*lines, f"None of them reached {_share(TRUSTED)} (table open_loop)."]
    flat = [pair for pair in trusted if pair.formulation != "shooting"]
    speed = {pair: max(column(_rows(table, pair), "time_99_ms")) for pair in trusted}
    fastest = min(speed, key=lambda pair: speed[pair])
    text = (
        f"Of the pairs with at least {_share(TRUSTED)} the fastest is {fastest.name}, with 99 % of the solves of every "
        f"set within {_short(speed[fastest])} ms"
    )
    if flat:
        loss = {pair: max(column(_rows(table, pair), "gap_mean")) for pair in flat}
        closest = min(loss, key=lambda pair: loss[pair])
        text += (
            f"; the flat one nearest to the best known objective is {closest.name}, whose mean gap is at most "
            f"{_short(loss[closest])} in every set"
        )
    return [*lines, f"{text} (table open_loop)."]


def _of_pair(tables: Tables, pair: Pair, first: Pair) -> str:
    rows = _rows(tables["open_loop"], pair)
    text = (
        f"{pair.name}: solved {_span(column(rows, 'solved_share'), _share)} of each set, median "
        f"{_span(column(rows, 'time_median_ms'), _short)} ms, 99 % {_span(column(rows, 'time_99_ms'), _short)} ms, "
        f"mean gap {_span(column(rows, 'gap_mean'), _short)}"
    )
    broken = sum(row["broken_between"] for row in rows)
    solved = sum(row["solved"] for row in rows)
    if not solved:
        text = f"{pair.name}: solved no problem"
    elif broken:
        worst = max(0.0, *column(rows, "violation_between_max"))
        text += f", true limits broken between the nodes in {broken} of {solved} solutions, by {_excess(worst)} at most"
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


def integrated_against_flat(tables: Tables, pairs: Sequence[Pair]) -> list[str]:
    """What trajectories by integration are worth beside flat ones, a sentence a pair."""
    lines = []
    for pair in (one for one in pairs if one.formulation == "shooting"):
        others = [Pair(name, pair.solver).name for name in ("soft", "hard")]
        against = [row for row in tables["paired"] if row["pair"] == pair.name and row["against"] in others]
        for other in dict.fromkeys(row["against"] for row in against):
            rows = [row for row in against if row["against"] == other]
            counts = [sum(row[key] for row in rows) for key in ("better", "equal", "worse")]
            lines.append(
                f"Trajectories by integration beside flat ones under the same limits, {pair.name} and {other}: "
                f"{_span(column(rows, 'times_faster'), _short)} times as fast; solved in "
                f"{_span(column(rows, 'solved_more'), _signed_share)} more of a set; objective better in {counts[0]}, "
                f"equal in {counts[1]} and worse in {counts[2]} of the {sum(row['both_solved'] for row in rows)} "
                f"problems that both solved, by {_span(column(rows, 'objective_more'), _short)} in the mean of a set "
                "(table paired)."
            )
    return lines


def _nodes(tables: Tables, pairs: Sequence[Pair]) -> list[str]:
    lines = []
    for pair in pairs:
        plain = Pair("hard", pair.solver)
        if pair.formulation == "exchange" and plain in pairs:
            before, after = (_rows(tables["open_loop"], one) for one in (plain, pair))
            most = max(0.0, *column(before, "violation_between_max"))
            by = f" (by {_excess(most)} at most)" if most > 0.0 else ""
            lines.append(
                f"With {pair.solver}, the nodes alone left a true limit broken between them in "
                f"{sum(row['broken_between'] for row in before)} of {sum(row['solved'] for row in before)} solutions"
                f"{by}, exchange in "
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
            violations = column(rows, "violation_max")
            # a run whose violation is not a number has no largest one
            broken = max(violations) if all(map(math.isfinite, violations)) else math.inf
            counts = {word: sum(row[f"fallbacks_{word}"] for row in rows) for word in (*FALLBACKS, "other")}
            used = [f"{count} {word}" for word, count in counts.items() if count]
            steps = sum(row["steps"] for row in rows)
            errors = ", ".join(f"{_error(row)} in {row['case']}" for row in rows)
            seeds = _span(column(rows, "runs"), lambda runs: f"{runs:g} seed{'s' * (runs > 1)}")
            kept = "kept all limits of the thrust"
            if broken > ROUND_OFF:
                kept = f"broke a limit of the thrust by {_excess(broken)}"
            fell = f"needed no fallback in {steps} steps"
            if used:
                fell = f"needed fallbacks in some of {steps} steps ({', '.join(used)})"
            lines.append(
                f"In closed loop ({seeds} a case), {pair.name} settles at an error of {errors}, {kept} and {fell} "
                "(table closed_loop)."
            )
    paired = tables["closed_loop_paired"]
    if paired:
        several = [row for row in paired if row["runs"] > 1]
        apart = [row for row in several if row["error_more_low"] > 0.0 or row["error_more_high"] < 0.0]
        largest = max(paired, key=lambda row: abs(row["error_more"]))
        lines.append(
            f"Settled errors on the same seeds, against {paired[0]['against']}: {len(apart)} of {len(several)} "
            f"differences over several seeds have a 95 % interval without zero; the largest of all is "
            f"{largest['error_more']:+.2g} m ({largest['pair']}, {largest['case']}) (table closed_loop_paired)."
        )
    return lines


def _at_a_distance(tables: Tables, pairs: Sequence[Pair]) -> list[str]:
    """Of each configuration with limits besides thrust: every pair, and which is to be preferred."""
    lines = []
    table = tables["at_a_distance"]
    for case in dict.fromkeys(row["case"] for row in table):
        found = {pair: row for pair in pairs for row in _rows(table, pair) if row["case"] == case}
        lines += [_of_distant(case, pair, row) for pair, row in found.items()]
        # what a vehicle must not do comes before how well it does the rest
        order = sorted(found, key=lambda pair: (_harm(found[pair]), found[pair]["relative_error"]))
        if len(order) > 1:
            best = order[0]
            equal = [
                pair.name
                for pair in order[1:]
                if _harm(found[pair]) == _harm(found[best])
                and found[pair]["relative_error_low"] <= found[best]["relative_error_high"]
            ]
            beside = f"; beside it, with intervals of the error that overlap: {', '.join(equal)}" if equal else ""
            lines.append(
                f"{case}: fewest targets lost, then fewest samples nearer than the standoff, then the least error: "
                f"{best.name}{beside} (table at_a_distance)."
            )
    return lines


def _harm(row: Row) -> tuple[int, int]:
    return row["lost"], row["steps_below_standoff"]


def _of_distant(case: str, pair: Pair, row: Row) -> str:
    used = ", ".join(f"{row[f'fallbacks_{word}']} {word}" for word in FALLBACKS if row[f"fallbacks_{word}"]) or "none"
    return (
        f"{case}, {pair.name} ({row['runs']} seeds): first solve answered in {_share(row['answered_share'])} of "
        f"{row['plans']} plans, a limit given up in {row['given_up']}, fallbacks {used}; error "
        f"{100.0 * row['relative_error']:.3g} % of the range, {row['lost']} lost, {row['steps_below_standoff']} "
        f"samples nearer than the standoff (least range {_short(row['distance_min'])} m); planner "
        f"{_short(row['solver_time_median_ms'])} ms, 99 % {_short(row['solver_time_99_ms'])} ms, at most "
        f"{_short(row['solver_time_max_ms'])} ms (table at_a_distance)."
    )


def _error(row: Row) -> str:
    (value,) = column([row], "error_settled")
    text = f"{_short(value)} m" if math.isfinite(value) else "no finite number"
    return f"{text} ({row['astray']} of {row['runs']} seeds astray)" if row["astray"] else text


def _stiffness(tables: Tables) -> list[str]:
    lines = []
    rows = [
        row for row in tables["sensitivity"] if row["kink_mm"] is not None and row["swept"] not in ("gamma", "nodes")
    ]
    for name, form in (("penalty", "as printed"), ("elastic", "given as inequalities (elastic)")):
        mine = [row for row in rows if row["formulation"] == name]
        if not mine:
            continue
        failing = [row for row in mine if row["solved"] < row["problems"]]
        if not failing:
            low, high = min(column(mine, "kink_mm")), max(column(mine, "kink_mm"))
            lines.append(
                f"The penalty {form} was solved by IPOPT at every setting, with kinks from {_short(low)} to "
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
            f"The penalty {form} was solved by IPOPT in {safe}and not all from {_short(easiest)} on; at the stiffest "
            f"setting ({_short(hardest['stiffness'])}, a kink of {_short(hardest['kink_mm'])} mm of endpoint motion) "
            f"in {sum(row['solved'] for row in worst)} of {sum(row['problems'] for row in worst)} (table sensitivity)."
        )
    return lines
