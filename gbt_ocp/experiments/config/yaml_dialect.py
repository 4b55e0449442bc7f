"""The YAML of the configuration files: YAML 1.1 as PyYAML reads it safely, without its two traps.

A key written twice is refused instead of silently taking the second, and ``1e-10`` is a number (YAML 1.1 asks for a
dot and a sign, and would make it a string).
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

import yaml


class FileLoader(yaml.SafeLoader):
    """Reads a configuration file."""


class FileDumper(yaml.SafeDumper):
    """Writes what :class:`FileLoader` reads back to the same values."""

    def ignore_aliases(self, data: Any) -> bool:
        """Never write anchors: a reader of the run folder should see values."""
        return True


_EXPONENT = re.compile(r"[-+]?(?:\.[0-9]+|[0-9]+(?:\.[0-9]*)?)[eE][-+]?[0-9]+$")
for _dialect in (FileLoader, FileDumper):
    _dialect.add_implicit_resolver("tag:yaml.org,2002:float", _EXPONENT, list("-+.0123456789"))


class YamlError(ValueError):
    """Text that is not YAML; the message starts with the file and line."""


def parse(text: str | bytes, label: str) -> tuple[Any, list[str]]:
    """Read one YAML document.

    Returns
    -------
    value, faults
        The document (``None`` if it is empty), and one line for every key that is written twice.

    Raises
    ------
    YamlError
        If the text is not YAML, holds Python objects or anchors that contain themselves.
    """
    loader: FileLoader | None = None
    try:
        loader = FileLoader(text)
        node = loader.get_single_node()
        if node is None:
            return None, []
        faults = list(_repeated(node, label, (), set(), set()))
        return loader.construct_document(node), faults
    except yaml.YAMLError as fault:
        mark = getattr(fault, "problem_mark", None)
        place = f"{label}:{mark.line + 1}" if mark is not None else label
        problem = getattr(fault, "problem", None) or getattr(fault, "reason", None) or str(fault).partition("\n")[0]
        raise YamlError(f"{place}: found {_one_line(problem)}; allowed: YAML") from fault
    except YamlError:
        raise
    except RecursionError:
        raise YamlError(f"{label}: found more levels than can be read; allowed: YAML") from None
    except Exception as fault:
        # a tag that does not fit its value ends in whatever its constructor stumbles over: `!!int ''`, `!!timestamp x`
        raise YamlError(f"{label}: found {_one_line(fault)}; allowed: YAML") from fault
    finally:
        if loader is not None:
            loader.dispose()


def printable(text: str) -> str:
    """A text on one line: what cannot be printed, line ends among it, is escaped."""
    return "".join(sign if sign.isprintable() else sign.encode("unicode_escape").decode() for sign in text)


def shortened(text: str) -> str:
    """At most 80 characters of a text."""
    return text if len(text) <= 80 else f"{text[:77]}..."


def _one_line(problem: object) -> str:
    """What a library says, on one line; nothing but the name of an exception that says what only its author knows."""
    if isinstance(problem, Exception) and not isinstance(problem, ValueError):
        return "a value that does not fit its tag"
    return " ".join(str(problem).split())


def dump(mapping: dict[str, Any]) -> str:
    """Write a mapping in the order of its keys; lists of numbers stay on one line."""
    return yaml.dump(
        mapping, Dumper=FileDumper, sort_keys=False, allow_unicode=True, default_flow_style=None, width=110
    )


def _repeated(node: yaml.Node, label: str, path: tuple[str, ...], above: set[int], seen: set[int]) -> Iterator[str]:
    if id(node) in above:
        raise YamlError(f"{label}:{node.start_mark.line + 1}: found an anchor that contains itself; allowed: YAML")
    if id(node) in seen:
        return
    seen.add(id(node))
    above = above | {id(node)}
    if isinstance(node, yaml.MappingNode):
        keys: set[str] = set()
        for key, value in node.value:
            name = str(key.value)
            if isinstance(key, yaml.ScalarNode) and name in keys:
                place = f"{label}:{key.start_mark.line + 1}"
                yield f"{place}: {'.'.join((*path, name))}: found the key a second time; allowed: every key once"
            keys.add(name)
            yield from _repeated(value, label, (*path, name), above, seen)
    elif isinstance(node, yaml.SequenceNode):
        for item in node.value:
            yield from _repeated(item, label, path, above, seen)
