"""Options of the compiled solver: the settings of its kernel."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

from gbt_ocp.ocp.limit_classes import LIMIT_WEIGHT


@dataclass(frozen=True)
class CompiledOptions:
    """Options of the compiled solver (``solver_options`` of a configuration).

    Attributes
    ----------
    tolerance
        Largest gradient of the Lagrangian, per scaled unknown.
    gap
        Largest sum of the complementarity products of a piece, which bounds what its objective loses by the barrier.
    feasibility
        A hard limit counts as kept up to this, in units of the limit.
    barrier
        μ at a cold start.
    warm_barrier
        μ at a warm start, by default ``barrier`` up to five pieces and ``barrier (5/p)²`` beyond: the longer the
        horizon, the nearer the shifted plan is to optimal.
    limit_weight
        c: unit of the weights of the l1 penalties that impose the hard limits
        (:func:`~gbt_ocp.ocp.limit_classes.hard_weights`), exact while the multipliers stay below them. That of a thrust
        limit is raised while it is broken.
    iterations
        Iterations of one start before another one is tried; by default 12 a piece, at least 60 (120 of trajectories by
        integration).
    deadline
        Iterations of all starts together, and of all attempts of a step, by default five times as many.
    """

    tolerance: float = 1.0e-4
    gap: float = 4.0e-4
    feasibility: float = 1.0e-6
    barrier: float = 1.0e-2
    warm_barrier: float = 1.0e-2
    limit_weight: float = LIMIT_WEIGHT
    iterations: int = 60
    deadline: int = 300

    @classmethod
    def checked(cls, options: Mapping[str, Any], pieces: int, *, shooting: bool = False) -> CompiledOptions:
        """From a mapping, for a problem with so many pieces, of flat trajectories or others.

        Raises
        ------
        ValueError
            If an option is unknown or not a positive number.
        """
        allowed = {field.name: field.type for field in fields(cls)}
        for key, value in options.items():
            if key not in allowed:
                raise ValueError(f"solver_options.{key}: found {value!r}; allowed keys: {', '.join(allowed)}")
            integer = allowed[key] == "int"
            number = isinstance(value, int if integer else int | float) and not isinstance(value, bool)
            if not (number and 0.0 < value < math.inf):
                kind = "whole number" if integer else "number"
                raise ValueError(f"solver_options.{key}: found {value!r}; allowed: a positive {kind}")
        iterations = options.get("iterations", max(120 if shooting else 60, 12 * pieces))
        warm_barrier = options.get("barrier", cls.barrier) * min(5.0 / pieces, 1.0) ** 2
        defaults = {"iterations": iterations, "deadline": 5 * iterations, "warm_barrier": warm_barrier}
        return cls(**{**defaults, **options})

    def initialiser(self) -> str:
        """The settings as an initialiser of the kernel's ``gbt_settings``, in C."""
        parts = []
        for option in fields(self):
            value = getattr(self, option.name)
            parts.append(f".{option.name} = {value if option.type == 'int' else f'(gbt_real){float(value)!r}'}")
        return "{" + ", ".join(parts) + "}"
