"""``gbt-ocp replay RECORD``: the record of a pilot repeated."""

from __future__ import annotations

import argparse
import sys

from gbt_ocp.cli.exit_codes import DONE, LIMIT_BROKEN
from gbt_ocp.cli.folders import refuse_unwritable
from gbt_ocp.cli.output import show
from gbt_ocp.experiments.config.faults import ConfigurationError
from gbt_ocp.files import whole_folder

OF_LOGS: dict[str, object] = {
    "config": "replay",
    "tracker": [],
    "bearing_from": None,
    "where": [],
    "latency": None,
    "set": [],
}
"""Options that are for logs, with what they have where they are not given."""


def repeat_record(arguments: argparse.Namespace) -> int:
    """Repeat a record and say whether the same comes out."""
    from tqdm import tqdm

    from gbt_ocp.experiments.pilot_replay import repeat_pilot_record

    given = [name for name, absent in OF_LOGS.items() if getattr(arguments, name, absent) != absent]
    if given:
        option = f"--{given[0].replace('_', '-')}"
        raise ConfigurationError([f"{option}: found beside the record of a pilot; allowed: beside a log"])
    with tqdm(disable=arguments.quiet, file=sys.stderr, unit="call", delay=0.1) as bar:

        def after(done: int, total: int) -> None:
            bar.total = total
            bar.update()

        if arguments.out is None:
            found = repeat_pilot_record(arguments.log, progress=after)
        else:
            refuse_unwritable(arguments.out)
            with whole_folder(arguments.out) as folder:
                found = repeat_pilot_record(arguments.log, record=folder / "record.jsonl", progress=after)
    calls = found.navigations + found.measurements + found.commands
    show(
        f"{found.navigations} navigations, {found.measurements} measurements, {found.commands} commands: "
        f"{calls - found.different} of {calls} answers the same"
    )
    if found.different:
        show(found.first)
        return LIMIT_BROKEN
    return DONE
