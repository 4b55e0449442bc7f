"""What a run leaves: configuration, history and summary together, and the folder they are kept in."""

from __future__ import annotations

import html
import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, Protocol

import yaml

from gbt_ocp.files import whole_folder
from gbt_ocp.simulation import run_folder
from gbt_ocp.simulation.history import History
from gbt_ocp.simulation.team_history import TeamHistory

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from pandas import DataFrame
    from xarray import Dataset


class WritesYaml(Protocol):
    """What a result needs of a configuration: its resolved YAML, with `vehicle.thrust_max` and `sensor.period_s`."""

    def to_yaml(self) -> str:
        """Return the text of ``config.yaml``, every default written out."""
        ...


class RecordedConfiguration(SimpleNamespace):
    """The configuration a run folder holds, as it was written: ``configuration.sensor.period_s``, ``.to_yaml()``.

    It is not checked again: a folder from an older version stays readable. To run it again, give its ``config.yaml``
    to ``gbt-ocp run``.
    """

    def __init__(self, text: str) -> None:
        mapping = yaml.safe_load(text)
        super().__init__(**vars(_namespace(mapping, {})) if isinstance(mapping, dict) else {})
        self._text = text

    def to_yaml(self) -> str:
        """Return the text that was read, byte for byte."""
        return self._text


@dataclass(frozen=True, eq=False, repr=False)
class Result:
    """A finished run: its configuration, history and summary.

    Attributes
    ----------
    configuration
        The resolved configuration; after `load`, a `RecordedConfiguration`.
    history
        All steps.
    summary
        What `summarise` returned; of several vehicles also what `team_numbers` did.
    others
        Of several vehicles, the results of all but the first by their names, each without others.
    """

    configuration: WritesYaml
    history: History
    summary: dict[str, Any]
    others: Mapping[str, Result] = field(default_factory=dict)

    def plot(self) -> dict[str, Figure]:
        """Draw the run: figures by name (see `gbt_ocp.reporting.figures.draw_figures`); pyplot is not touched."""
        from gbt_ocp.reporting.figures import draw_figures  # matplotlib only when something is drawn

        others = {name: other.history for name, other in self.others.items()}
        return draw_figures(self.history, yaml.safe_load(self.configuration.to_yaml()), self.summary, others)

    def save(self, folder: str | os.PathLike[str], figures: bool = True) -> Path:
        """Write the run folder, completely or not at all, and return its path.

        Raises
        ------
        FileExistsError
            If ``folder`` is a file, or a folder that is not empty.
        """
        with whole_folder(folder) as temporary:
            self.write(temporary, figures=figures)
        return Path(folder)

    def write(self, folder: Path, *, history: bool = True, figures: bool = True) -> None:
        """Write the files of a run folder into a folder that exists, with or without its arrays and figures."""
        (folder / run_folder.CONFIGURATION).write_text(self.configuration.to_yaml(), encoding="utf-8")
        if history:
            self.history.save_npz(folder / run_folder.HISTORY)
        run_folder.write_summary(folder, self.summary)
        for name, other in self.others.items():
            own = folder / run_folder.VEHICLES / name
            own.mkdir(parents=True)
            other.write(own, history=history, figures=figures)
        if figures:
            from gbt_ocp.reporting.figures import write_figures

            write_figures(folder)

    @classmethod
    def load(cls, folder: str | os.PathLike[str]) -> Result:
        """Read a run folder back.

        Raises
        ------
        FileNotFoundError
            If one of its three files is missing.
        ValueError
            If one of them is damaged.
        """
        path = Path(folder)
        text, _ = run_folder.read_configuration(path)
        others = {other.name: cls.load(other) for other in run_folder.others_in(path)}
        summary = run_folder.read_summary(path)
        several = bool(others) or path.parent.name == run_folder.VEHICLES
        history = (TeamHistory if several else History).load_npz(path / run_folder.HISTORY)
        return cls(RecordedConfiguration(text), history, summary, others)

    def to_dataframe(self) -> DataFrame:
        """The history as a ``pandas.DataFrame``, one row a step (see `gbt_ocp.simulation.tabular.dataframe`).

        Raises
        ------
        ImportError
            If pandas is not installed.
        """
        from gbt_ocp.simulation.tabular import dataframe

        return dataframe(self.history, self.summary.get("inputs"))

    def to_xarray(self) -> Dataset:
        """The history as an ``xarray.Dataset`` (see `gbt_ocp.simulation.tabular.dataset`); the numbers of the summary
        and the configuration are its attributes.

        Raises
        ------
        ImportError
            If xarray is not installed.
        """
        from gbt_ocp.simulation.tabular import dataset

        numbers = {key: value for key, value in self.summary.items() if isinstance(value, int | float | str)}
        attributes = {**numbers, "configuration": self.configuration.to_yaml()}
        return dataset(self.history, attributes, self.summary.get("inputs"))

    def _repr_html_(self) -> str:
        """What a notebook shows: the numbers of `repr`, as a table."""
        title, *lines = repr(self).splitlines()
        rows = "".join(
            f"<tr><th style='text-align:left'>{html.escape(head)}</th>"
            f"<td style='text-align:left'>{html.escape(rest)}</td></tr>"
            for head, rest in (line.split(maxsplit=1) for line in lines)
        )
        return f"<table><caption style='text-align:left'>{html.escape(title)}</caption>{rows}</table>"

    def __repr__(self) -> str:
        number = self.summary.get
        fallbacks = sum((number("fallbacks") or {}).values())
        problem = getattr(self.configuration, "problem", "run")
        return (
            f"Result({problem}, {self.history.dimension}D, seed {number('seed')}, {number('steps')} steps, "
            f"{_text(number('wall_s'), 's')} wall)\n"
            f"  error    mean {_text(number('error_mean'), 'm')}, settled {_text(number('error_settled'), 'm')}, "
            f"final {_text(number('error_final'), 'm')}\n"
            f"  distance min {_text(number('distance_min'), 'm')}, median {_text(number('distance_median'), 'm')}; "
            f"thrust above its limit by {_text(number('violation_max'))}\n"
            f"  solver   first try {_text(number('solver_success_rate'))}, "
            f"median {_text(number('solver_time_median_ms'), 'ms')}, {fallbacks} fallbacks"
        )


def _namespace(value: Any, known: dict[int, SimpleNamespace]) -> Any:
    """Mappings as objects with attributes, one for each mapping however many aliases stand for it."""
    if not isinstance(value, dict):
        return value
    if id(value) not in known:
        known[id(value)] = SimpleNamespace(**{str(key): _namespace(item, known) for key, item in value.items()})
    return known[id(value)]


def _text(value: float | None, unit: str = "") -> str:
    return "none" if value is None else f"{value:.3g} {unit}".rstrip()
