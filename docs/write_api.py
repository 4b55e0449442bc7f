"""Writes the Python reference, ``docs/api.md`` and a page a room in ``docs/api/``, from what the rooms make public.

python docs/write_api.py
"""

from __future__ import annotations

from importlib import import_module
from inspect import getdoc
from pathlib import Path

from gbt_ocp.simulation.columns import columns
from gbt_ocp.simulation.history import History

DOCS = Path(__file__).resolve().parent

ROOMS = {
    "gbt_ocp": "Experiments",
    "gbt_ocp.ocp": "Trajectory problems",
    "gbt_ocp.guidance": "Guidance",
    "gbt_ocp.tracking": "Tracking",
    "gbt_ocp.models": "Bearings, vehicles, targets, sensor",
    "gbt_ocp.pilot": "The online loop",
    "gbt_ocp.frames": "Frames, units and clocks",
    "gbt_ocp.simulation": "The closed loop",
    "gbt_ocp.reporting": "Figures and pages",
}
"""Public rooms in the order of the reference, with the titles of their pages."""


def page_of(room: str) -> str:
    """File name of a room's page."""
    return f"{room.rpartition('.')[2]}.md"


def first_line(documented: object) -> str:
    """The sentence with which a docstring begins."""
    return (getdoc(documented) or "").partition("\n\n")[0].replace("\n", " ")


def recorded_arrays() -> list[str]:
    """The table of the arrays of a run."""
    lines = ["## Arrays of a run", "", "Attributes of `History`, in `history.npz` under the same names.", ""]
    lines += ["| array | shape | unit | what |", "|---|---|---|---|"]
    for one in columns(History):
        meaning = one.meaning.replace("``", "`").replace("|", "\\|")
        lines.append(f"| `{one.name}` | `{one.shape}` | {one.units} | {meaning} |")
    lines += [
        "",
        "K steps, d coordinates, m inputs, n + 1 forecast times, p pieces; the flat output has d + 1 entries.",
        "",
    ]
    return lines


def pages() -> dict[str, str]:
    """Text of each page by its path below ``docs/``."""
    found, index = {}, ["# Python reference", ""]
    index += [
        "Shapes are in brackets, time first; units are SI, angles in radians. Symbols are those of the paper.",
        "",
    ]
    index += ["| page | module | what it has |", "|---|---|---|"]
    for room, title in ROOMS.items():
        module = import_module(room)
        names = sorted(module.__all__, key=str.casefold)
        shown = ", ".join(f"`{name}`" for name in names)
        index.append(f"| [{title}](api/{page_of(room)}) | `{room}` | {shown} |")
        lines = [f"# {title}", "", f"`{room}`: {first_line(module)[:1].lower()}{first_line(module)[1:]}", ""]
        lines += [line for name in names for line in (f"::: {room}.{name}", "")]
        if room == "gbt_ocp.simulation":
            lines += recorded_arrays()
        found[f"api/{page_of(room)}"] = "\n".join(lines)
    return {"api.md": "\n".join([*index, ""]), **found}


if __name__ == "__main__":
    for name, text in pages().items():
        (DOCS / name).parent.mkdir(exist_ok=True)
        (DOCS / name).write_text(text, encoding="utf-8")
