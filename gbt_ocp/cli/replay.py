"""``gbt-ocp replay``: trackers on a recorded log of own positions and bearings."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

import shtab

from gbt_ocp.cli.arguments import CONFIG, add_out, add_quiet, add_set, completed, names
from gbt_ocp.cli.exit_codes import DONE, PROGRAM_FAULT, WRONG_INPUT
from gbt_ocp.cli.folders import free_folder, refuse_unwritable, save_somewhere
from gbt_ocp.cli.output import show
from gbt_ocp.cli.pilot_record import repeat_record
from gbt_ocp.cli.subcommand import Subcommand
from gbt_ocp.experiments.config.faults import ConfigurationError


def _add_arguments(parser: argparse.ArgumentParser) -> None:
    log = parser.add_argument(
        "log",
        metavar="LOG",
        type=Path,
        help="CSV file with the columns t, own_x, own_y, bearing_deg ..., bag of ROS, log of MCAP, MAVLink or IMC",
    )
    completed(log, shtab.FILE)
    config = parser.add_argument("--config", metavar="CONFIG", default="replay", help="configuration (default: replay)")
    completed(config, CONFIG)
    parser.add_argument("--tracker", metavar="NAME,NAME", type=names, default=[], help="trackers side by side, or all")
    parser.add_argument(
        "--bearing-from",
        choices=("x", "north", "bow"),
        help="x: counter-clockwise from +x; north: clockwise from north; bow: clockwise from the bow",
    )
    parser.add_argument("--mapping", metavar="NAME|FILE", help="what the messages or columns of the log hold")
    parser.add_argument("--topics", metavar="NAME,NAME", type=names, default=[], help="topics or messages to read")
    parser.add_argument(
        "--origin",
        metavar="LAT,LON",
        type=_degrees,
        help="origin of the plane in degrees (default: where the log begins)",
    )
    parser.add_argument(
        "--where",
        metavar="COLUMN=VALUE",
        type=_cell,
        action="append",
        default=[],
        help="read only the rows of one contact; may be given again for another column",
    )
    parser.add_argument(
        "--export",
        metavar="NAME,NAME",
        type=names,
        default=[],
        help="csv, geojson, gpx, mcap, page (default: all)",
    )
    parser.add_argument("--latency", metavar="S", type=float, help="age in s of a bearing at its time stamp")
    add_out(parser, "a new or empty folder (default: a new one in runs/)")
    add_set(parser)
    parser.add_argument("--no-figures", action="store_true", help="write no figures")
    add_quiet(parser)


def _cell(text: str) -> tuple[str, str]:
    """A column and a value; an argument of argparse."""
    column, equals, value = text.partition("=")
    if not equals or not column.strip():
        raise argparse.ArgumentTypeError(f"found {text!r}; allowed: COLUMN=VALUE")
    return column.strip(), value.strip()


def _degrees(text: str) -> tuple[float, float]:
    """Latitude and longitude; an argument of argparse."""
    try:
        latitude, longitude = map(float, text.split(","))
    except ValueError:
        raise argparse.ArgumentTypeError(f"found {text!r}; allowed: LAT,LON in degrees") from None
    return latitude, longitude


def _where(cells: Sequence[tuple[str, str]]) -> dict[str, str]:
    """Values by column."""
    columns = [column for column, _ in cells]
    twice = [column for column in columns if columns.count(column) > 1]
    if twice:
        raise ConfigurationError([f"--where: found {twice[0]} twice; allowed: each column once"])
    return dict(cells)


def _carry_out(arguments: argparse.Namespace) -> int:
    from gbt_ocp.experiments.pilot_record import is_pilot_record

    if is_pilot_record(arguments.log):
        return repeat_record(arguments)
    from tqdm import tqdm

    from gbt_ocp.experiments.replay import replay
    from gbt_ocp.reporting.replay_figures import score_text

    where = _where(arguments.where)
    given: Path | None = arguments.out
    name = f"replay-{arguments.log.stem}"
    refuse_unwritable(given or free_folder(name))
    # with a delay, so that a fault of the log leaves no empty bar
    with tqdm(disable=arguments.quiet, file=sys.stderr, unit="bearing", delay=0.1) as bar:

        def after(name: str, done: int, total: int) -> None:
            if done == 1:
                bar.reset(total)
                bar.set_description(name)
            bar.update()

        found = replay(
            arguments.log,
            arguments.config,
            trackers=arguments.tracker,
            bearing_from=arguments.bearing_from,
            latency=arguments.latency,
            where=where,
            mapping=arguments.mapping,
            topics=arguments.topics,
            origin_deg=arguments.origin,
            export=arguments.export,
            overrides=arguments.set,
            progress=after,
        )
    asked = given or free_folder(name)
    out, drawn = save_somewhere(found, asked, figures=not arguments.no_figures)
    show(score_text(found.summary))
    show(f"\n{out}")
    if given is not None and out != asked:
        return WRONG_INPUT
    return DONE if drawn else PROGRAM_FAULT


REPLAY = Subcommand(
    "replay",
    "track a target from a log of own positions and bearings",
    (
        "gbt-ocp replay log.csv --bearing-from north",
        "gbt-ocp replay log.csv --bearing-from x --tracker motion_gp,ekf,imm_ekf --out runs/log",
        "gbt-ocp replay log.csv --bearing-from north --where contact=1",
        "gbt-ocp replay log.mcap --mapping mine.yaml",
        "gbt-ocp replay log.csv --config mine.yaml --latency 0.5 --set tracker.range.median_m=200",
        "gbt-ocp replay record.jsonl",
    ),
    _add_arguments,
    _carry_out,
)
