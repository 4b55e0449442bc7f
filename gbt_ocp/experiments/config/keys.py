"""How a section of the configuration is declared: its keys, their types, and what all sections share."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Annotated, Any, get_args, get_origin

import numpy as np
from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, ValidationInfo
from pydantic.fields import FieldInfo

from gbt_ocp.experiments.config.allowed import InWords, allowed, is_section


def key(default: Any, meaning: str, says: str | None = None, **bounds: Any) -> Any:
    """Declare a key.

    Parameters
    ----------
    default
        ``...`` for a key that must be written.
    meaning
        One sentence, with the unit.
    says
        What is allowed, only where type and bounds do not say it all
        (:func:`~gbt_ocp.experiments.config.allowed.allowed` derives the rest); ``{d}`` and ``{n}`` stand for the sizes
        of the problem.
    **bounds
        ``gt``, ``ge``, ``lt``, ``le`` of a number; ``pattern``, ``min_length``.
    """
    return Field(default, description=meaning, json_schema_extra={"allowed": says} if says else None, **bounds)


def as_tuples(value: Any) -> Any:
    """Sequences as YAML gives them, as tuples all the way down."""
    return tuple(as_tuples(item) for item in value) if isinstance(value, list | tuple) else value


def sized(size: str) -> AfterValidator:
    """Check of a sequence's length against a size of the problem, ``d`` or ``n``."""

    def check(value: tuple[float, ...], info: ValidationInfo) -> tuple[float, ...]:
        wanted = (info.context or {}).get(size)
        if wanted is not None and len(value) != wanted:
            raise ValueError(f"{wanted} numbers")
        return value

    return AfterValidator(check)


def _covariance(value: tuple[tuple[float, ...], ...], info: ValidationInfo) -> tuple[tuple[float, ...], ...]:
    size = (info.context or {}).get("d", len(value))
    if len(value) != size or any(len(row) != size for row in value):
        raise ValueError("square")
    matrix = np.array(value)
    if not np.allclose(matrix, matrix.T, rtol=1e-9, atol=0.0) or np.any(np.linalg.eigvalsh(matrix) <= 0.0):
        raise ValueError("symmetric positive definite")
    return value


Positive = Annotated[float, Field(gt=0.0)]
NotNegative = Annotated[float, Field(ge=0.0)]
PositiveNumbers = Annotated[tuple[Positive, ...], Field(min_length=1), BeforeValidator(as_tuples)]
NotNegativeNumbers = Annotated[tuple[NotNegative, ...], BeforeValidator(as_tuples)]
NegativeNumbers = Annotated[tuple[Annotated[float, Field(lt=0.0)], ...], BeforeValidator(as_tuples)]
Numbers = Annotated[tuple[float, ...], BeforeValidator(as_tuples)]
PositionNumbers = Annotated[Numbers, sized("d"), InWords("{d} numbers")]
InputNumbers = Annotated[Numbers, sized("n"), InWords("{n} numbers")]
PositiveInputNumbers = Annotated[PositiveNumbers, sized("n"), InWords("{n} numbers > 0")]
NegativeInputNumbers = Annotated[NegativeNumbers, sized("n"), InWords("{n} numbers < 0")]
NotPositiveNumbers = Annotated[tuple[Annotated[float, Field(le=0.0)], ...], BeforeValidator(as_tuples)]
NotPositiveInputNumbers = Annotated[NotPositiveNumbers, sized("n"), InWords("{n} numbers <= 0")]
NotNegativeInputNumbers = Annotated[NotNegativeNumbers, sized("n"), InWords("{n} numbers >= 0")]
Covariance = Annotated[
    tuple[tuple[float, ...], ...],
    BeforeValidator(as_tuples),
    AfterValidator(_covariance),
    InWords("a symmetric positive definite {d} x {d} matrix"),
]


def _with_allowed(tree: dict[str, Any], section: type[BaseModel]) -> None:
    """Add to the JSON schema of a section what each of its keys allows; a section below does so itself."""
    for name, field in section.model_fields.items():
        if not is_section(field):
            tree["properties"][name]["allowed"] = allowed(field)


class Section(BaseModel):
    """What all sections share: strict types, finite numbers, no unknown keys, frozen."""

    model_config = ConfigDict(
        strict=True, frozen=True, extra="forbid", allow_inf_nan=False, json_schema_extra=_with_allowed
    )


def sections_in(annotation: Any) -> list[type[Section]]:
    """Sections that a type is made of: those between which a union chooses, or those of a list."""
    if isinstance(annotation, type) and issubclass(annotation, Section):
        return [annotation]
    return [section for part in get_args(annotation) for section in sections_in(part)]


def listed_in(annotation: Any) -> list[type[Section]]:
    """Sections of which a type is a list."""
    if get_origin(annotation) in (tuple, list):
        return sections_in(annotation)
    return [section for part in get_args(annotation) for section in listed_in(part)]


def kinds_in(annotation: Any) -> list[str]:
    """Values of ``kind`` between which a type chooses, sorted."""
    return sorted(kind for section in sections_in(annotation) for kind in kinds_of(section))


def kinds_of(section: type[Section]) -> tuple[str, ...]:
    """Values of ``kind`` that choose a section; empty if it has no alternatives."""
    return get_args(section.model_fields["kind"].annotation) if "kind" in section.model_fields else ()


def redeclare(section: type[Section], keys: Mapping[str, tuple[Any, Any]]) -> None:
    """Give a section other keys, each with its type and what :func:`key` returned, in this order.

    The sections that hold it are built again, so that a key can be added to a schema that is in use.
    """
    section.model_fields.clear()
    for name, (annotation, declared) in keys.items():
        section.model_fields[name] = FieldInfo.from_annotated_attribute(annotation, declared)
    section.model_rebuild(force=True)
    for holder in _holders(section):
        holder.model_rebuild(force=True)


def _holders(section: type[Section]) -> Iterator[type[Section]]:
    """Sections below which a section stands, inner ones first."""
    for other in _all_sections():
        if any(section in sections_in(field.annotation) for field in other.model_fields.values()):
            yield other
            yield from _holders(other)


def _all_sections(top: type[Section] = Section) -> Iterator[type[Section]]:
    for below in top.__subclasses__():
        yield below
        yield from _all_sections(below)
