"""CasADi functions as plain C: one C function each, from CasADi's own generated code.

CasADi wraps what it generates in an interface of ten functions each (sparsities, memory, names) that a caller in C
has no use for and that does not compile without warnings. Only the body is kept.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from functools import cache

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from gbt_ocp.files import packaged_text

ARGUMENTS = 3
"""Every C function takes as many inputs, so that all have one type."""


_NUMBER = re.compile(r"(?<![\w.])(?:\d+\.\d*|\.\d+|\d+(?=[eE]))(?:[eE][+-]?\d+)?")
"""Constants that C takes for double precision."""


class NotGenerableError(ValueError):
    """An expression has no form in C that needs nothing but libm."""


def c_function(name: str, inputs: Sequence[ca.SX], output: ca.SX) -> ca.Function:
    """A function of SX symbols, at most :data:`ARGUMENTS`, with one dense output."""
    return ca.Function(name, list(inputs), [ca.densify(output)], {"cse": True})


def c_source(functions: Sequence[ca.Function]) -> str:
    """Definitions ``void NAME(const gbt_real *x0, …, gbt_real *out)``, static unless the name begins with ``gbt_``.

    Raises
    ------
    NotGenerableError
        If an expression has no form in C that needs nothing but libm.
    """
    generator = ca.CodeGenerator(
        "expressions.c", {"casadi_real": "gbt_real", "casadi_int": "int", "with_export": False, "include_math": False}
    )
    for function in functions:
        generator.add(function)
    text = generator.dump()
    parts = [_operators(text)]
    for function in functions:
        parts.append(("" if function.name().startswith("gbt_") else "static ") + _definition(text, function))
    return "\n".join(part for part in parts if part)


def _operators(text: str) -> str:
    """CasADi's C for operators that libm does not have, such as the square."""
    block = text[: text.index("/* Configuration this file")]
    found = re.findall(r"^(?:casadi_real|casadi_int|static) [^;{}]*\{.*?\}$", block, flags=re.MULTILINE | re.DOTALL)
    return "\n".join(_plain(f"static {entry}" if not entry.startswith("static") else entry) for entry in found)


def _definition(text: str, function: ca.Function) -> str:
    name = function.name()
    # The published function only calls the numbered one that holds the body.
    number = re.search(rf"^(?:\w+ )*{name}\(const casadi_real\*\*.*\n\s*return (casadi_f\d+)\(", text, re.MULTILINE)
    if number is None:
        raise NotGenerableError(f"CasADi generated no C code for {name}")
    start = text.index(f"static int {number.group(1)}(")
    body = text[text.index("{", start) + 1 : text.index("\n}", start)]
    body = re.sub(r"arg\[(\d+)\]\? arg\[\1\]\[(\d+)\] : 0", r"x\1[\2]", body)
    body = re.sub(r"if \(res\[0\]!=0\) res\[0\]\[(\d+)\]", r"out[\1]", body)
    body = body.replace("  return 0;", "")
    if re.search(r"\b(arg|res|iw|w|mem)\b|casadi_s\d", body):
        raise NotGenerableError(f"{name} cannot be generated as C: it calls functions of its own")
    inputs = [f"x{i}" for i in range(ARGUMENTS)]
    idle = "".join(f"  (void){x};\n" for x in inputs if not re.search(rf"\b{x}\[", body))
    arguments = ", ".join(f"const gbt_real *{x}" for x in inputs)
    return f"void {name}({arguments}, gbt_real *out)\n{{{_plain(body).rstrip()}\n{idle}}}\n"


def _plain(text: str) -> str:
    text = text.replace("casadi_real", "gbt_real").replace("casadi_int", "int")
    return _NUMBER.sub(r"(gbt_real)\g<0>", _math().sub(r"gbt_\1(", text))


@cache
def _math() -> re.Pattern[str]:
    """Calls of the functions of libm that the kernel has in the precision of the planner."""
    names = re.findall(r"#define gbt_(\w+) GBT_IN_PRECISION", packaged_text("gbt_ocp.ocp", "kernel", "gbt_math.h"))
    return re.compile(rf"\b({'|'.join(names)})\(")


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
