"""CasADi functions as plain C: one C function each, from CasADi's own generated code.

CasADi wraps what it generates in an interface of ten functions each (sparsities, memory, names) that a caller in C
has no use for and that does not compile without warnings. Only the body is kept.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from functools import cache

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from gbt_ocp.files import packaged_text

ARGUMENTS = 3
"""Every C function takes as many inputs, so that all have one type."""


CONSTANTS = {"casadi_inf": "INFINITY", "casadi_nan": "NAN"}
"""CasADi's names for what C99 writes differently."""

_NUMBER = re.compile(r"(?<![\w.])(?:\d+\.\d*|\.\d+|\d+(?=[eE]))(?:[eE][+-]?\d+)?")
"""Constants that C takes for double precision."""


class NotGenerableError(ValueError):
    """An expression has no form in C that needs nothing but libm."""


def c_function(name: str, inputs: Sequence[ca.SX], output: ca.SX) -> ca.Function:
    """A function of SX symbols, at most :data:`ARGUMENTS`, with one dense output."""
    return ca.Function(name, list(inputs), [ca.densify(output)], {"cse": True})


def c_source(functions: Sequence[ca.Function], real: str = "gbt_real") -> str:
    """Definitions ``void NAME(const gbt_real *x0, …, gbt_real *out)``, static unless the name begins with ``gbt_``.

    Parameters
    ----------
    functions
        Of :func:`c_function`.
    real
        The type of all numbers, ``gbt_real`` or ``double``.

    Raises
    ------
    NotGenerableError
        If an expression has no form in C that needs nothing but libm, or this version of CasADi writes code that is
        not understood.
    """
    generator = ca.CodeGenerator(
        "expressions.c", {"casadi_real": "gbt_real", "casadi_int": "int", "with_export": False, "include_math": False}
    )
    try:
        for function in functions:
            generator.add(function)
        text = generator.dump()
    except RuntimeError as fault:
        raise NotGenerableError(f"cannot be generated as C: {str(fault).strip().splitlines()[-1]}") from fault
    operators = _operators(text)
    bodies = [_body(text, function.name()) for function in functions]
    for function, body in zip(functions, bodies, strict=True):
        _refuse_unknown(function.name(), body, operators)
    parts = [_plain(definition, real) for definition in operators.values()]
    parts += [_definition(function.name(), body, real) for function, body in zip(functions, bodies, strict=True)]
    return "\n".join(parts)


def _operators(text: str) -> dict[str, str]:
    """CasADi's C for operators that libm does not have, such as the square, by name."""
    names = re.findall(r"^#define (casadi_\w+) CASADI_PREFIX", text, flags=re.MULTILINE)
    definition = re.compile(r"^casadi_real (casadi_\w+)\([^;{}]*\) \{.*?\}$", flags=re.MULTILINE | re.DOTALL)
    return {found[1]: f"static {found[0]}" for found in definition.finditer(text) if found[1] in names}


def _body(text: str, name: str) -> str:
    """The statements of a function, on the inputs x0, x1, … and the output ``out``."""
    # The published function only calls the numbered one that holds the body.
    call = re.search(rf"^(?:\w+ )*{name}\(const casadi_real\*\*.*\n\s*return (casadi_f\d+)\(", text, re.MULTILINE)
    numbered = call and rf"^static int {call[1]}\([^;{{]*\) \{{(.*?)\n\}}"
    found = numbered and re.search(numbered, text, re.MULTILINE | re.DOTALL)
    if not found:
        version = ca.CasadiMeta.version()
        raise NotGenerableError(f"{name} cannot be generated as C: the code of CasADi {version} is not understood")
    body = re.sub(r"arg\[(\d+)\]\? arg\[\1\]\[(\d+)\] : 0", r"x\1[\2]", found[1])
    body = re.sub(r"if \(res\[0\]!=0\) res\[0\]\[(\d+)\]", r"out[\1]", body)
    return body.replace("  return 0;", "")


def _refuse_unknown(name: str, body: str, operators: Mapping[str, str]) -> None:
    """Raise if a function uses anything but its variables, the operators and libm."""
    used = set(re.findall(r"(?<![\w.])[A-Za-z_]\w*", body))
    for operator in operators:
        if operator in used:
            used |= set(re.findall(r"\b(\w+)\(", operators[operator]))
    variables = {word for word in used if re.fullmatch(r"a\d+|x\d|out|casadi_real", word)}
    unknown = sorted(used - variables - set(operators) - set(CONSTANTS) - _libm())
    if unknown:
        raise NotGenerableError(
            f"{name} cannot be generated as C: found {', '.join(unknown)}; allowed: what C99 and its libm have"
        )


def _definition(name: str, body: str, real: str) -> str:
    inputs = [f"x{i}" for i in range(ARGUMENTS)]
    idle = "".join(f"  (void){x};\n" for x in (*inputs, "out") if not re.search(rf"\b{x}\[", body))
    arguments = ", ".join(f"const {real} *{x}" for x in inputs)
    kind = "" if name.startswith("gbt_") else "static "
    return f"{kind}void {name}({arguments}, {real} *out)\n{{{_plain(body, real).rstrip()}\n{idle}}}\n"


def _plain(text: str, real: str) -> str:
    for name, value in CONSTANTS.items():
        text = re.sub(rf"\b{name}\b", f"({real}){value}", text)
    text = text.replace("casadi_real", real).replace("casadi_int", "int")
    if real == "double":  # beside the operators of the other precision
        return re.sub(r"\bcasadi_", "double_", text)
    return _NUMBER.sub(r"(gbt_real)\g<0>", _math().sub(r"gbt_\1(", text))


@cache
def _math() -> re.Pattern[str]:
    """Calls of the functions of libm."""
    return re.compile(rf"\b({'|'.join(sorted(_libm()))})\(")


@cache
def _libm() -> frozenset[str]:
    """Functions of C99's libm that generated code may call: those that the kernel has in the planner's precision."""
    header = packaged_text("gbt_ocp.ocp", "kernel", "gbt_math.h")
    return frozenset(re.findall(r"#define gbt_(\w+) GBT_IN_PRECISION", header))


def c_array(kind: str, name: str, values: ArrayLike, *, const: str = "static const") -> str:
    """Definition of a constant array with one or two dimensions."""
    found = np.asarray(values)
    # C has no empty arrays: one zero stands for it, which is not read.
    rows = found.reshape(-1, found.shape[-1]) if found.size else np.zeros((1, 1), dtype=int)
    shape = f"[{len(rows)}][{rows.shape[1]}]" if found.ndim == 2 else f"[{rows.size}]"
    blocks = []
    for row in rows:
        entries = [repr(value) for value in row.tolist()]
        lines = [", ".join(entries[k : k + 12]) for k in range(0, len(entries), 12)]
        blocks.append("    " + ",\n    ".join(lines))
    body = "{\n" + "},\n{\n".join(blocks) + "}" if found.ndim == 2 else "\n" + blocks[0]
    return f"{const} {kind} {name}{shape} = {{{body}}};\n"


def c_numbers(values: Sequence[float]) -> str:
    """Initialiser of an array of the planner's numbers, to stand in a macro."""
    return "{" + ", ".join(f"(gbt_real){value!r}" for value in values) + "}"
