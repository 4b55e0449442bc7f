"""Trajectories that follow from the inputs by integration, in numbers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from gbt_ocp.ocp.forms import ShootingForm
from gbt_ocp.ocp.problem_data import ShootingData
from gbt_ocp.ocp.transcription import limit_size
from gbt_ocp.typing import Array


class Shots:
    """Integrates the trajectories of a problem and evaluates what is bounded along them.

    Parameters
    ----------
    problem
        Whose vehicle, inputs and Runge-Kutta steps.

    Attributes
    ----------
    step
        CasADi function from a piece (state and inputs) to the state at its end.
    point
        From a piece and a share of it to z, ż, z̈ there.
    limits
        For each constraint, from a piece, a share of it and the constraint's numbers there to the bounded quantities.
    """

    def __init__(self, problem: ShootingData) -> None:
        self.problem, self.form = problem, ShootingForm(problem)
        self._maps: dict[tuple[str, int], ca.Function] = {}
        form, share = self.form, ca.SX.sym("share")
        piece = form.point[: form.width]
        self.step = ca.Function("step", [piece], [form.state_after(1.0)])
        point = form.flat_point(form.state_after(share), form.inputs_after(share))
        self.point = ca.Function("point", [piece, share], [*point])
        self._inputs = ca.Function("inputs", [piece, share], [form.inputs_after(share)])
        self.limits = [self._limit(number) for number in range(len(problem.constraints))]

    def _limit(self, number: int) -> ca.Function:
        """(piece, share, numbers) -> the bounded quantities of a constraint."""
        form, constraint = self.form, self.problem.constraints[number]
        stacked = ca.SX.sym("p", limit_size(constraint))
        value = ca.vertcat(form.constraint(constraint, stacked))
        return ca.Function(f"limit{number}", [form.point[: form.width], form.point[form.width], stacked], [value])

    def trajectory(self, start: ArrayLike, top: ArrayLike) -> ShotTrajectory:
        """The trajectory from a state ``(states,)`` under these inputs ``(p, freedoms)``."""
        return ShotTrajectory(self, np.array(start, dtype=float), np.array(top, dtype=float))

    def end(self, piece: Array) -> Array:
        """The state at the end of a piece ``(states,)``, from its state and inputs."""
        return np.asarray(self.step(piece)).ravel()

    def points(self, pieces: Array, shares: Array) -> tuple[Array, Array, Array]:
        """z, ż, z̈ after these shares of every piece ``(p, shares, n)``."""
        found = self._mapped(self.point, pieces, shares)
        z, dz, ddz = (values.reshape(len(pieces), len(shares), -1) for values in found)
        return z, dz, ddz

    def inputs(self, pieces: Array, shares: Array) -> Array:
        """Inputs after these shares of every piece ``(p, shares, m)``."""
        return self._mapped(self._inputs, pieces, shares)[0].reshape(len(pieces), len(shares), -1)

    def limit(self, number: int, pieces: Array, shares: Array, moving: Array) -> Array:
        """The bounded quantities of a constraint after these shares of every piece ``(p, shares, rows)``.

        ``moving`` are its numbers at the knots ``(size, p+1)``.
        """
        ends = np.stack([moving[:, :-1], moving[:, 1:]])
        between = (1.0 - shares)[:, None] * ends[0].T[:, None] + shares[:, None] * ends[1].T[:, None]
        found = self._mapped(
            self.limits[number], pieces, shares, between.reshape(len(pieces) * len(shares), len(moving))
        )
        return found[0].reshape(len(pieces), len(shares), -1)

    def _mapped(self, function: ca.Function, pieces: Array, shares: Array, *more: Array) -> list[Array]:
        columns = [np.repeat(pieces, len(shares), axis=0).T, np.tile(shares, len(pieces))[None]]
        key = function.name(), columns[1].size
        if key not in self._maps:
            self._maps[key] = function.map(columns[1].size)
        found = self._maps[key](*columns, *(values.T for values in more))
        return [np.asarray(values).T for values in (found if isinstance(found, tuple | list) else [found])]


@dataclass(frozen=True)
class ShotTrajectory:
    """A trajectory from a state under inputs that are held or linear over each period.

    Parameters
    ----------
    shots
        Integrates it.
    start
        The state at t = 0 ``(states,)``.
    top
        The unknowns of each piece ``(p, freedoms)``: its inputs, or those at its beginning and at its end.
    """

    shots: Shots
    start: Array
    top: Array

    @property
    def period(self) -> float:
        """T in seconds, the length of a piece."""
        return self.shots.problem.period

    @cached_property
    def states(self) -> Array:
        """The state at the boundaries of the pieces ``(p+1, states)``."""
        found = [self.start]
        for inputs in self.top:
            found.append(self.shots.end(np.concatenate([found[-1], inputs])))
        return np.array(found)

    @property
    def pieces(self) -> int:
        """p."""
        return len(self.top)

    @property
    def numbers(self) -> Array:
        """State and unknowns of each piece ``(p, states + freedoms)``."""
        return np.hstack([self.states[:-1], self.top])

    @cached_property
    def knots(self) -> Array:
        """z and ż at the boundaries of the pieces ``(p+1, 2, n)``."""
        last = np.concatenate([self.states[-1], self.top[-1]])
        z, dz, _ = self.shots.points(np.vstack([self.numbers, last]), np.zeros(1))
        return np.concatenate([z, dz], axis=1)

    def sample(self, points: int) -> tuple[Array, Array, Array]:
        """z, ż, z̈ on an even grid of ``points`` times a piece, both ends included; each ``(p, points, n)``."""
        return self.shots.points(self.numbers, np.linspace(0.0, 1.0, points))

    def thrust(self, shares: Sequence[float]) -> Array:
        """Inputs after these shares of every piece ``(p, shares, m)``."""
        return self.shots.inputs(self.numbers, np.array(shares))
