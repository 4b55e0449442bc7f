"""Writes the keys of the configuration, section by section, at the end of ``docs/configuration.md``.

python docs/write_keys.py
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import yaml
from pydantic.fields import FieldInfo

from gbt_ocp.experiments.config.allowed import allowed, is_section, with_sizes
from gbt_ocp.experiments.config.keys import Section, kinds_of, listed_in, sections_in
from gbt_ocp.experiments.config.schema import Configuration

PAGE = Path(__file__).resolve().parent / "configuration.md"
HEADING = "## Keys\n"

TOP = "Keys without a section"
TITLES = {
    "target": "what is tracked",
    "sensor": "what is measured",
    "tracker": "what estimates the target",
    "guidance": "what moves the vehicle",
    "planner": "how plans are made",
    "limits": "limits besides thrust",
    "desired_bearing": "where the vehicle should be seen from",
    "vehicle": "the vehicle with which is planned",
    "vehicles": "several vehicles with the same target",
    "link": "how several vehicles talk",
    "plant": "the vehicle and the water as they are",
    "pilot": "the online loop",
    "replay": "recorded logs",
}
"""Sections in the order of the page, and what each is about."""


@dataclass(frozen=True)
class Key:
    """A key, or one of the forms that it has beside different kinds.

    Attributes
    ----------
    path
        With the sections above it, by dots.
    default, allowed, meaning
        In words; no default where it has to be written.
    """

    path: str
    default: str
    allowed: str
    meaning: str


def keys(model: type[Section] = Configuration, prefix: str = "", of: tuple[str, ...] = ()) -> dict[Key, list[str]]:
    """Every key with the kinds of its section that have it; forms of one key stand side by side."""
    found: dict[str, dict[Key, list[str]]] = {}
    for name, field in model.model_fields.items():
        path = f"{prefix}{name}"
        if not is_section(field):
            one = _key(path, field)
            found.setdefault(path, {}).setdefault(one, []).extend(of)
        sections = sections_in(field.annotation)
        for section in sections:
            below = keys(section, f"{path}.", of or _labels(section, field, len(sections)))
            for key, kinds in below.items():
                forms = found.setdefault(key.path, {})
                if key.path == f"{path}.kind" and forms:
                    (before,) = forms
                    key = Key(key.path, "", f"{before.allowed}, {key.allowed}", "What it is.")
                    found[key.path] = {key: forms[before] + kinds}
                else:
                    known = forms.setdefault(key, [])
                    known += [kind for kind in kinds if kind not in known]
    return {key: kinds for forms in found.values() for key, kinds in forms.items()}


def _labels(section: type[Section], field: FieldInfo, of: int) -> tuple[str, ...]:
    """Words for a section among those between which a key chooses."""
    if of == 1:
        return ()
    if section in listed_in(field.annotation):
        return ("in a list",)
    return kinds_of(section) or ("one alone",)


def _key(path: str, field: FieldInfo) -> Key:
    default = ""
    if field.default_factory is None and not field.is_required():
        default = yaml.safe_dump(field.default, default_flow_style=True).replace("\n...", "")
        default = default.strip().replace("!!python/tuple ", "")
    return Key(path, default, with_sizes(allowed(field), {}), field.description or "")


def section_of(key: Key) -> str:
    """Name of the section that holds a key; `TOP` for those that stand alone."""
    first, *further = key.path.split(".")
    return first if further or first in TITLES else TOP


def tables() -> str:
    """All sections, in Markdown."""
    by_section: dict[str, dict[Key, list[str]]] = {TOP: {}} | {name: {} for name in TITLES}
    for key, kinds in keys().items():
        by_section[section_of(key)][key] = kinds
    index = ", ".join(f"[{name}](#{_heading(name).replace(':', '').replace(' ', '-')})" for name in TITLES)
    lines = ["", f"Section by section: {index}.", ""]
    lines += ["Where a section has several kinds, *of* says which of them have a key; no entry means all.", ""]
    for name, rows in by_section.items():
        lines += [f"### {_heading(name)}", ""]
        lines += _table(rows)
        lines.append("")
    return "\n".join(lines).rstrip() + "\n"


def _heading(name: str) -> str:
    return f"{name}: {TITLES[name]}" if name in TITLES else name


def _table(rows: dict[Key, list[str]]) -> list[str]:
    every = list(dict.fromkeys(kind for kinds in rows.values() for kind in kinds))
    several = len(every) > 1
    head = ["key", *(["of"] if several else []), "default", "allowed", "meaning"]
    lines = [f"| {' | '.join(head)} |", f"|{'---|' * len(head)}"]
    for key, kinds in rows.items():
        having = "" if set(kinds) in (set(), set(every)) else ", ".join(kinds)
        cells = [f"`{key.path}`", *([having] if several else [])]
        cells += [f"`{key.default}`" if key.default else "", key.allowed, key.meaning]
        lines.append(f"| {' | '.join(cells)} |")
    return lines


def page() -> str:
    """The page with its keys as they are now."""
    text = PAGE.read_text(encoding="utf-8")
    return text[: text.index(HEADING) + len(HEADING)] + tables()


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
