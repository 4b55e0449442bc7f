"""What objects remember, apart from what they are made of.

Parts of a loop hold compiled solvers, CasADi functions and closures, which do not change and partly cannot be written.
A skeleton is the graph of objects as they were built. What they remember is written as the attributes of each of them;
an object of the skeleton that they refer to is written as its place there. It is put back in place into a skeleton of
the same parts, so that whoever holds one of the objects sees it.
"""

from __future__ import annotations

import ctypes
import io
import pickle
from collections import deque
from collections.abc import Iterator
from copy import deepcopy
from functools import cache
from types import BuiltinFunctionType, FunctionType, MethodType, ModuleType
from typing import Any

import numpy as np

_FIXED = (type, ModuleType, FunctionType, BuiltinFunctionType, MethodType, ctypes.CDLL)
_BY_VALUE = (str, bytes, int, float, complex, bool, type(None), np.ndarray, np.generic, np.random.Generator)
_CONTAINERS = (list, tuple, deque, set, frozenset)
_NEVER_WRITTEN = frozenset(
    (str, bytes, int, float, complex, bool, type(None), np.ndarray, np.float64, np.int64, np.bool_)
)


def _is_fixed(value: Any) -> bool:
    """Whether an object remembers nothing: it is code, or it is written as what it was made from."""
    kind: Any = type(value)
    return _of_fixed_kind(kind)


@cache
def _of_fixed_kind(kind: Any) -> bool:
    foreign = kind.__module__.partition(".")[0] in ("casadi", "ctypes", "_ctypes")
    made_again = any("__reduce__" in above.__dict__ for above in kind.__mro__[:-1])
    code = issubclass(kind, (*_FIXED, Skeleton))
    return foreign or made_again or code or not (kind.__dictoffset__ or _slots(kind))


@cache
def _slots(kind: Any) -> tuple[str, ...]:
    """Names of the attributes for which a class has slots."""
    declared = [above.__dict__.get("__slots__", ()) for above in kind.__mro__]
    return tuple(name for names in declared for name in ((names,) if isinstance(names, str) else names))


def _is_frozen(kind: Any) -> bool:
    """Whether a kind is a frozen dataclass, or a frozen model of pydantic."""
    of_pydantic = getattr(kind, "model_config", None)
    if isinstance(of_pydantic, dict) and of_pydantic.get("frozen"):
        return True
    return bool(getattr(getattr(kind, "__dataclass_params__", None), "frozen", False))


@cache
def _stays(kind: Any) -> bool:
    """Whether objects of a kind are not copied: numbers, text, arrays in containers, code, and frozen ones."""
    if kind in _NEVER_WRITTEN or _is_frozen(kind):
        return True
    return not issubclass(kind, (*_CONTAINERS, dict, np.random.Generator)) and _of_fixed_kind(kind)


def _keeps(one: Any) -> bool:
    """Whether an object is not copied."""
    kind: Any = type(one)
    return _stays(kind)


def _keeps_all(some: Any) -> bool:
    """Whether none of what a container holds is copied; it mostly holds many of one kind."""
    return all(_stays(kind) for kind in set(map(type, some)))


def _attributes(one: Any) -> dict[str, Any]:
    """What an object holds, by name."""
    kind: Any = type(one)
    slots = {name: getattr(one, name) for name in _slots(kind) if hasattr(one, name)}
    return {**slots, **getattr(one, "__dict__", {})} if slots else vars(one)


class Skeleton:
    """The objects below a root, as they were built; empty before :meth:`explore`."""

    def __init__(self) -> None:
        self._objects: dict[str, Any] = {}
        self._places: dict[int, str] = {}
        self._remembering: dict[str, Any] = {}
        self._changing: list[tuple[str, Any]] = []

    def explore(self, root: Any) -> None:
        """Note all objects below a root, which may hold the skeleton itself. They have seen nothing yet."""
        reached = deque([("", root)])
        passed: set[int] = set()
        while reached:
            place, one = reached.popleft()
            if id(one) in self._places or id(one) in passed or isinstance(one, _BY_VALUE):
                continue
            if isinstance(one, dict):
                passed.add(id(one))
                reached.extend((f"{place}[{name!r}]", value) for name, value in one.items())
            elif isinstance(one, _CONTAINERS):
                passed.add(id(one))
                reached.extend((f"{place}[{number}]", value) for number, value in enumerate(one))
            else:
                self._objects[place], self._places[id(one)] = one, place
                reached.extend((f"{place}.{name}", value) for name, value in _held(one))
        self._remembering = {place: one for place, one in self._objects.items() if not _is_fixed(one)}
        self._changing = [(place, one) for place, one in self._remembering.items() if not _is_frozen(type(one))]

    def remembered(self) -> dict[str, dict[str, Any]]:
        """A copy of what the objects remember now, by their places.

        Arrays that stand in containers, and frozen objects, are not copied: they are taken as what is never written to.
        """
        known: dict[int, Any] = {}
        return {place: self._copied(_attributes(one), known) for place, one in self._changing}

    def remember(self, memory: dict[str, dict[str, Any]]) -> None:
        """Have the objects remember a copy of what :meth:`remembered` gave."""
        known: dict[int, Any] = {}
        for place, attributes in memory.items():
            _set_attributes(self._remembering[place], self._copied(attributes, known))

    def _copied(self, one: Any, known: dict[int, Any]) -> Any:
        kind: Any = type(one)
        if _stays(kind) or id(one) in self._places:
            return one
        if id(one) in known:
            return known[id(one)][1]
        made: Any = one
        if kind is dict:
            made = {
                name: item.copy() if type(item) is np.ndarray else item if _keeps(item) else self._copied(item, known)
                for name, item in one.items()
            }
        elif kind in (list, deque, set, tuple):
            if not _keeps_all(one):
                items = [self._copied(item, known) for item in one]
                made = deque(items, one.maxlen) if kind is deque else kind(items)
            elif kind is not tuple:
                made = one.copy()
        else:
            made = self._copied_object(one, known)
        known[id(one)] = (one, made)  # which holds it, so that no other gets its number
        return made

    def _copied_object(self, one: Any, known: dict[int, Any]) -> Any:
        kind: Any = type(one)
        if isinstance(one, tuple) and hasattr(kind, "_make"):
            if _keeps_all(one):
                return one
            return kind._make(self._copied(item, known) for item in one)
        if isinstance(one, np.random.Generator | dict | list | set | deque):
            return deepcopy(one)
        made = object.__new__(kind)
        _set_attributes(made, self._copied(_attributes(one), known))
        return made

    def taken(self) -> bytes:
        """What the objects remember now, written.

        Raises
        ------
        TypeError, AttributeError, pickle.PicklingError
            If one of them remembers something that cannot be written.
        """
        stream = io.BytesIO()
        _Writer(stream, self._places).dump({place: _attributes(one) for place, one in self._remembering.items()})
        return stream.getvalue()

    def put_back(self, memory: bytes) -> None:
        """Have the objects remember what was taken from them, or from those of a skeleton of the same parts.

        It is read with :mod:`pickle`, which runs what it is given: take it only from where you trust.

        Raises
        ------
        ValueError
            If it was taken from other parts. Nothing is changed then.
        """
        try:
            found: dict[str, dict[str, Any]] = _Reader(io.BytesIO(memory), self._objects).load()
        except (pickle.UnpicklingError, EOFError, KeyError, AttributeError, ImportError, IndexError) as fault:
            raise ValueError(
                f"memory: found what cannot be read here: {fault}; allowed: that of the same parts"
            ) from None
        if not isinstance(found, dict) or found.keys() != self._remembering.keys():
            raise ValueError("memory: found that of other parts; allowed: that of the same parts")
        for place, attributes in found.items():
            _set_attributes(self._remembering[place], attributes)


def _set_attributes(one: Any, attributes: dict[str, Any]) -> None:
    """Have an object hold these attributes and no others, be it frozen."""
    getattr(one, "__dict__", {}).clear()
    for name, value in attributes.items():
        object.__setattr__(one, name, value)


def _held(one: Any) -> Iterator[tuple[str, Any]]:
    """What an object holds, by name."""
    if isinstance(one, MethodType):
        yield "__self__", one.__self__
    elif isinstance(one, FunctionType):
        for number, cell in enumerate(one.__closure__ or ()):
            yield f"__closure__[{number}]", cell.cell_contents
    elif not _is_fixed(one):
        yield from _attributes(one).items()


class _Writer(pickle.Pickler):
    def __init__(self, stream: io.BytesIO, places: dict[int, str]) -> None:
        super().__init__(stream, pickle.HIGHEST_PROTOCOL)
        self._places = places

    def persistent_id(self, one: Any) -> str | None:
        """The place of an object of the skeleton; ``None`` for any other, which is written."""
        return self._places.get(id(one))


class _Reader(pickle.Unpickler):
    def __init__(self, stream: io.BytesIO, objects: dict[str, Any]) -> None:
        super().__init__(stream)
        self._objects = objects

    def persistent_load(self, place: str) -> Any:
        """The object at a place."""
        return self._objects[place]
