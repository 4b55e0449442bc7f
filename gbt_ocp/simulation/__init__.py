"""The closed loop, a replayed log, and the records that both leave."""

from gbt_ocp.simulation.columns import column, recorded
from gbt_ocp.simulation.history import History
from gbt_ocp.simulation.loop import ClosedLoop, Recording, simulate
from gbt_ocp.simulation.plant import Plant
from gbt_ocp.simulation.replayed_track import BearingLog, ReplayedTrack
from gbt_ocp.simulation.step import Step

__all__ = [
    "BearingLog",
    "ClosedLoop",
    "History",
    "Plant",
    "Recording",
    "ReplayedTrack",
    "Step",
    "column",
    "recorded",
    "simulate",
]
