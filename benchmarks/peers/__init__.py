"""Other packages for optimal control, given the planner's problem as their documentation has it.

Each of the modules here holds one package: a function ``build(statement)`` that returns a :class:`Peer`.
"""

from peers.statement import NAMES, PACKAGES, Answer, Peer, Statement, make

__all__ = ["NAMES", "PACKAGES", "Answer", "Peer", "Statement", "make"]
