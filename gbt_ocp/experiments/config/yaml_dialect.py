"""The YAML of the configuration files: YAML 1.1 as PyYAML reads it safely, without its traps.

A key written twice is refused instead of silently taking the second. ``1e-10`` is a number (YAML 1.1 asks for a dot and
a sign, and would make it a string). Keys are texts, and so is what stands under a key that holds texts: the name
``2024-05-01`` is not a date, and ``no`` is not false. Aliases may not expand to more than :data:`MOST_VALUES` values.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
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


MOST_VALUES = 100_000
"""Largest number of values that the aliases of a document may stand for."""

KeyPath = tuple[str, ...]
IsText = Callable[[KeyPath], bool]


class YamlError(ValueError):
    """Text that is not YAML; the message starts with the file and line."""


def parse(
    text: str | bytes, label: str, *, is_text: IsText = lambda path: False, at: KeyPath = ()
) -> tuple[Any, list[str]]:
    """Read one YAML document.

    Parameters
    ----------
    text
        The document.
    label
        File or option that it comes from, for the faults.
    is_text
        Whether the key at a path holds a text or a list of texts: what is written there is taken as it stands, ``null``
        aside.
    at
        Path of the key that the document is the value of, for ``--set``.

    Returns
    -------
    value, faults
        The document (``None`` if it is empty), and one line for every key that is written twice.

    Raises
    ------
    YamlError
        If the text is not YAML, holds Python objects, anchors that contain themselves, or aliases for more
        than :data:`MOST_VALUES` values.
    """
    loader: FileLoader | None = None
    try:
        loader = FileLoader(text)
        node = loader.get_single_node()
        if node is None:
            return None, []
        faults = list(_repeated(node, label, (), set(), set()))
        nodes: dict[int, int] = {}
        if _size(node, nodes) - len(nodes) > MOST_VALUES:
            raise YamlError(f"{label}: found aliases for more than {MOST_VALUES} values; allowed: fewer")
        return loader.construct_document(_as_texts(node, at, is_text)), faults
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
        # a tag that does not fit its value raises what its constructor happens to raise: `!!int ''`, `!!timestamp x`
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
    """The message of a library on one line; for exceptions with messages for its authors, a message of our own."""
    if isinstance(problem, Exception) and not isinstance(problem, ValueError):
        return "a value that does not fit its tag"
    return " ".join(str(problem).split())


def dump(mapping: dict[str, Any]) -> str:
    """Write a mapping in the order of its keys; lists of numbers stay on one line."""
    return yaml.dump(
        mapping, Dumper=FileDumper, sort_keys=False, allow_unicode=True, default_flow_style=None, width=110
    )


def _repeated(node: yaml.Node, label: str, path: KeyPath, above: set[int], seen: set[int]) -> Iterator[str]:
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


def _size(node: yaml.Node, known: dict[int, int]) -> int:
    """Number of values below a node, which does not contain itself."""
    if id(node) not in known:
        inner = [part for pair in node.value for part in pair] if isinstance(node, yaml.MappingNode) else node.value
        known[id(node)] = 1 + (sum(_size(part, known) for part in inner) if isinstance(inner, list) else 0)
    return known[id(node)]


_TEXT, _NULL, _MERGE = (f"tag:yaml.org,2002:{name}" for name in ("str", "null", "merge"))


def _as_texts(node: yaml.Node, path: KeyPath, is_text: IsText) -> yaml.Node:
    """The same nodes with texts for keys, and for scalars under the keys that hold texts."""
    if isinstance(node, yaml.MappingNode):
        pairs = []
        for key, value in node.value:
            named = isinstance(key, yaml.ScalarNode) and key.tag != _MERGE
            below = (*path, *key.value.split(".")) if named else path
            pairs.append((_text(key) if named else key, _as_texts(value, below, is_text)))
        return yaml.MappingNode(node.tag, pairs, node.start_mark, node.end_mark)
    if isinstance(node, yaml.SequenceNode):
        items = [_as_texts(item, path, is_text) for item in node.value]
        return yaml.SequenceNode(node.tag, items, node.start_mark, node.end_mark)
    return _text(node) if node.tag not in (_TEXT, _NULL) and is_text(path) else node


def _text(node: yaml.Node) -> yaml.Node:
    return yaml.ScalarNode(_TEXT, node.value, node.start_mark, node.end_mark)
