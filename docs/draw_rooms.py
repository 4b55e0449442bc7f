"""Draws the rooms of the package and their one-way imports, read from the code, as ``docs/figures/rooms.svg``.

python docs/draw_rooms.py
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
from html import escape
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / "gbt_ocp"
DRAWING = ROOT / "docs" / "figures" / "rooms.svg"

WIDTH, HEIGHT = 132, 40
ACROSS, DOWN = 168, 84
MARGIN = 24

PLACES = {
    "cli": (1, 0),
    "studies": (1, 1),
    "experiments": (1, 2),
    "reporting": (1, 3),
    "simulation": (1, 4),
    "pilot": (1, 5),
    "guidance": (1, 6),
    "ocp": (0.5, 7),
    "tracking": (1.5, 7),
    "models": (1, 8),
    "frames": (2.5, 8),
    "files": (0.5, 9),
    "typing": (1.5, 9),
}
"""Column and row of each room; who imports stands above. The arrows come from the code."""


def room(path: Path) -> str:
    """Name of the room a file belongs to."""
    return path.relative_to(PACKAGE).with_suffix("").parts[0]


def imported(path: Path) -> Iterator[tuple[str, bool]]:
    """Rooms that a file imports from, and whether only on request, inside a function."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    inside = {id(node) for f in ast.walk(tree) if isinstance(f, ast.FunctionDef) for node in ast.walk(f)}
    for node in ast.walk(tree):
        names: list[str] = []
        if isinstance(node, ast.ImportFrom) and node.module is not None:
            names = [f"gbt_ocp.{alias.name}" for alias in node.names] if node.module == "gbt_ocp" else [node.module]
        elif isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        for name in names:
            if name.startswith("gbt_ocp.") and name != "gbt_ocp.__version__":
                yield name.split(".")[1], id(node) in inside


def imports() -> tuple[set[str], set[tuple[str, str]], set[tuple[str, str]]]:
    """All rooms, pairs (importer, imported), and those pairs that are only ever imported on request."""
    rooms, always, lazily = set(), set(), set()
    for path in PACKAGE.rglob("*.py"):
        own = room(path)
        if own == "__init__" or (path.parent.name == "starting_point" and path.stem == "problem"):
            continue
        rooms.add(own)
        for other, lazy in imported(path):
            if other != own:
                (lazily if lazy else always).add((own, other))
    return rooms, always, lazily - always


def without_shortcuts(edges: set[tuple[str, str]]) -> set[tuple[str, str]]:
    """The edges that no longer way leads along as well."""

    def reached(start: str, avoid: tuple[str, str]) -> set[str]:
        seen, ahead = set(), [start]
        while ahead:
            here = ahead.pop()
            for a, b in edges - {avoid}:
                if a == here and b not in seen:
                    seen.add(b)
                    ahead.append(b)
        return seen

    return {edge for edge in edges if edge[1] not in reached(edge[0], edge)}


def drawing() -> str:
    """The drawing as SVG: who imports stands above what it imports."""
    rooms, always, lazily = imports()
    if rooms != PLACES.keys():
        raise ValueError(f"PLACES in docs/draw_rooms.py: missing or superfluous: {sorted(rooms ^ PLACES.keys())}")
    place = {name: (MARGIN + column * ACROSS, MARGIN + row * DOWN) for name, (column, row) in PLACES.items()}
    width = MARGIN + WIDTH + max(x for x, _ in place.values())
    height = MARGIN + HEIGHT + max(y for _, y in place.values()) + 40
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:g} {height:g}" font-family="sans-serif" '
        'font-size="14" role="img" aria-label="Rooms of the package and their imports">',
        '<defs><marker id="tip" viewBox="0 0 10 10" refX="9" refY="5" markerWidth="7" markerHeight="7" '
        'orient="auto"><path d="M0 0 L10 5 L0 10 z" fill="#555"/></marker></defs>',
        f'<rect width="{width:g}" height="{height:g}" fill="#fff"/>',
    ]
    for dashed, pairs in ((False, without_shortcuts(always)), (True, lazily)):
        for above, below in sorted(pairs):
            (x1, y1), (x2, y2) = place[above], place[below]
            x1, x2 = x1 + WIDTH / 2, x2 + WIDTH / 2
            if y1 < y2:
                if dashed and (above, below) not in without_shortcuts(always | {(above, below)}):
                    continue
                y1, y2 = y1 + HEIGHT, y2 - 2
            else:  # on request, upwards
                x1, x2, y2 = x1 + 30, x2 + 30, y2 + HEIGHT + 2
            bend = 0.5 * (y2 - y1)
            style = ' stroke-dasharray="5 4"' if dashed else ""
            lines.append(
                f'<path d="M{x1:g} {y1:g} C{x1:g} {y1 + bend:g} {x2:g} {y2 - bend:g} {x2:g} {y2:g}" fill="none" '
                f'stroke="#555" stroke-width="1.3" marker-end="url(#tip)"{style}/>'
            )
    for name, (x, y) in sorted(place.items()):
        lines.append(
            f'<rect x="{x:g}" y="{y:g}" width="{WIDTH}" height="{HEIGHT}" rx="6" fill="#E8F1F8" stroke="#0072B2"/>'
            f'<text x="{x + WIDTH / 2:g}" y="{y + HEIGHT / 2 + 5:g}" text-anchor="middle">{escape(name)}</text>'
        )
    notes = ("An arrow points at what is imported; dashed: on request.", "Left out: arrows where a longer way leads.")
    for line, note in enumerate(notes):
        y = height - 28 + 18 * line
        lines.append(f'<text x="{MARGIN}" y="{y:g}" font-size="12" fill="#555">{note}</text>')
    return "\n".join([*lines, "</svg>", ""])


if __name__ == "__main__":
    DRAWING.write_text(drawing(), encoding="utf-8")
