"""Docstrings of this package say in free text what a function returns; the pages show the annotation as its type.

The parser of NumPy's style takes the first line of the section ``Returns`` for a type. So each text is put below the
annotation before it is parsed. mkdocs.yml names this file as an extension of griffe.
"""

from __future__ import annotations

import re
from textwrap import indent
from typing import Any

import griffe

_SECTION = re.compile(r"(?ms)^Returns\n-{3,}\n(.*?)(?=^\w[\w ]*\n-{3,}$|\Z)")


def typed(text: str, annotation: str) -> str:
    """A docstring whose section ``Returns`` begins with the annotation, where free text stands there."""

    def below(found: re.Match[str]) -> str:
        body = found[1].rstrip()
        if re.search(r"(?m)^ ", body):  # described in NumPy's own way
            return found[0]
        return f"Returns\n-------\n{annotation}\n{indent(body, '    ')}\n\n"

    return _SECTION.sub(below, text)


class ReturnsAsText(griffe.Extension):
    """Changes the docstring of each function that is loaded."""

    def on_function(self, *, func: griffe.Function, **_: Any) -> None:
        """Called with each function when it has been read."""
        if func.docstring is not None and func.returns is not None:
            func.docstring.value = typed(func.docstring.value, str(func.returns))
