"""From the errors of pydantic to faults: which key, what was found there, what is allowed."""

from __future__ import annotations

import difflib
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from pydantic import ValidationError
from pydantic.fields import FieldInfo

from gbt_ocp.experiments.config.allowed import allowed, with_sizes
from gbt_ocp.experiments.config.faults import Fault, shown, value_at
from gbt_ocp.experiments.config.keys import Section, kinds_in, kinds_of, listed_in, sections_in
from gbt_ocp.experiments.config.schema import Configuration


def faults_of(
    error: ValidationError, merged: Mapping[str, Any], sizes: Mapping[str, int], top: type[Section] = Configuration
) -> Iterator[Fault]:
    """Faults of a validation, one a key.

    Parameters
    ----------
    error
        From pydantic.
    merged
        The mapping that was validated.
    sizes
        d and n of the problem, as far as they are known.
    top
        The section that was validated.
    """
    seen: set[tuple[str, ...]] = set()
    for detail in error.errors(include_url=False):
        fault = _fault(detail["type"], detail["loc"], merged, sizes, top)
        if fault.path not in seen:
            seen.add(fault.path)
            yield fault


def _fault(
    kind: str,
    location: Sequence[str | int],
    merged: Mapping[str, Any],
    sizes: Mapping[str, int],
    top: type[Section],
) -> Fault:
    path, field, sections = _followed(location, top)
    if kind == "extra_forbidden":
        return _unknown_key(path, str(location[-1]), sections)
    assert field is not None, "what is validated is a mapping, so every other error is that of a key"
    if kind.startswith("union_tag") and sections:
        path = (*path, "kind")
        return Fault(path, shown(value_at(merged, path)), ", ".join(kinds_in(field.annotation)))
    return Fault(path, shown(value_at(merged, path)), with_sizes(allowed(field), sizes))


def _followed(
    location: Sequence[str | int], top: type[Section]
) -> tuple[tuple[str, ...], FieldInfo | None, list[type[Section]]]:
    """The key path of a location, the last key on it, and the sections that may stand there.

    A location of pydantic also names the branches of the unions on the way, which are no keys.
    """
    sections: list[type[Section]] = [top]
    path: tuple[str, ...] = ()
    field: FieldInfo | None = None
    for part in location:
        owner = next((section for section in sections if part in section.model_fields), None)
        if owner is not None:
            path, field = (*path, str(part)), owner.model_fields[str(part)]
            sections = sections_in(field.annotation)
        elif isinstance(part, int):
            # one of several sections has its number in the path; a list of numbers is one value
            path = (*path, str(part)) if sections else path
            sections = listed_in(field.annotation) if field is not None else sections
        else:
            sections = [section for section in sections if part in kinds_of(section)] or sections
    return path, field, sections


def _unknown_key(path: tuple[str, ...], key: str, sections: list[type[Section]]) -> Fault:
    known = list(dict.fromkeys(name for section in sections for name in section.model_fields))
    # A key of a section below is often meant: `yaw` beside `start` is `start.yaw_deg`.
    below = {
        inner: f"{name}.{inner}"
        for section in sections
        for name, field in section.model_fields.items()
        for deeper in sections_in(field.annotation)
        for inner in deeper.model_fields
    }
    meant = {**below, **{name: name for name in known}}
    close = difflib.get_close_matches(key, meant, n=1)
    hint = f"; did you mean {meant[close[0]]}" if close else ""
    return Fault((*path, key), f"an unknown key{hint}", ", ".join(known))
