"""The solver of a name, or the best one that is there."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from typing import Any

from gbt_ocp.ocp.codegen.expressions import NotGenerableError
from gbt_ocp.ocp.codegen.library import CompilerError
from gbt_ocp.ocp.problem_data import PosedProblem
from gbt_ocp.ocp.solvers.base import SOLVERS, Solver, options_beside, options_for
from gbt_ocp.ocp.solvers.compiled import CompiledSolver
from gbt_ocp.ocp.solvers.ipopt import IpoptSolver


def make_solver(problem: PosedProblem, name: str, options: Mapping[str, Any]) -> Solver:
    """Build the solver of that name; ``auto`` takes ``compiled`` where that can be had and ``ipopt`` elsewhere.

    Options are those of :func:`options_for`; under ``auto`` options for whichever solver are the compiled one's.

    Warns
    -----
    RuntimeWarning
        If ``auto`` had to fall back on IPOPT; the message says why.

    Raises
    ------
    ValueError
        If the name is unknown; the message lists the known ones.
    """
    if name == "ipopt":
        return IpoptSolver(problem, options_for("ipopt", options))
    if name == "compiled":
        return CompiledSolver(problem, options_for("compiled", options))
    if name == "auto":
        try:
            return CompiledSolver(problem, options_for("compiled", options))
        except (CompilerError, NotGenerableError) as reason:
            warnings.warn(f"solver: auto takes ipopt, which is far slower: {reason}", RuntimeWarning, stacklevel=4)
            return IpoptSolver(problem, options_beside(name, "ipopt", options))
    raise ValueError(f"solver: found {name!r}; allowed: auto, {', '.join(SOLVERS)}")
