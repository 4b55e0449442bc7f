"""What a key allows, in words: derived from its type and bounds, or as written where the words say more."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin

from pydantic import BaseModel
from pydantic.fields import FieldInfo


@dataclass(frozen=True)
class InWords:
    """Words for a type whose annotation does not say all, as in ``Annotated[Numbers, InWords("{d} numbers")]``."""

    text: str


def allowed(field: FieldInfo) -> str:
    """What a key allows; ``{d}`` and ``{n}`` stand for the sizes of the problem."""
    extra = field.json_schema_extra
    if isinstance(extra, dict) and "allowed" in extra:
        return str(extra["allowed"])
    return _in_words(field.annotation, field.metadata)


def is_section(field: FieldInfo) -> bool:
    """Whether a key holds a section, or one of several, and nothing else."""
    return all(_is_model(branch) for branch, _ in _branches(field.annotation, ()))


def holds_texts(field: FieldInfo) -> bool:
    """Whether a key holds a text (of any kind, or one of several names), or a list of texts, and nothing else."""
    return _are_texts(field.annotation)


def _are_texts(annotation: Any) -> bool:
    kinds = [branch for branch, _ in _branches(annotation, ()) if branch not in (None, NoneType)]
    return all(
        branch is str
        or (get_origin(branch) is Literal and all(isinstance(one, str) for one in get_args(branch)))
        or (get_origin(branch) is tuple and all(map(_are_texts, set(get_args(branch)) - {Ellipsis})))
        for branch in kinds
    )


def with_sizes(text: str, sizes: Mapping[str, int]) -> str:
    """Put the sizes of the problem into what is allowed; without a problem, their symbols."""
    return text.replace("{d}", str(sizes.get("d", "d"))).replace("{n}", str(sizes.get("n", "d + 1")))


def _in_words(annotation: Any, added: Iterable[Any] = (), *, several: bool = False) -> str:
    """Words for a type with what ``Annotated`` or the field adds to it; `several` of it in a list."""
    names: list[str] = []
    sections: list[type[BaseModel]] = []
    others: list[str] = []
    null = False
    for branch, metadata in _branches(annotation, added):
        own = next((entry.text for entry in metadata if isinstance(entry, InWords)), None)
        if own is not None:
            others.append(own)
        elif branch in (None, NoneType):
            null = True
        elif get_origin(branch) is Literal:
            names += map(str, get_args(branch))
        elif _is_model(branch):
            sections.append(branch)
        else:
            others.append(_plain(branch, metadata, several))
    if sections:
        keys = dict.fromkeys(name for section in sections for name in section.model_fields)
        others.append("mappings" if several else f"a mapping with the keys {', '.join(keys)}")
    first = [*names, *(["null"] if null else [])]
    if not others and not null:
        return ", ".join(names)
    *first, last = [*first, *others]
    return f"{', '.join(first)}, or {last}" if first else last


def _branches(annotation: Any, added: Iterable[Any]) -> Iterator[tuple[Any, list[Any]]]:
    """The types between which a union chooses, each with what is added to it."""
    origin, arguments = get_origin(annotation), get_args(annotation)
    if origin is Annotated:
        yield from _branches(arguments[0], [*arguments[1:], *added])
    elif origin in (Union, UnionType):
        for argument in arguments:
            yield from _branches(argument, added)
    else:
        # the bounds of ``Field(gt=0.0)`` are in a list of the field
        yield (
            annotation,
            [one for entry in added for one in (entry.metadata if isinstance(entry, FieldInfo) else [entry])],
        )


def _is_model(annotation: Any) -> bool:
    return isinstance(annotation, type) and issubclass(annotation, BaseModel)


def _plain(annotation: Any, metadata: list[Any], several: bool) -> str:
    if annotation is bool:
        return "true, false"
    if annotation in (int, float):
        return _number("whole number" if annotation is int else "number", metadata, several)
    if get_origin(annotation) is tuple:
        *items, last = get_args(annotation)
        each = _in_words(items[0], several=True)
        return f"a list of {each}" if last is Ellipsis else f"{len(items) + 1} {each}"
    return "a mapping" if get_origin(annotation) is dict else "a text"


def _number(noun: str, metadata: list[Any], several: bool) -> str:
    noun = f"{noun}s" if several else f"a {noun}"
    low, high = _bound(metadata, _LOWER), _bound(metadata, _UPPER)
    if low is None or high is None:
        bound = low or high
        return noun if bound is None else f"{noun} {bound[1]} {bound[0]}"
    if noun == "a whole number" and (low[2], high[2]) == ("[", "]"):
        return f"{noun} from {low[0]} to {high[0]}"
    return f"{noun} in {low[2]}{low[0]}, {high[0]}{high[2]}"


_LOWER = (("gt", ">", "("), ("ge", ">=", "["))
_UPPER = (("lt", "<", ")"), ("le", "<=", "]"))


def _bound(metadata: list[Any], names: tuple[tuple[str, str, str], ...]) -> tuple[str, str, str] | None:
    """A bound, its sign, and its bracket in an interval."""
    for name, sign, bracket in names:
        for entry in metadata:
            bound = getattr(entry, name, None)
            if bound is not None:
                return f"{bound:g}", sign, bracket
    return None
