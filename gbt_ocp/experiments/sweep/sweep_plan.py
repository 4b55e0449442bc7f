"""What a sweep consists of: variants of an experiment, each run with every seed.

The plan is settled and checked before the first run starts, and written into the sweep folder: a sweep that is taken
up again runs exactly what was planned, whatever has happened to the files it was planned from.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from pathlib import Path
from typing import Any

from gbt_ocp.experiments.config import yaml_dialect as dialect
from gbt_ocp.experiments.config.faults import ConfigurationError, shown
from gbt_ocp.experiments.config.loading import load_config
from gbt_ocp.experiments.config.schema import Configuration, is_text
from gbt_ocp.simulation.history import History

FORMAT = 1
"""Version of the file that holds a plan."""

Overrides = Mapping[str, Any]
"""Key path (``planner.pieces``) to value."""


@dataclass(frozen=True)
class Variant:
    """An experiment with some keys replaced.

    Attributes
    ----------
    overrides
        What makes it different from its sweep's other variants; columns of the table of runs. A key need not be one
        of the configuration: a study labels its variants by ``method``.
    configuration
        The checked configuration; its seed is replaced by each of the sweep's.
    """

    overrides: dict[str, Any]
    configuration: Configuration


@dataclass(frozen=True)
class PlannedRun:
    """One run of a sweep: ``number`` orders the runs and names their folders."""

    number: int
    seed: int
    variant: Variant

    @property
    def identifier(self) -> str:
        """Name of the run folder."""
        return f"{self.number:06d}"

    @property
    def configuration(self) -> Configuration:
        """The variant's configuration with this run's seed."""
        return self.variant.configuration.model_copy(update={"seed": self.seed})


@dataclass(frozen=True)
class SweepPlan:
    """Every variant with every seed.

    Attributes
    ----------
    variants, seeds
        Run ``i`` takes variant ``i // len(seeds)`` and seed ``i % len(seeds)``.
    histories
        Whether run folders keep ``history.npz``.
    arrays
        Attributes of :class:`~gbt_ocp.simulation.history.History` that run folders keep in ``arrays.npz``: a hundredth
        of a history where a figure needs no more.
    """

    variants: tuple[Variant, ...]
    seeds: tuple[int, ...]
    histories: bool = True
    arrays: tuple[str, ...] = ()

    def __len__(self) -> int:
        return len(self.variants) * len(self.seeds)

    @cached_property
    def varied(self) -> tuple[str, ...]:
        """Keys that any variant replaces, in the order in which they first occur."""
        return tuple(dict.fromkeys(key for variant in self.variants for key in variant.overrides))

    def runs(self) -> Iterator[PlannedRun]:
        """The runs in their order."""
        for number, (variant, seed) in enumerate(product(self.variants, self.seeds)):
            yield PlannedRun(number, seed, variant)

    def to_json(self) -> str:
        """The plan as it stands in the sweep folder; equal plans are equal texts."""
        variants = [
            {"overrides": variant.overrides, "configuration": variant.configuration.to_mapping()}
            for variant in self.variants
        ]
        plan = {
            "format": FORMAT,
            "seeds": list(self.seeds),
            "histories": self.histories,
            "arrays": list(self.arrays),
            "variants": variants,
        }
        return json.dumps(plan, indent=1, ensure_ascii=False, allow_nan=False) + "\n"

    @classmethod
    def from_json(cls, text: str) -> SweepPlan:
        """Read a plan back.

        Raises
        ------
        ValueError
            If the text is no plan of this version.
        """
        try:
            plan = json.loads(text)
            if plan["format"] != FORMAT:
                raise ValueError(f"found format {plan['format']}; allowed: {FORMAT}")
            found = cls(
                tuple(
                    Variant(dict(one["overrides"]), load_config(dict(one["configuration"]))) for one in plan["variants"]
                ),
                tuple(plan["seeds"]),
                plan["histories"],
                tuple(plan["arrays"]),
            )
        except (KeyError, TypeError, RecursionError) as fault:
            raise ValueError(f"found no plan of a sweep ({type(fault).__name__}: {fault})") from None
        if not found.variants or not found.seeds or not all(type(seed) is int and seed >= 0 for seed in found.seeds):
            raise ValueError(
                f"found {len(found.variants)} variants, seeds {shown(plan['seeds'])}; allowed: some of each"
            )
        if type(found.histories) is not bool or not all(map(_is_recorded, found.arrays)):
            kept = f"histories {shown(found.histories)}, arrays {shown(plan['arrays'])}"
            raise ValueError(f"found {kept}; allowed: true or false, and names of what a history has")
        return found


def _is_recorded(name: Any) -> bool:
    return isinstance(name, str) and (
        name in History.__dataclass_fields__ or isinstance(getattr(History, name, None), property)
    )


def plan_sweep(
    source: Configuration | str | Path | Mapping[str, Any],
    *,
    runs: int,
    seed_from: int = 0,
    grid: Mapping[str, Sequence[Any]] | None = None,
    entries: Iterable[Overrides] | None = None,
    overrides: Sequence[str] = (),
    histories: bool = True,
) -> SweepPlan:
    """Settle a sweep of one configuration.

    Parameters
    ----------
    source
        Anything that :func:`gbt_ocp.load_config` takes, or a loaded configuration.
    runs
        Seeds a variant: ``seed_from``, ``seed_from + 1``, …
    seed_from
        The first of them.
    grid
        Key paths and the values each of them takes; every combination is a variant, the last key varying fastest.
    entries
        Mappings of key paths to values, one a variant; with a grid, every entry takes every point of it.
    overrides
        Lines ``key.path=value`` for all variants.
    histories
        Whether run folders keep ``history.npz``.

    Raises
    ------
    ConfigurationError
        If a variant is wrong, with one line a fault.
    """
    if runs < 1:
        raise ConfigurationError([f"runs: found {runs}; allowed: a whole number >= 1"])
    if seed_from < 0:
        raise ConfigurationError([f"seed_from: found {seed_from}; allowed: a whole number >= 0"])
    mappings = [{}] if entries is None else [dict(entry) for entry in entries]
    if not mappings:
        raise ConfigurationError(["entries: found none; allowed: at least one mapping"])
    axes = dict(grid or {})
    for key, values in axes.items():
        if isinstance(values, str) or not isinstance(values, Sequence) or not len(values):
            raise ConfigurationError([f"grid: {key}: found {shown(values)}; allowed: a list with at least one value"])
    points = [dict(zip(axes, values, strict=True)) for values in product(*axes.values())]
    variants = [variant(source, {**entry, **point}, overrides) for entry in mappings for point in points]
    return SweepPlan(tuple(variants), tuple(range(seed_from, seed_from + runs)), histories)


def variant(
    source: Configuration | str | Path | Mapping[str, Any],
    changes: Overrides,
    overrides: Sequence[str] = (),
    labels: Overrides | None = None,
) -> Variant:
    """A checked variant of a configuration.

    Parameters
    ----------
    source
        Anything that :func:`gbt_ocp.load_config` takes, or a loaded configuration.
    changes
        Key paths and values; they win over ``overrides``.
    overrides
        Lines ``key.path=value``.
    labels
        What the table of runs is to say instead of ``changes``.

    Raises
    ------
    ConfigurationError
        If the result is wrong; the lines name what was changed.
    """
    if "seed" in changes:
        raise ConfigurationError(["seed: found among the changed keys; allowed: --runs and --seed-from"])
    base = source.to_mapping() if isinstance(source, Configuration) else source
    try:
        lines = [*overrides, *(f"{key}={json.dumps(value, ensure_ascii=False)}" for key, value in changes.items())]
    except TypeError as fault:
        raise ConfigurationError([f"found a value that YAML cannot hold ({fault}); allowed: plain values"]) from None
    return Variant(dict(changes if labels is None else labels), load_config(base, overrides=lines))


def read_entries(path: Path) -> list[dict[str, Any]]:
    """Read a list of variants: a YAML list of mappings from key paths to values; nested mappings are flattened.

    Raises
    ------
    ConfigurationError
        If the file cannot be read or is not such a list.
    """
    try:
        value, faults = dialect.parse(path.read_text(encoding="utf-8"), str(path), is_text=is_text)
    except (OSError, UnicodeDecodeError) as fault:
        raise ConfigurationError(
            [f"--list: found {path}, which cannot be read ({fault}); allowed: a YAML file"]
        ) from None
    except dialect.YamlError as fault:
        raise ConfigurationError([str(fault)]) from None
    if faults:
        raise ConfigurationError(faults)
    if not isinstance(value, list) or not value or not all(isinstance(entry, dict) for entry in value):
        raise ConfigurationError(
            [f"{path}: found {shown(value)}; allowed: a list of mappings from key paths to values"]
        )
    return [dict(_flat(entry)) for entry in value]


def read_axis(text: str) -> tuple[str, list[Any]]:
    """Read one axis of a grid, ``key.path=v1,v2``; values are YAML.

    Raises
    ------
    ConfigurationError
        If it is not written so.
    """
    key, equals, values = text.partition("=")
    fault = ConfigurationError([f"--grid: found {shown(text)}; allowed: key.path=value,value,..."])
    if not (key.strip() and equals and values.strip()):
        raise fault
    try:
        found, _ = dialect.parse(f"[{values}]", f"--grid {key}", is_text=is_text, at=tuple(key.strip().split(".")))
    except dialect.YamlError:
        raise fault from None
    return key.strip(), found


def _flat(mapping: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    for key, value in mapping.items():
        if isinstance(value, Mapping) and value:
            yield from _flat(value, f"{prefix}{key}.")
        else:
            yield f"{prefix}{key}", value
