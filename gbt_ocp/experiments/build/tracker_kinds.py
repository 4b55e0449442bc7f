"""A kind of tracker: its section of the configuration, and the function that builds it from there."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, get_args

from gbt_ocp.experiments.config.tracker import TrackerSection
from gbt_ocp.models.sensors import BearingSensor
from gbt_ocp.tracking.priors import PositionPrior
from gbt_ocp.tracking.protocol import PositionTracker, Tracker

Builder = Callable[[Any, PositionPrior, BearingSensor], Tracker | PositionTracker]
"""From a section, the prior position and the sensor to an estimator."""


@dataclass(frozen=True)
class TrackerKind:
    """One value of ``tracker.kind``.

    Parameters
    ----------
    section
        The keys: a class below :class:`~gbt_ocp.experiments.config.tracker.TrackerSection` whose ``kind`` is
        ``Literal[NAME]``.
    build
        Called with a section, a :class:`~gbt_ocp.tracking.PositionPrior` (the vehicle's first position, and what the
        key ``prior`` says), and the :class:`~gbt_ocp.models.BearingSensor`; returns the tracker.
    says
        One line for ``gbt-ocp list``.
    family
        A class that ``section`` is or descends from. Where the kind changes to another of the same family in a stronger
        layer of a configuration, the keys of this class keep their values; otherwise those of ``TrackerSection`` do.

    Raises
    ------
    ValueError
        If the section names no kind, or does not belong to the family.
    """

    section: type[TrackerSection]
    build: Builder
    says: str
    family: type[TrackerSection] = TrackerSection

    def __post_init__(self) -> None:
        if len(get_args(self.section.model_fields["kind"].annotation)) != 1:
            raise ValueError(f"section: found {self.section.__name__} without a kind; allowed: a kind: Literal[NAME]")
        if not issubclass(self.section, self.family):
            raise ValueError(f"family: found {self.family.__name__}; allowed: a class above {self.section.__name__}")

    @property
    def name(self) -> str:
        """The value of ``tracker.kind``."""
        return str(get_args(self.section.model_fields["kind"].annotation)[0])


def kept_keys(old: TrackerKind | None, new: TrackerKind | None) -> set[str]:
    """Keys that keep their values when a kind replaces another; ``None`` is a kind that does not exist."""
    same = old is not None and new is not None and old.family is new.family
    family = new.family if same and new is not None else TrackerSection
    return {*family.model_fields} - {"kind"}
