"""The nonlinear program of multiple shooting (Bock and Plitt 1984): the reference for trajectories by integration."""

from __future__ import annotations

import casadi as ca
import numpy as np

from gbt_ocp.ocp.problem_data import HardLimit, PenaltyLimit, ShootingData
from gbt_ocp.ocp.shot import Shots
from gbt_ocp.ocp.transcription import Layout, Transcription, assembled, between_knots
from gbt_ocp.typing import Array


def transcribe_shooting(problem: ShootingData) -> Transcription:
    """Build the nonlinear program symbolically: inputs and the states at the ends of the periods are unknown."""
    shots, p, held = Shots(problem), problem.pieces, problem.freedoms
    states, scale = shots.form.states, shots.form.scale
    variables, start = ca.MX.sym("u", held * p), ca.MX.sym("start", states)
    inner = ca.MX.sym("states", states * p)
    ends = ca.reshape(inner, states, p)
    inputs = ca.reshape(variables, held, p) * ca.repmat(ca.DM(scale), 1, p)
    pieces = ca.vertcat(ca.horzcat(start, ends[:, :-1]), inputs)

    def at(shares: Array) -> list[ca.MX]:
        """Pieces and shares, one a column."""
        columns = [pieces[:, i] for i in range(p) for _ in shares]
        return [ca.horzcat(*columns), ca.MX(ca.DM(np.tile(shares, p)).T)]

    def values(number: int, shares: Array, moving: ca.MX) -> ca.MX:
        between = between_knots(moving, shares) or [ca.MX(0, p * len(shares))]
        return shots.limits[number].map(p * len(shares))(*at(shares), *between)

    def grid(limit: HardLimit | PenaltyLimit) -> tuple[int, int, float]:
        found = shots.form.grid(limit)
        return found.intervals, found.first, found.share

    defects = ca.vec(shots.step.map(p)(pieces) - ends)
    points = shots.point.map(p)(*at(np.ones(1)))
    led_to = ca.Function("led_to", [start, variables], [_rollout(shots, start, inputs)])
    return assembled(problem, Layout(variables, inner, defects, start, list(points), values, grid), led_to)


def _rollout(shots: Shots, start: ca.MX, inputs: ca.MX) -> ca.MX:
    """The states at the ends of the periods, one after the other."""
    found = [start]
    for own in ca.horzsplit(inputs):
        found.append(shots.step(ca.vertcat(found[-1], own)))
    return ca.vertcat(*found[1:])
