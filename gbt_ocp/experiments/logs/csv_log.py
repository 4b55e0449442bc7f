"""CSV logs: by the names of their columns, or by a mapping."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from gbt_ocp.experiments.config.consistency import LARGEST
from gbt_ocp.experiments.config.faults import ConfigurationError
from gbt_ocp.experiments.config.yaml_dialect import shortened
from gbt_ocp.experiments.contacts import contact_warning, told_apart
from gbt_ocp.experiments.logs.assembly import RawLog, apart
from gbt_ocp.experiments.logs.conversion import Positions, headings, measured, positions
from gbt_ocp.experiments.logs.csv_columns import CLOCKS, BearingFrom, CsvLayout, known_columns
from gbt_ocp.experiments.logs.csv_rows import CsvRows, is_empty, number_columns, read_rows, utc_column
from gbt_ocp.experiments.logs.mapping import LogMapping, MeasurementEntry
from gbt_ocp.experiments.logs.records import Records, fields_of
from gbt_ocp.frames import TIME_UNITS, seconds_of_counts
from gbt_ocp.typing import Array


class CsvLog:
    """A CSV file with a header.

    Parameters
    ----------
    path
        The file.
    bearing_from
        Where bearings are counted from.
    where
        Values by column: only rows with them are read, and rows without a measurement whose cell there is empty.
    mapping
        What the columns hold; by default their names say it.

    Attributes
    ----------
    mapping
        What the columns hold.
    in_utc
        Whether times are dates.

    Raises
    ------
    ConfigurationError
        If the file cannot be read as that, with one line a fault.
    """

    def __init__(
        self,
        path: Path,
        bearing_from: BearingFrom | None,
        where: Mapping[str, str | float],
        mapping: LogMapping | None,
    ) -> None:
        self._path = path
        asked = [name for entry in mapping.entries.values() for name in fields_of(entry)] if mapping else []
        rows = read_rows(path, lambda names: sum(name in asked for name in names) or known_columns(names))
        if mapping is None:
            layout = CsvLayout(path, rows.names, bearing_from)
            self.mapping, clock = layout.mapping, layout.clock
            unit = CLOCKS[clock]
        else:
            self.mapping, clock, unit = _present(path, mapping, rows.names)
        self.in_utc = unit == "utc"
        self._measurements = self.mapping.measurements
        cells = [[rows.names.index(name) for name in entry.fields] for entry in self._measurements]
        self._rows = rows.where(where, lambda row: any(not is_empty(row[at]) for group in cells for at in group[:1]))
        self._read_columns(clock, unit)
        self._bearing_from = bearing_from

    def _read_columns(self, clock: str, unit: str) -> None:
        rows, mapping = self._rows, self.mapping
        own = [name for entry in mapping.own for name in entry.fields]
        stds = {name for entry in self._measurements for name in entry.std_fields}
        texts = {name for entry in mapping.entries.values() for name in entry.when}
        texts |= {entry.sensor_field for entry in self._measurements if entry.sensor_field is not None}
        groups = [tuple(entry.fields) for entry in self._measurements]
        empty = [
            np.array([all(map(is_empty, cells)) for cells in zip(*map(rows.column, names), strict=True)])
            for names in groups
        ]
        required = {clock, *own}

        def optional(name: str, k: int) -> bool:
            if name in required:
                return False
            return all(none[k] for names, none in zip(groups, empty, strict=True) if name in names)

        names = [name for entry in mapping.entries.values() for name in fields_of(entry) if name not in texts]
        counted = [] if unit == "utc" else [clock]
        largest = {clock: LARGEST * TIME_UNITS.get(unit, 1)}
        numbers = number_columns(rows, list(dict.fromkeys([*counted, *names])), optional, largest)
        self._refuse_below_zero(numbers, stds)
        self._times = utc_column(rows, clock) if unit == "utc" else _in_seconds(rows, clock, unit, numbers[clock])
        self._refuse_falling(clock)
        columns = {**numbers, **{name: rows.column(name) for name in texts}}
        self._records = Records("", apart(self._times), columns, lambda k: f"line {rows.lines[k]}")

    def _refuse_below_zero(self, numbers: dict[str, Array], stds: set[str]) -> None:
        above = stds | {
            name for entry in self._measurements if entry.kind in ("range", "size") for name in entry.fields
        }
        rows = self._rows
        rows.refuse(
            [
                rows.fault(k, name, rows.cells[k][rows.names.index(name)], "a number > 0, or an empty cell")
                for name in sorted(above)
                for k in np.flatnonzero(numbers[name] <= 0.0).tolist()
            ]
        )
        for entry in (*self.mapping.own, *self.mapping.truth):
            if entry.frame.startswith("lat_lon") and entry.angle_unit == "deg":
                name = entry.fields[0]
                high = np.flatnonzero(np.abs(numbers[name]) > 90.0).tolist()
                rows.refuse(
                    [rows.fault(k, name, rows.cells[k][rows.names.index(name)], "degrees from -90 to 90") for k in high]
                )

    def _refuse_falling(self, clock: str) -> None:
        falling = np.flatnonzero(np.diff(self._times) < 0.0)
        if len(falling):
            rows, k = self._rows, falling[0] + 1
            before, after = (rows.cells[at][rows.names.index(clock)] for at in (k - 1, k))
            found = f"{clock}: found {after} after {before}; allowed: increasing times"
            raise ConfigurationError([f"{self._path}: line {rows.lines[k]}: {found}"])

    def raw(self) -> RawLog:
        """What was read."""
        own, _ = positions(self._records, self.mapping.own[0])
        truth: Positions | None = None
        if self.mapping.truth:
            truth, _ = positions(self._records, self.mapping.truth[0])
        yaw = (np.zeros(0), np.zeros(0))
        if self.mapping.heading:
            yaw = headings(self._records, self.mapping.heading[0])
            if not len(yaw[0]):
                raise ConfigurationError([f"{self._path}: found no heading; allowed: at least one"])
        found = [measured(self._records, entry, self._bearing_from) for entry in self._measurements]
        # a measurement of a latency before the first heading has none; within the rows it is interpolated
        return RawLog(self._path, own, yaw, found, truth, by_row=True)

    def contact_warnings(self, which: Sequence[int], bearings: Array) -> list[str]:
        """Lines about columns that seem to tell several contacts apart.

        Parameters
        ----------
        which
            Numbers of the rows of the bearings.
        bearings
            ``(K, d)``, unit vectors.
        """
        read = {"t", *self._records.columns, *CLOCKS}
        read -= {entry.sensor_field for entry in self._measurements if entry.sensor_field is not None}
        lines = []
        for name in self._rows.names:
            if not name or name in read:
                continue
            column = self._rows.column(name)
            values = [column[k] for k in which]
            angles = told_apart(values, bearings)
            if angles is not None:
                lines.append(contact_warning(self._path, name, values, angles))
        return lines


def _in_seconds(rows: CsvRows, clock: str, unit: str, values: Array) -> Array:
    """The column of the time in seconds; counts are read as integers where all are, so that none loses a digit."""
    if unit == "s":
        return values
    cells = rows.column(clock)
    counts = np.array(list(map(int, cells)), dtype=np.int64) if all(map(str.isdigit, cells)) else values
    return seconds_of_counts(counts, unit)


def _present(path: Path, mapping: LogMapping, names: Sequence[str]) -> tuple[LogMapping, str, str]:
    """The mapping, all of whose columns the file has, the column of its clock, and its unit."""
    missing = [name for entry in mapping.entries.values() for name in fields_of(entry) if name not in names]
    if missing:
        line = f"{path}: found the columns {shortened(', '.join(names))}; missing: {', '.join(dict.fromkeys(missing))}"
        raise ConfigurationError([line])
    faults = []
    for name in ("own", "measurements"):
        if not getattr(mapping, name):
            faults.append(f"{path}: mapping: {name}: found nothing; allowed: at least one entry")
    for name in ("own", "heading", "truth"):
        if len(getattr(mapping, name)) > 1:
            faults.append(f"{path}: mapping: {name}: found {len(getattr(mapping, name))}; allowed: one for a CSV file")
    needs_heading = any(_from_bow(entry) for entry in mapping.measurements)
    if needs_heading and not mapping.heading:
        faults.append(f"{path}: mapping: heading: found nothing; allowed: an entry, since bearings are from the bow")
    clocks = {(entry.time, str(entry.time_unit)) for entry in mapping.entries.values() if entry.time is not None}
    clocks = clocks or {(name, unit) for name, unit in CLOCKS.items() if name in names}
    if len(clocks) != 1:
        found = ", ".join(sorted(name for name, _ in clocks)) or "nothing"
        faults.append(f"{path}: mapping: time: found {found}; allowed: one column")
    if faults:
        raise ConfigurationError(faults)
    # the rows have one time, which is read once
    timeless = {
        name: tuple(entry.model_copy(update={"time": None}) for entry in getattr(mapping, name))
        for name in LogMapping.model_fields
    }
    return mapping.model_copy(update=timeless), *clocks.pop()


def _from_bow(entry: MeasurementEntry) -> bool:
    return entry.frame in ("bow", "bow_port")
