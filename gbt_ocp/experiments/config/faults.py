"""Faults of a configuration as lines a user can act on: where, what was found, what is allowed."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from gbt_ocp.experiments.config.yaml_dialect import printable, shortened


class ConfigurationError(ValueError):
    """The input is wrong.

    Attributes
    ----------
    faults
        One line a fault: ``FILE: key.path: found VALUE; allowed: …``.
    """

    def __init__(self, faults: Iterable[str]) -> None:
        self.faults = [printable(line) for line in faults]
        super().__init__(self.faults)

    def __str__(self) -> str:
        return "\n".join(self.faults)


@dataclass(frozen=True)
class Fault:
    """One fault, before it is known from which file or option the value came."""

    path: tuple[str, ...]
    found: str
    allowed: str

    def line(self, label: str) -> str:
        """The line a user reads."""
        return f"{label}: {'.'.join(map(shortened, self.path))}: found {self.found}; allowed: {self.allowed}"


NOTHING = object()
"""Stands for a key that is not there."""


def value_at(mapping: Any, path: Sequence[str]) -> Any:
    """Value at a key path, or :data:`NOTHING`."""
    for part in path:
        if isinstance(mapping, list) and part.isdigit() and int(part) < len(mapping):
            mapping = mapping[int(part)]
        elif isinstance(mapping, Mapping) and part in mapping:
            mapping = mapping[part]
        else:
            return NOTHING
    return mapping


def are_places(value: Mapping[str, Any], count: int) -> bool:
    """Whether all keys of a mapping are places in a list of so many entries, as in ``sensor.1.noise_deg``."""
    return bool(value) and all(key.isdigit() and int(key) < count for key in value)


def shown(value: Any) -> str:
    """A value as it stands in a file, shortened."""
    if value is NOTHING:
        return "nothing"
    text = json.dumps(value, ensure_ascii=False, default=str)
    return shortened(text)
