"""From what pydantic says of a mapping to lines that name the key, what was found and what is allowed."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, get_args

from pydantic import BaseModel, ValidationError
from pydantic.fields import FieldInfo

from gbt_ocp.experiments.config.faults import Fault, shown, value_at
from gbt_ocp.experiments.config.schema import Configuration


def with_sizes(allowed: str, sizes: Mapping[str, int]) -> str:
    """Fill the sizes of the problem into what is allowed."""
    return allowed.replace("{d}", str(sizes.get("d", "d"))).replace("{n}", str(sizes.get("n", "d + 1")))


def faults_of(error: ValidationError, written: Mapping[str, Any], sizes: Mapping[str, int]) -> Iterator[Fault]:
    """Faults of a validation, one a key.

    Parameters
    ----------
    error
        What pydantic found.
    written
        The mapping that was validated.
    sizes
        d and n of the problem, as far as they are known.
    """
    done: set[tuple[str, ...]] = set()
    for detail in error.errors(include_url=False):
        path, field, models = _locate(detail["loc"])
        if detail["type"] == "extra_forbidden":
            fault = _unknown(path, str(detail["loc"][-1]), models)
        elif detail["type"].startswith("union_tag") and field is not None and models:
            path = (*path, "kind")
            fault = Fault(path, shown(value_at(written, path)), ", ".join(kinds(models)))
        else:
            fault = Fault(path, shown(value_at(written, path)), with_sizes(_allowed(field, models), sizes))
        if fault.path not in done:
            done.add(fault.path)
            yield fault


def kinds(models: Iterable[type[BaseModel]]) -> list[str]:
    """Values of ``kind`` that choose one of the models."""
    return sorted(str(kind) for model in models for kind in _tags(model))


def union_of(section: str) -> list[type[BaseModel]]:
    """Models between which ``kind`` chooses in a section."""
    return _models_in(Configuration.model_fields[section].annotation)


def _unknown(path: tuple[str, ...], key: str, models: list[type[BaseModel]]) -> Fault:
    keys = dict.fromkeys(name for model in models for name in model.model_fields)
    # A key of a section below is often meant: `yaw` beside `start` is `start.yaw_deg`.
    names = {name: name for name in keys}
    for model in models:
        for name, field in model.model_fields.items():
            for deeper in _models_in(field.annotation):
                names = {**{inner: f"{name}.{inner}" for inner in deeper.model_fields}, **names}
    close = difflib.get_close_matches(key, names, n=1)
    hint = f"; did you mean {names[close[0]]}" if close else ""
    return Fault((*path, key), f"an unknown key{hint}", ", ".join(keys))


def _allowed(field: FieldInfo | None, models: list[type[BaseModel]]) -> str:
    extra = field.json_schema_extra if field is not None else None
    if isinstance(extra, dict) and "allowed" in extra:
        return str(extra["allowed"])
    keys = dict.fromkeys(name for model in models for name in model.model_fields)
    return f"a mapping with the keys {', '.join(keys)}"


def _locate(loc: Sequence[str | int]) -> tuple[tuple[str, ...], FieldInfo | None, list[type[BaseModel]]]:
    """Key path of a pydantic location, its field, and the models below it; union tags are not part of the path."""
    models: list[type[BaseModel]] = [Configuration]
    path: tuple[str, ...] = ()
    field: FieldInfo | None = None
    for part in loc:
        owner = next((model for model in models if part in model.model_fields), None)
        if isinstance(part, int):  # which of several sections; a list of numbers is judged as a whole
            path = (*path, str(part)) if models else path
        elif owner is not None:
            path, field = (*path, str(part)), owner.model_fields[str(part)]
            models = _models_in(field.annotation)
        else:
            models = [model for model in models if part in _tags(model)] or models
    return path, field, models


def _tags(model: type[BaseModel]) -> tuple[Any, ...]:
    return get_args(model.model_fields["kind"].annotation) if "kind" in model.model_fields else ()


def _models_in(annotation: Any) -> list[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [model for part in get_args(annotation) for model in _models_in(part)]
