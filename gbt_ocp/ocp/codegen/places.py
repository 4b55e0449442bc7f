"""Expressions of a position, rewritten for coordinates relative to the place where a plan begins.

A plan spans metres, and may begin a thousand kilometres from the origin of its coordinates, where single precision
knows half a metre. So the generated step plans in coordinates relative to the start. An expression has its position in
sums and multiples until something that is not linear is done with them: ``(z - centre)²`` of a zone, ``target - z`` of
an objective. Each such sum is split into its relative part and one number,

    a·z + b·p + c + rest  =  a·(z - origin) + [a·origin + b·p + c] + rest,

where p are parameters. The numbers in brackets are all that depends on the origin. They are computed once a plan, in
double precision.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

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
        If the expression calls functions, such as an interpolant.
    """
    function = ca.Function("expression", [position, parameters, others], [ca.densify(value)])
    _refuse_calls(function)
    inputs = [*ca.vertsplit(position), *ca.vertsplit(parameters), *ca.vertsplit(others)]
    first = [0, position.numel(), position.numel() + parameters.numel()]
    numbers = _Numbers(position, parameters, origin)
    work: dict[int, _Sum] = {}
    rows, shift = [ca.SX(0)] * value.numel(), np.zeros(value.numel())
    for k in range(function.n_instructions()):
        operation, arguments = function.instruction_id(k), function.instruction_input(k)
        outputs = function.instruction_output(k)
        if operation == ca.OP_INPUT:
            number = first[arguments[0]] + arguments[1]
            work[outputs[0]] = numbers.unit(number) if number < first[2] else numbers.rest(inputs[number])
        elif operation == ca.OP_CONST:
            work[outputs[0]] = numbers.constant(function.instruction_constant(k))
        elif operation == ca.OP_OUTPUT:
            total, row = work[arguments[0]], outputs[1]
            if np.any(total.coefficients[: first[1]]) and reference is not None and np.isfinite(reference[row]):
                shift[row] = reference[row]
                total = total.plus(numbers.constant(-shift[row]))
            rows[row] = numbers.expression(total)
        else:
            work[outputs[0]] = numbers.operation(operation, [work[number] for number in arguments])
    rewritten = ca.vertcat(*rows)
    # a symbol is its own name in the list of those that are left
    used = {symbol.name() for symbol in ca.symvar(rewritten)}
    kept = [pair for pair in numbers.made.values() if pair[0].name() in used]
    columns = [ca.vertcat(ca.SX(0, 1), *(pair[part] for pair in kept)) for part in (0, 1)]
    return Placed(rewritten, columns[0], columns[1], shift)


def _refuse_calls(function: ca.Function) -> None:
    """Raise if an expression calls functions: ``ca.SX.unary`` and ``ca.SX.binary`` make a zero of a call."""
    if any(function.instruction_id(k) == ca.OP_CALL for k in range(function.n_instructions())):
        called = ", ".join(sorted(one.name() for one in function.find_functions(0)))
        raise NotGenerableError(
            f"an expression cannot be generated as C: found {called}; allowed: what C99 and its libm have"
        )


@dataclass(frozen=True)
class _Sum:
    """``coefficients · (z, p) + constant + rest``."""

    coefficients: Array
    constant: float
    rest: ca.SX

    def plus(self, other: _Sum) -> _Sum:
        return _Sum(self.coefficients + other.coefficients, self.constant + other.constant, self.rest + other.rest)

    def times(self, factor: float) -> _Sum:
        return _Sum(factor * self.coefficients, factor * self.constant, factor * self.rest)

    @property
    def factor(self) -> float | None:
        """The sum itself if it is a constant other than zero."""
        is_constant = not np.any(self.coefficients) and self.rest.is_zero()
        return self.constant if is_constant and self.constant != 0.0 else None


@dataclass
class _Numbers:
    """The sums of an expression, and the symbols of those that something else is computed from."""

    position: ca.SX
    parameters: ca.SX
    origin: ca.SX
    made: dict[bytes, tuple[ca.SX, ca.SX]] = field(default_factory=dict)

    def unit(self, number: int) -> _Sum:
        """A coordinate of the position, or a parameter."""
        return _Sum(np.eye(1, self.position.numel() + self.parameters.numel(), number)[0], 0.0, ca.SX(0))

    def rest(self, expression: ca.SX) -> _Sum:
        """What is not linear in them."""
        return _Sum(np.zeros(self.position.numel() + self.parameters.numel()), 0.0, expression)

    def constant(self, value: float) -> _Sum:
        """A constant."""
        return replace(self.rest(ca.SX(0)), constant=value) if np.isfinite(value) else self.rest(ca.SX(value))

    def operation(self, operation: int, arguments: Sequence[_Sum]) -> _Sum:
        """A sum of sums where the operation is linear, else a rest."""
        first, second = arguments[0], arguments[-1]
        match operation:
            case ca.OP_ADD:
                return first.plus(second)
            case ca.OP_SUB:
                return first.plus(second.times(-1.0))
            case ca.OP_NEG:
                return first.times(-1.0)
            case ca.OP_TWICE:
                return first.times(2.0)
            case ca.OP_MUL if second.factor is not None:
                return first.times(second.factor)
            case ca.OP_MUL if first.factor is not None:
                return second.times(first.factor)
            case ca.OP_DIV if second.factor is not None:
                return first.times(1.0 / second.factor)
        make = ca.SX.unary if len(arguments) == 1 else ca.SX.binary
        return self.rest(make(operation, *(self.expression(argument) for argument in arguments)))

    def expression(self, total: _Sum) -> ca.SX:
        """A sum in relative coordinates."""
        found = ca.SX(total.constant) if not np.any(total.coefficients) else self._number(total)
        for factor, symbol in zip(total.coefficients, ca.vertsplit(self.position), strict=False):
            if factor:
                found = found + factor * symbol
        return found + total.rest

    def _number(self, total: _Sum) -> ca.SX:
        """The symbol for what a sum without its rest is at the origin; one for all that are equal there."""
        key = total.coefficients.tobytes() + np.float64(total.constant).tobytes()
        if key not in self.made:
            located = ca.SX(total.constant)
            symbols = [*ca.vertsplit(self.origin), *ca.vertsplit(self.parameters)]
            for factor, symbol in zip(total.coefficients, symbols, strict=True):
                if factor:
                    located = located + factor * symbol
            self.made[key] = ca.SX.sym(f"number{len(self.made)}"), located
        return self.made[key][0]
