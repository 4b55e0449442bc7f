"""The closed loop, a replayed log, and the records that both leave."""

from gbt_ocp.simulation.channel import Channel
from gbt_ocp.simulation.closed_loop import ClosedLoop, Recording
from gbt_ocp.simulation.columns import column, recorded
from gbt_ocp.simulation.history import History
from gbt_ocp.simulation.loop import simulate, simulate_together
from gbt_ocp.simulation.plant import Plant
from gbt_ocp.simulation.replayed_track import BearingLog, ReplayedTrack
from gbt_ocp.simulation.step import Step
from gbt_ocp.simulation.team_history import TeamHistory

__all__ = [
    "BearingLog",
    "Channel",
    "ClosedLoop",
    "History",
    "Plant",
    "Recording",
    "ReplayedTrack",
    "Step",
    "TeamHistory",
    "column",
    "recorded",
    "simulate",
    "simulate_together",
]
