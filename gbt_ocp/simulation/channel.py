"""What lies between vehicles that talk to each other: packets that are due, lost, or late."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from gbt_ocp.models.sizes import not_negative, positive


@dataclass
class Channel:
    """Carries packets of every vehicle to every other one, each of which hears it or not.

    Attributes
    ----------
    period
        Seconds from one packet of a vehicle to its next; all send at the same times, the first at t = 0.
    loss
        Probability that one vehicle does not hear a packet that another one sent, in [0, 1].
    latency
        Seconds from sending to hearing.
    rng
        Drawn from once for each packet and hearer, whatever the probability.
    sent, lost
        Counts of packets, one for each hearer.
    largest
        Bytes of the largest packet that was sent.

    Raises
    ------
    ValueError
        If a number is out of range.
    """

    period: float
    loss: float
    latency: float
    rng: np.random.Generator
    sent: int = 0
    lost: int = 0
    largest: int = 0
    _count: int = 0
    _underway: list[tuple[float, int, bytes]] = field(default_factory=list)

    def __post_init__(self) -> None:
        positive("period", self.period)
        not_negative("latency", self.latency)
        if not 0.0 <= self.loss <= 1.0:
            raise ValueError(f"loss: found {self.loss}; allowed: a number in [0, 1]")

    def due(self, time: float) -> bool:
        """Whether packets are to be sent at a time in seconds; each is due once."""
        if time < self._count * self.period - 1e-9:
            return False
        self._count += 1
        return True

    def send(self, time: float, sender: int, data: bytes, vehicles: int) -> None:
        """Send a packet of one vehicle to all others of so many at a time in seconds."""
        self.largest = max(self.largest, len(data))
        for receiver in range(vehicles):
            if receiver == sender:
                continue
            self.sent += 1
            if self.rng.random() < self.loss:
                self.lost += 1
            else:
                self._underway.append((time + self.latency, receiver, data))

    def arrived(self, time: float, receiver: int) -> list[bytes]:
        """Packets that reach a vehicle by a time in seconds, in the order in which they were sent."""
        ready = [one for one in self._underway if one[1] == receiver and one[0] <= time + 1e-9]
        self._underway = [one for one in self._underway if one not in ready]
        return [data for _, _, data in ready]
