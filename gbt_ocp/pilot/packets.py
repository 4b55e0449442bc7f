"""Packets that vehicles send each other: a few dozen bytes, for links that carry little.

A packet is, little-endian and without padding,

| bytes | what |
|---|---|
| 1 | number of the sender |
| 4 | time in ms |
| 4 d | its position in cm |
| 2 | how far its plan reaches, in 10 ms |
| 2 d a place | :data:`PLACES_SAID` places on its plan, evenly spaced in time, from its position in dm |
| 4 d + 1 a bearing | age in 10 ms; place of the sensor, from its position in cm; azimuth, and elevation in space, in |
| | 65536ths of a turn; deviation on a logarithmic scale, 5 % a step |

so that one in the plane has 31 bytes and 9 for each bearing, one in space 43 and 13. How many bearings there are
follows from its length.
"""

from __future__ import annotations

import math
import struct
from dataclasses import dataclass

import numpy as np

from gbt_ocp.guidance.others import SaidPath
from gbt_ocp.models.bearings import unit_bearing
from gbt_ocp.models.measurements import Sighting
from gbt_ocp.typing import Array

PLACES_SAID = 4
"""Places on a plan that a packet has, beside where it begins."""

LEAST_STD = 1.0e-5
"""Smallest deviation in radians that a packet can say."""

STD_STEP = 0.05
"""Difference of the logarithms of two deviations that a packet tells apart."""

TICK = 0.01
"""Resolution in seconds of the times of bearings."""

_TURN = 65536.0 / (2.0 * math.pi)
_SHORT = 32767


def packet_size(dimension: int, bearings: int) -> int:
    """Bytes of a packet with so many bearings."""
    return struct.calcsize(_head(dimension)) + bearings * struct.calcsize(_one(dimension))


def bearings_in(dimension: int, size: int) -> int:
    """How many bearings a packet of so many bytes has room for; below 0 if it has none for the rest."""
    return (size - packet_size(dimension, 0)) // struct.calcsize(_one(dimension))


def _head(dimension: int) -> str:
    return f"<BI{dimension}iH{PLACES_SAID * dimension}h"


def _one(dimension: int) -> str:
    return f"<H{dimension}h{dimension - 1}hB"


@dataclass(frozen=True)
class SaidBearing:
    """A bearing as a packet has it: the mean of a few.

    Attributes
    ----------
    time
        In seconds.
    bearing
        Unit vector ``(d,)``.
    position
        Of the sensor ``(d,)`` in metres.
    std
        Deviation in radians.
    """

    time: float
    bearing: Array
    position: Array
    std: float

    def sighting(self, platform: str) -> Sighting:
        """What a tracker is given of it."""
        plain = Sighting.of_bearing(self.time, self.bearing, self.position)
        deviation = np.full(plain.value.size, self.std)
        if plain.value.size == 2:  # of an azimuth, which is wider than the angle across the line of sight
            deviation[0] /= max(float(np.hypot(*self.bearing[:2])), 1e-3)
        return Sighting(
            plain.time, plain.kind, plain.value, deviation, plain.position, platform, self.bearing, platform
        )


@dataclass(frozen=True)
class Packet:
    """What one vehicle says.

    Attributes
    ----------
    sender
        Its number, from 0 to 255.
    path
        Its present position, and where it will be; :data:`PLACES_SAID` + 1 places.
    bearings
        What it has seen, oldest first.
    """

    sender: int
    path: SaidPath
    bearings: tuple[SaidBearing, ...]

    def encoded(self) -> bytes:
        """The bytes; bearings that are too old or too far away for their places are left out."""
        d = self.path.places.shape[1]
        place = np.rint(100.0 * self.path.places[0])
        ahead = np.clip(np.rint(10.0 * self.path.places[1:] - 0.1 * place), -_SHORT, _SHORT)
        reach = min(round(self.path.step * PLACES_SAID / TICK), 65535)
        now = round(1000.0 * self.path.time)
        parts = [struct.pack(_head(d), self.sender, now, *map(int, place), reach, *map(int, ahead.ravel()))]
        for one in self.bearings:
            age = round((0.001 * now - one.time) / TICK)
            offset = np.rint(100.0 * one.position - place)
            if not 0 <= age <= 65535 or np.any(np.abs(offset) > _SHORT):
                continue
            azimuth = math.atan2(one.bearing[1], one.bearing[0])
            angles = [azimuth] if d == 2 else [azimuth, math.asin(float(np.clip(one.bearing[2], -1.0, 1.0)))]
            turns = [(round(_TURN * angle) + 32768) % 65536 - 32768 for angle in angles]
            steps = round(math.log(max(one.std, LEAST_STD) / LEAST_STD) / STD_STEP)
            parts.append(struct.pack(_one(d), age, *map(int, offset), *turns, min(steps, 255)))
        return b"".join(parts)

    @classmethod
    def decoded(cls, data: bytes, dimension: int) -> Packet:
        """The packet of some bytes.

        Raises
        ------
        ValueError
            If they are no packet for this number of dimensions.
        """
        count = bearings_in(dimension, len(data))
        if count < 0 or packet_size(dimension, count) != len(data):
            least, each = packet_size(dimension, 0), packet_size(dimension, 1) - packet_size(dimension, 0)
            raise ValueError(f"packet: found {len(data)} bytes; allowed: {least} and {each} for each bearing")
        sender, milliseconds, *numbers = struct.unpack_from(_head(dimension), data)
        now = 0.001 * milliseconds
        place, reach = 0.01 * np.array(numbers[:dimension]), numbers[dimension]
        ahead = place + 0.1 * np.array(numbers[dimension + 1 :]).reshape(PLACES_SAID, dimension)
        path = SaidPath(now, max(reach, 1) * TICK / PLACES_SAID, np.vstack([place, ahead]))
        found = []
        for row in struct.iter_unpack(_one(dimension), data[packet_size(dimension, 0) :]):
            age, steps = row[0], row[-1]
            offset, angles = np.array(row[1 : 1 + dimension]), np.array(row[1 + dimension : -1]) / _TURN
            level = np.array([math.cos(angles[0]), math.sin(angles[0])])
            line = level if dimension == 2 else np.array([*(math.cos(angles[1]) * level), math.sin(angles[1])])
            unit = unit_bearing(line, np.zeros(dimension))
            std = LEAST_STD * math.exp(STD_STEP * steps)
            found.append(SaidBearing(now - age * TICK, unit, place + 0.01 * offset, std))
        return cls(sender, path, tuple(found))
