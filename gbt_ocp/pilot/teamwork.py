"""One vehicle's side of the exchange with others: packets of what it saw and plans, and what it hears from theirs."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

from gbt_ocp.guidance.others import OtherVehicles, SaidPath
from gbt_ocp.models.measurements import Sighting
from gbt_ocp.models.sizes import positive
from gbt_ocp.ocp.plan import Plan, ShootingPlan
from gbt_ocp.pilot.late_measurements import OrderedIntake
from gbt_ocp.pilot.online_loop import Decided, OnlineLoop
from gbt_ocp.pilot.packets import PLACES_SAID, TICK, Packet, SaidBearing, bearings_in, packet_size
from gbt_ocp.tracking.polar import bearing_of
from gbt_ocp.typing import Array

REPEATS = 2
"""Packets that have each bearing at least, rounded down to whole ones: one that is lost costs less."""

COASTING_S = 10.0
"""How far ahead in seconds a vehicle without a plan says where it will be: on with its velocity."""

KEPT_EVERY_S = 1.0
"""Time in seconds after which a tracker's state is kept, at most: what others saw is late by about a period."""

SAME_BEARING_S = 1.5 * TICK
"""Times of bearings of one sender that differ by less are those of the same bearing."""


class Exchange:
    """Keeps what a vehicle measures, makes packets of it and of its last plan, and reads those of others.

    Of the bearings since the last packet a few means are made, at even times, each over at most ``average`` seconds: as
    many as these seconds need, and at most so many that each is sent :data:`REPEATS` times, since a packet has the
    newest that it has room for.

    Parameters
    ----------
    number
        Of the vehicle, from 0 on.
    names
        Of all vehicles, its own included.
    dimension
        d.
    packet_bytes
        Largest size of a packet.
    period
        Seconds from one packet to the next.
    average
        Longest time in seconds over which bearings are averaged.
    bearing_std
        Deviation in radians of a single bearing.
    others
        Told of what the others plan.
    delay
        Time in seconds from sending a packet to hearing it, and from a measurement to its arrival.

    Raises
    ------
    ValueError
        If a packet has no room for a bearing, or a number is not above 0.
    """

    def __init__(
        self,
        number: int,
        names: tuple[str, ...],
        dimension: int,
        *,
        packet_bytes: int,
        period: float,
        average: float,
        bearing_std: float,
        others: OtherVehicles,
        delay: float = 0.0,
    ) -> None:
        self.number = number
        self.names = names
        self._dimension = dimension
        self._room = bearings_in(dimension, packet_bytes)
        if self._room < 1:
            raise ValueError(
                f"packet_bytes: found {packet_bytes}; allowed: at least {packet_size(dimension, 1)}, a bearing's"
            )
        self._period = positive("period", period)
        self._average = positive("average", average)
        self._bearing_std = positive("bearing_std", bearing_std)
        self._others = others
        self._delay = delay
        self._seen: list[tuple[float, Array, Array]] = []
        self._means: list[SaidBearing] = []
        self._sent_at: float | None = None
        self._known: dict[int, list[float]] = {}

    @property
    def oldest(self) -> float:
        """Age in seconds that a bearing of a packet may have when it is sent."""
        return REPEATS * self._period + self._average

    def intake(self, online: OnlineLoop) -> OrderedIntake:
        """How measurements reach a tracker: those of others come late."""
        return OrderedIntake(online, self.oldest + self._delay, every=min(self._period, KEPT_EVERY_S))

    def note(self, sighting: Sighting) -> None:
        """Keep an own measurement for the next packet, if it is a bearing."""
        direction = bearing_of(sighting)
        if direction is not None and not sighting.platform:
            self._seen.append((sighting.time, direction, sighting.position))

    def compose(self, time: float, flat: Array, decided: Decided | None) -> bytes:
        """The packet at a time.

        Parameters
        ----------
        time
            In seconds.
        flat
            Flat output and its rate now ``(>=2, n)``.
        decided
            What was decided last.
        """
        self._average_seen(time)
        path = said_path(time, flat[:2, : self._dimension], decided)
        fresh = [one for one in self._means if one.time >= time - self.oldest]
        self._means = fresh[-self._room :]
        return Packet(self.number, path, tuple(self._means)).encoded()

    def _average_seen(self, time: float) -> None:
        """Make means of the bearings since the last packet."""
        begin = time if self._sent_at is None else self._sent_at
        count = min(max(1, math.ceil((time - begin) / self._average - 1e-9)), math.ceil(self._room / REPEATS))
        ends = begin + (time - begin) * np.arange(1, count + 1) / count
        span = (time - begin) / count
        for number, end in enumerate(ends):
            first = end - min(span, self._average) - (TICK if number == 0 else 0.0)
            some = [one for one in self._seen if first < one[0] <= end + 1e-9] if span > 0.0 else self._seen
            if some:
                self._means.append(self._mean(some))
            if not span > 0.0:
                break
        self._seen, self._sent_at = [], time

    def _mean(self, some: list[tuple[float, Array, Array]]) -> SaidBearing:
        times, directions, positions = (np.mean(values, axis=0) for values in zip(*some, strict=True))
        length = float(np.linalg.norm(directions))
        newest = some[-1]
        if length < 0.5:  # it passed over the target: those bearings have no mean
            return SaidBearing(newest[0], newest[1], newest[2], self._bearing_std)
        moment = TICK * round(float(times) / TICK)
        return SaidBearing(moment, directions / length, positions, self._bearing_std / math.sqrt(len(some)))

    def hear(self, packets: Iterable[bytes]) -> list[Sighting]:
        """Read packets: bearings that are new, as measurements, oldest first. Plans are noted.

        Raises
        ------
        ValueError
            If one is no packet.
        """
        found = []
        for data in packets:
            packet = Packet.decoded(data, self._dimension)
            sender = packet.sender
            if sender == self.number or sender >= len(self.names):
                raise ValueError(f"packet: found sender {sender}; allowed: another one of {len(self.names)} vehicles")
            self._others.hear(sender - (sender > self.number), packet.path)
            known = self._known.setdefault(sender, [])
            for one in packet.bearings:
                if all(abs(one.time - time) > SAME_BEARING_S for time in known):
                    known.append(one.time)
                    found.append(one.sighting(self.names[sender]))
            self._known[sender] = [time for time in known if time >= packet.path.time - 2.0 * self.oldest]
        return sorted(found, key=lambda one: one.time)


def said_path(time: float, motion: Array, decided: Decided | None) -> SaidPath:
    """Where a vehicle says that it will be: on its last plan, or on with its velocity.

    Parameters
    ----------
    time
        In seconds.
    motion
        Position and velocity now ``(2, d)``.
    decided
        What was decided last, if anything was.
    """
    d = motion.shape[1]
    share = np.arange(PLACES_SAID + 1) / PLACES_SAID
    plan = None if decided is None else decided.plan
    if plan is not None and decided is not None:
        begun = time - decided.time + plan.elapsed
        if isinstance(plan, Plan):
            reach = plan.trajectory.duration - begun
            places = plan(begun + reach * share)[:, :d]
        else:
            period = _period_of(plan, decided)
            reach = period * (len(plan.knots) - 1) - begun
            ends = period * np.arange(len(plan.knots))
            places = np.stack([np.interp(begun + reach * share, ends, axis) for axis in plan.knots[:, 0, :d].T], axis=1)
        if reach > PLACES_SAID * TICK:
            return SaidPath(time, reach / PLACES_SAID, np.vstack([motion[:1], places[1:]]))
    return SaidPath(time, COASTING_S / PLACES_SAID, motion[0] + COASTING_S * share[:, None] * motion[1])


def _period_of(plan: ShootingPlan, decided: Decided) -> float:
    """Length in seconds of a period of a plan by integration."""
    return float(decided.times[1] - decided.times[0]) if plan.period is None else plan.period
