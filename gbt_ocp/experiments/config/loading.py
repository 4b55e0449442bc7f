"""From a name, a file or a mapping to a checked configuration.

Weakest first: defaults, the problem's defaults, the preset, what is written, ``--set``, ``--seed``. Every layer keeps
its label, so that a fault names the file or option its value came from, and all faults are reported at once.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import date
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import ValidationError

from gbt_ocp.experiments.config import catalogue
from gbt_ocp.experiments.config import yaml_dialect as dialect
from gbt_ocp.experiments.config.consistency import extremes, inconsistencies
from gbt_ocp.experiments.config.defaults import DIMENSION_DEFAULTS, PRESETS
from gbt_ocp.experiments.config.faults import NOTHING, ConfigurationError, Fault, shown, value_at
from gbt_ocp.experiments.config.idle_keys import without_effect
from gbt_ocp.experiments.config.overlay import overlaid
from gbt_ocp.experiments.config.schema import Configuration, is_text
from gbt_ocp.experiments.config.tracker import TrackerSection
from gbt_ocp.experiments.config.tracking_problem import TrackingProblem
from gbt_ocp.experiments.config.validation import faults_of
from gbt_ocp.experiments.config.vehicle import DRIVEN_BY_NAME, DRIVEN_INPUTS
from gbt_ocp.experiments.config.vehicle_choice import choose_vehicle, driven_defaults, slow_defaults


@dataclass(frozen=True)
class _Layer:
    label: str
    values: dict[str, Any]


def load_config(
    source: str | Path | Mapping[str, Any],
    overrides: Sequence[str] = (),
    seed: int | None = None,
    *,
    of_log: bool = False,
) -> Configuration:
    """Load and check a configuration.

    Parameters
    ----------
    source
        Name of a shipped configuration (``case2``), path of a YAML file or of a problem's Python file, or a mapping
        with the keys of a file.
    overrides
        Lines ``key.path=value`` with the value in YAML, stronger than what is written; later ones are stronger.
    seed
        Replaces the seed.
    of_log
        Leave the section ``tracker`` to :func:`load_tracker`, when the dimension of the log is known.

    Returns
    -------
    Configuration
        Frozen, with every default filled in and paths absolute.

    Raises
    ------
    ConfigurationError
        If anything is wrong, with one line a fault: file, key path, what was found, what is allowed.
    """
    return _checked(source, overrides, seed, 0 if of_log else None)


def load_tracker(source: str | Path | Mapping[str, Any], overrides: Sequence[str], dimension: int) -> TrackerSection:
    """The section ``tracker`` alone, for the dimension of a recorded log instead of the problem's.

    Parameters
    ----------
    source, overrides
        As for :func:`load_config`.
    dimension
        d.

    Raises
    ------
    ConfigurationError
        As :func:`load_config`; other sections are checked only where they contradict this one.
    """
    return _checked(source, overrides, None, dimension).tracker


def _checked(
    source: str | Path | Mapping[str, Any], overrides: Sequence[str], seed: int | None, logged: int | None
) -> Configuration:
    """The configuration; with the dimension of a log, the tracker's section alone; with 0, all but that."""
    label, folder, name, text = _read(source)
    faults: list[str] = []
    layers = [_Layer(label, _written(text, label, faults))]
    layers += [layer for line in overrides if (layer := _override(line, faults)) is not None]
    if seed is not None:
        layers.append(_Layer("--seed", {"seed": seed}))
    for layer in layers:
        choose_vehicle(layer.values)

    top = _merge(layers)
    chosen, problem = _problem(top.get("problem", "case2"), folder, layers, faults)
    beneath = _beneath(chosen, problem, top.get("preset", "default"), top, logged)
    layers = [*beneath, *layers]
    merged = _merge(layers)
    merged["problem"] = chosen
    merged.setdefault("name", _as_name(name or (problem.name if problem else "run")))
    _complete(merged, folder, problem)

    sizes, sections = _known_sizes(merged, problem), merged
    if logged:
        problem, sizes = None, {"d": logged}
        sections = {name: merged[name] for name in ("problem", "target", "tracker")}
    elif logged == 0:
        sections = {name: value for name, value in merged.items() if name != "tracker"}
    found: list[Fault] = []
    configuration: Configuration | None = None
    try:
        configuration = Configuration.model_validate(sections, context=sizes)
    except ValidationError as error:
        found += faults_of(error, merged, sizes)
    found += [fault for fault in extremes(merged) if fault.path not in {other.path for other in found}]
    single = {fault.path for fault in found}
    between = [*inconsistencies(merged, problem), *without_effect(merged, _merge(beneath))]
    found += [fault for fault in between if fault.path not in single]
    faults += [fault.line(_origin(fault.path, layers, label)) for fault in found]
    if faults or configuration is None:
        raise ConfigurationError(faults)
    return configuration


def _read(source: str | Path | Mapping[str, Any]) -> tuple[str, Path, str | None, Any]:
    """Label, folder for relative paths, name, and the mapping or the text of the file."""
    if isinstance(source, Mapping):
        return "configuration", Path.cwd(), None, source
    if not isinstance(source, str | Path):
        allowed = "a name, a path, or a mapping"
        raise ConfigurationError([f"configuration: found a {type(source).__name__}; allowed: {allowed}"])
    shipped = catalogue.config_path(source) if isinstance(source, str) else None
    found = shipped or catalogue.resolved(source)
    if found is None or not found.is_file():
        names = ", ".join(catalogue.config_names())
        wanted = f"{names}, or a path to a YAML or .py file"
        raise ConfigurationError([f"{dialect.shortened(str(source))}: found no such file; allowed: {wanted}"])
    path = shipped or Path(source).expanduser()
    if path.suffix == ".py":  # a problem with all its defaults
        return str(path), Path.cwd(), path.stem, {"problem": str(path.resolve())}
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as fault:
        raise ConfigurationError(
            [f"{path}: found a file that cannot be read ({fault}); allowed: UTF-8 text"]
        ) from fault
    return str(path), path.resolve().parent, path.stem, text


def _written(text: Any, label: str, faults: list[str]) -> dict[str, Any]:
    value = text
    if isinstance(text, str):
        try:
            value, repeated = dialect.parse(text, label, is_text=is_text)
        except dialect.YamlError as fault:
            raise ConfigurationError([str(fault)]) from fault
        faults += repeated
    if value is None:
        return {}
    if not isinstance(value, Mapping):
        keys = ", ".join(Configuration.model_fields)
        raise ConfigurationError([f"{label}: found {shown(value)}; allowed: a mapping with the keys {keys}"])
    return _plain_mapping(value)


def _plain_mapping(value: Mapping[Any, Any]) -> dict[str, Any]:
    return {str(key): _plain(item) for key, item in value.items()}


def _plain(value: Any) -> Any:
    """Deep copy in lists, string-keyed dicts and scalars, so that a mapping from Python reads as one from a file."""
    if isinstance(value, Mapping):
        return _plain_mapping(value)
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    return str(value) if isinstance(value, Path | date) else value


def _override(line: str, faults: list[str]) -> _Layer | None:
    key, equals, text = line.partition("=")
    parts = [part.strip() for part in key.split(".")]
    if not equals or not all(parts):
        faults.append(f"--set: found {shown(line)}; allowed: key.path=value")
        return None
    try:
        value, repeated = dialect.parse(text, f"--set {key}", is_text=is_text, at=tuple(parts))
    except dialect.YamlError as fault:
        faults.append(str(fault))
        return None
    faults += repeated
    value = _plain(value)
    for part in reversed(parts):
        value = {part: value}
    return _Layer("--set", value)


def _problem(written: Any, folder: Path, layers: list[_Layer], faults: list[str]) -> tuple[str, TrackingProblem | None]:
    """Name or absolute path of the problem, and the problem itself if it can be loaded."""
    chosen = str(written)
    if chosen.endswith(".py"):
        chosen = _absolute(chosen, folder)
    try:
        if not isinstance(written, str):
            names = ", ".join(catalogue.problem_names())
            raise catalogue.ProblemError(f"found {shown(written)}; allowed: {names}, or a path to a .py file")
        return chosen, catalogue.load_problem(chosen)
    except catalogue.ProblemError as fault:
        faults.append(f"{_origin(('problem',), layers, layers[0].label)}: problem: {fault}")
        return chosen, None


def _beneath(
    chosen: str, problem: TrackingProblem | None, preset: Any, written: Mapping[str, Any], logged: int | None
) -> list[_Layer]:
    """Layers weaker than what is written."""
    # Without a problem the rest is still checked, as far as that needs no dimension.
    dimension = logged or (problem.dimension if problem else 2)
    layers = [_Layer("defaults", DIMENSION_DEFAULTS[dimension]), _limits_of_vehicle(problem, written, dimension)]
    if problem is None:
        layers.append(_Layer("defaults", {"target": {"kind": "case2"}}))
    else:
        path = catalogue.problem_path(chosen)
        label = str(path)
        target = _plain_mapping(problem.target) if isinstance(problem.target, Mapping) else {"kind": "problem"}
        own: dict[str, Any] = {"target": target}
        if problem.vehicle is not None:
            own["vehicle"] = {"kind": "problem"}
        # the paper's turns are for a vehicle that may touch its target
        standoff = [value_at(values, ("limits", "range", "nearest_m")) for values in (problem.defaults, written)]
        if any(isinstance(value, int | float) for value in standoff):
            layers.append(_Layer("defaults", {"desired_bearing": {"period_s": "auto"}}))
        for layer in (_Layer(label, own), _Layer(label, _plain_mapping(problem.defaults))):
            _resolve_paths(layer.values, path.parent)
            choose_vehicle(layer.values)
            layers.append(layer)
    model = value_at(overlaid(_merge(layers), written, ()), ("vehicle", "model"))
    if isinstance(model, str) and model in DRIVEN_BY_NAME:
        layers.append(_Layer(f"vehicle {model}", driven_defaults(model, _merge(layers), written)))
    else:
        layers.append(_Layer("slow vehicle", slow_defaults(_merge(layers), written, dimension)))
    if isinstance(preset, str) and preset in PRESETS:
        layers.append(_Layer(f"preset {preset}", PRESETS[preset]))
    return layers


def _limits_of_vehicle(problem: TrackingProblem | None, written: Mapping[str, Any], dimension: int) -> _Layer:
    """The limits of the thrust of the vehicle that is named; the Falcon's for coefficients without a name."""
    from gbt_ocp.models.known_vehicles import KNOWN_VEHICLES  # which loads CasADi

    given = [value_at(values, ("vehicle", "parameters")) for values in (problem.defaults if problem else {}, written)]
    named = [name for name in given if isinstance(name, str) and name in KNOWN_VEHICLES]
    name = named[-1] if named and named[-1] == [value for value in given if value is not NOTHING][-1] else "falcon"
    lower, upper = KNOWN_VEHICLES[name].limits(dimension)
    limits = {"thrust_max": upper} | ({} if lower is None else {"thrust_min": lower})
    return _Layer(f"vehicle {name}", {"vehicle": limits})


def _complete(merged: dict[str, Any], folder: Path, problem: TrackingProblem | None) -> None:
    _resolve_paths(merged, folder)
    guidance = merged.get("guidance")
    if problem is None or not isinstance(guidance, dict) or guidance.get("kind") != "constant_force":
        return
    if value_at(merged, ("vehicle", "kind")) == "fossen":
        guidance.setdefault("force", [500.0] * problem.dimension + [0.0])


def _resolve_paths(values: dict[str, Any], folder: Path) -> None:
    path = value_at(values, ("target", "path"))
    if isinstance(path, str) and path:
        values["target"]["path"] = _absolute(path, folder)
    mapping = value_at(values, ("replay", "mapping"))
    if isinstance(mapping, str) and mapping.endswith((".yaml", ".yml")):  # else a name, or a path that is refused
        values["replay"]["mapping"] = _absolute(mapping, folder)


def _absolute(path: str, folder: Path) -> str:
    """A relative path is looked up beside the file that names it, then in the current folder."""
    found = catalogue.resolved(path, folder)
    return path if found is None else str(found)


def _known_sizes(merged: Mapping[str, Any], problem: TrackingProblem | None) -> dict[str, int]:
    if problem is None:
        return {}
    kind, model = (value_at(merged, ("vehicle", name)) for name in ("kind", "model"))
    if kind == "driven":
        count = DRIVEN_INPUTS.get(str(model))
        return {"d": problem.dimension} | ({} if count is None else {"n": count})
    # A user's vehicle may have any number of inputs.
    own = kind == "problem"
    return {"d": problem.dimension} if own else {"d": problem.dimension, "n": problem.dimension + 1}


def _merge(layers: Sequence[_Layer]) -> dict[str, Any]:
    merged: dict[str, Any] = {}
    for layer in layers:
        merged = overlaid(merged, layer.values, ())
    return merged


def _origin(path: tuple[str, ...], layers: Sequence[_Layer], label: str) -> str:
    """Label of the strongest layer that has a value at the path; the file for defaults and missing keys."""
    for layer in reversed(layers):
        if value_at(layer.values, path) is not NOTHING:
            return label if layer.label == "defaults" else layer.label
    return label


def _as_name(text: str) -> str:
    return re.sub(r"[^\w.-]+", "-", text).lstrip(".") or "run"
