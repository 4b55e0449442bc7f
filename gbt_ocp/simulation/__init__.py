"""The closed loop, a replayed log, and the records that both leave."""

from gbt_ocp.simulation.history import History
from gbt_ocp.simulation.loop import ClosedLoop, Recording, simulate
from gbt_ocp.simulation.replay import BearingLog, ReplayedTrack

__all__ = [
    "BearingLog",
    "ClosedLoop",
    "History",
    "Recording",
    "ReplayedTrack",
    "simulate",
]
