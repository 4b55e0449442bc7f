"""Expressions of a position, rewritten for coordinates relative to the place where a plan begins.

A plan spans metres, and may begin a thousand kilometres from the origin of its coordinates, where single precision
knows half a metre. So the generated step plans in coordinates relative to the start. An expression sees its position
in sums and multiples only, until something that is not linear is done with them: ``(z - centre)²`` of a zone,
``target - z`` of an objective. Each such sum is split into its relative part and one number,

    a·z + b·p + c  =  a·(z - origin) + [a·origin + b·p + c],

where p are parameters. The numbers in brackets are all that depends on the origin; they are computed once a plan, in
double precision.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import casadi as ca
import numpy as np

from gbt_ocp.ocp.codegen.expressions import NotGenerableError
from gbt_ocp.typing import Array


@dataclass(frozen=True)
class Placed:
    """An expression in relative coordinates.

    Attributes
    ----------
    value
        The expression, of the same symbols; those of the position are relative now.
    numbers
        Further symbols in it ``(k,)``, in place of the parameters.
    located
        What these are, of the origin and the parameters ``(k,)``.
    shift
        What each row of the value is less than that of the original ``(m,)``.
    """

    value: ca.SX
    numbers: ca.SX
    located: ca.SX
    shift: Array


def placed(
    value: ca.SX, position: ca.SX, parameters: ca.SX, others: ca.SX, origin: ca.SX, reference: Array | None = None
) -> Placed:
    """Rewrite an expression.

    Parameters
    ----------
    value
        A column ``(m,)`` of the symbols below.
    position, parameters, others
        Symbols: of the position ``(d,)``, of what the numbers replace, and of all else.
    origin
        Symbols ``(d,)`` for the origin.
    reference
        A number for each row, such as its bound, taken off the rows that are sums of coordinates themselves, such as a
        depth: the difference of two large numbers is left to double precision. Rows with one that is not finite stay.

    Raises
    ------
    NotGenerableError
        If the expression calls functions of its own.
    """
    tape = _Tape(position, parameters, origin)
    function = ca.Function("expression", [position, parameters, others], [ca.densify(value)])
    symbols = {0: position, 1: parameters, 2: others}
    work: dict[int, _Node] = {}
    rows, shift = [ca.SX(0)] * value.numel(), np.zeros(value.numel())
    for k in range(function.n_instructions()):
        operation, inputs = function.instruction_id(k), function.instruction_input(k)
        outputs = function.instruction_output(k)
        if operation == ca.OP_INPUT:
            work[outputs[0]] = tape.symbol(inputs[0], inputs[1], symbols[inputs[0]][inputs[1]])
        elif operation == ca.OP_CONST:
            work[outputs[0]] = tape.constant(function.instruction_constant(k))
        elif operation == ca.OP_OUTPUT:
            node, row = work[inputs[0]], outputs[1]
            if node.of_position and reference is not None and np.isfinite(reference[row]):
                shift[row] = reference[row]
                node = tape.combined(node, 1.0, tape.constant(shift[row]), -1.0, None)
            rows[row] = tape.expression(node)
        else:
            work[outputs[0]] = tape.operation(operation, [work[number] for number in inputs])
    rewritten = ca.vertcat(*rows)
    # a symbol is its own name in the list of those that are left
    used = {symbol.name() for symbol in ca.symvar(rewritten)}
    kept = [pair for pair in tape.numbers.values() if pair[0].name() in used]
    columns = [ca.vertcat(ca.SX(0, 1), *(pair[part] for pair in kept)) for part in (0, 1)]
    return Placed(rewritten, columns[0], columns[1], shift)


@dataclass(frozen=True)
class _Node:
    """A value on the tape: an expression, or a linear one ``a·z + b·p + c`` that has none yet, or both."""

    expression: ca.SX | None
    coefficients: Array | None = None
    constant: float = 0.0
    of_position: bool = False


@dataclass
class _Tape:
    """Turns operations into nodes, and makes numbers where a linear node of the position is used."""

    position: ca.SX
    parameters: ca.SX
    origin: ca.SX
    numbers: dict[bytes, tuple[ca.SX, ca.SX]] = field(default_factory=dict)

    def symbol(self, kind: int, number: int, symbol: ca.SX) -> _Node:
        """The node of an input."""
        if kind == 2:
            return _Node(symbol)
        unit = np.zeros(self.position.numel() + self.parameters.numel())
        unit[number + (self.position.numel() if kind == 1 else 0)] = 1.0
        return _Node(None, unit, 0.0, True) if kind == 0 else _Node(self._number(unit, 0.0), unit)

    def constant(self, value: float) -> _Node:
        """The node of a constant."""
        if not np.isfinite(value):
            return _Node(ca.SX(value))
        return _Node(ca.SX(value), np.zeros(self.position.numel() + self.parameters.numel()), value)

    def operation(self, operation: int, arguments: list[_Node]) -> _Node:
        """The node of an operation on others."""
        if not 1 <= len(arguments) <= 2:
            raise NotGenerableError("cannot be generated as C: an expression calls functions of its own")
        first, second = arguments[0], arguments[-1]
        if any(node.of_position for node in arguments) and all(node.coefficients is not None for node in arguments):
            factors = _linear(operation, first, second)
            if factors is not None:
                return self.combined(first, factors[0], second, factors[1], None)
        expressions = [self.expression(node) for node in arguments]
        whole = ca.SX.unary(operation, *expressions) if len(arguments) == 1 else ca.SX.binary(operation, *expressions)
        if all(node.coefficients is not None for node in arguments):
            factors = _linear(operation, first, second)
            if factors is not None:
                return self.combined(first, factors[0], second, factors[1], whole)
        return _Node(whole)

    def combined(self, first: _Node, one: float, second: _Node, other: float, expression: ca.SX | None) -> _Node:
        """A linear combination of linear nodes."""
        assert first.coefficients is not None
        assert second.coefficients is not None
        coefficients = one * first.coefficients + other * second.coefficients
        of_position = bool(np.any(coefficients[: self.position.numel()]))
        constant = one * first.constant + other * second.constant
        node = _Node(expression, coefficients, constant, of_position)
        return node if of_position else _Node(self.expression(node), coefficients, constant)

    def expression(self, node: _Node) -> ca.SX:
        """The expression of a node."""
        if node.expression is not None:
            return node.expression
        assert node.coefficients is not None
        total = self._number(node.coefficients, node.constant)
        for factor, symbol in zip(node.coefficients, ca.vertsplit(self.position), strict=False):
            if factor:
                total = total + factor * symbol
        return total

    def _number(self, coefficients: Array, constant: float) -> ca.SX:
        """The symbol for what a linear node is at the origin; the same for the same node."""
        key = coefficients.tobytes() + np.float64(constant).tobytes()
        if key not in self.numbers:
            located = ca.SX(constant)
            symbols = [*ca.vertsplit(self.origin), *ca.vertsplit(self.parameters)]
            for factor, symbol in zip(coefficients, symbols, strict=True):
                if factor:
                    located = located + factor * symbol
            self.numbers[key] = ca.SX.sym(f"number{len(self.numbers)}"), located
        return self.numbers[key][0]


def _linear(operation: int, first: _Node, second: _Node) -> tuple[float, float] | None:
    """The factors of a linear operation on linear nodes; ``None`` if it is not one."""
    match operation:
        case ca.OP_ADD:
            return 1.0, 1.0
        case ca.OP_SUB:
            return 1.0, -1.0
        case ca.OP_NEG:
            return -1.0, 0.0
        case ca.OP_TWICE:
            return 2.0, 0.0
        case ca.OP_MUL if _is_constant(second):
            return second.constant, 0.0
        case ca.OP_MUL if _is_constant(first):
            return 0.0, first.constant
        case ca.OP_DIV if _is_constant(second) and second.constant != 0.0:
            return 1.0 / second.constant, 0.0
    return None


def _is_constant(node: _Node) -> bool:
    return node.coefficients is not None and not np.any(node.coefficients)
