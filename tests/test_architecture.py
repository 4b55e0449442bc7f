"""The rooms of the package: who imports whom, as docs/architecture.md says, and how large they are."""

import ast
import itertools
import re
from collections import defaultdict
from graphlib import CycleError, TopologicalSorter
from importlib import import_module
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / "gbt_ocp"
ARCHITECTURE = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")

STARTING_POINT = PACKAGE / "experiments" / "starting_point" / "problem.py"
"""A file for users to start from: it stands outside the package, and imports what a user imports."""

LONGEST = 350
"""Lines of a file."""

LARGEST = 0.25
"""Share of all lines that a room may have."""


def name_of(path, package=PACKAGE):
    """The dotted name of a module's file."""
    parts = path.relative_to(package.parent).with_suffix("").parts
    return ".".join(parts).removesuffix(".__init__")


def imports(package=PACKAGE):
    """Each module of the package with the modules of the package that it imports, anywhere in its file."""
    modules = {name_of(path, package): path for path in package.rglob("*.py") if path != STARTING_POINT}
    found = {}
    for name, path in modules.items():
        found[name] = set()
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom):
                assert node.level == 0, f"{path}: a relative import"
                deeper = [f"{node.module}.{alias.name}" for alias in node.names]
                targets = [one if one in modules else node.module for one in deeper]
            elif isinstance(node, ast.Import):
                targets = [alias.name for alias in node.names]
            else:
                continue
            found[name] |= {target for target in targets if target in modules}
    return found


def circle_in(graph):
    """Modules that import each other in a circle, or ``None``."""
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        return error.args[1]
    return None


def room(module):
    return module.split(".")[1]


def table():
    """Rooms of the table in its order, each with the rooms that it says the room imports."""
    lines = ARCHITECTURE.splitlines()
    below = lines[lines.index("| room | what it holds | imports |") + 2 :]
    rows = [line.split("|")[1:-1] for line in itertools.takewhile(lambda line: line.startswith("|"), below)]
    return {row[0].strip(" `"): set(re.findall(r"`(\w+)`", row[2])) for row in rows}


def test_no_modules_import_each_other_in_a_circle():
    """Imports inside functions and those for type checkers only count like all others."""
    assert circle_in(imports()) is None


@pytest.mark.parametrize(
    "later",
    ["from small.first import f", "def g():\n    import small.first", "if TYPE_CHECKING:\n    from small import first"],
)
def test_a_circle_is_found_wherever_the_import_stands(tmp_path, later):
    package = tmp_path / "small"
    package.mkdir()
    (package / "__init__.py").touch()
    (package / "first.py").write_text("from small import second\n")
    (package / "second.py").write_text(f"{later}\n")
    assert set(circle_in(imports(package))) == {"small.first", "small.second"}


def test_the_table_of_rooms_says_what_the_code_imports():
    found = defaultdict(set)
    for module, targets in imports().items():
        if module != "gbt_ocp":
            found[room(module)] |= {room(target) for target in targets - {"gbt_ocp"}} - {room(module)}
    assert table() == dict(found)


def test_the_rooms_stand_in_an_order():
    """No room imports one that stands below it in the table."""
    order = list(table())
    for name, imported in table().items():
        for other in imported:
            assert order.index(other) < order.index(name), f"{name} imports {other}"


def test_drawing_is_imported_only_when_something_is_drawn():
    """Matplotlib takes a second to import, which a run without figures does not pay for."""
    for path in {*PACKAGE.rglob("*.py")} - {STARTING_POINT}:
        if path == PACKAGE / "__init__.py" or room(name_of(path)) in ("reporting", "studies"):
            continue
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
            if isinstance(node, ast.ImportFrom) and node.module != "gbt_ocp.reporting.tables":
                assert not node.module.startswith("gbt_ocp.reporting"), f"{path}: imports {node.module}"


def sources():
    return [path for path in PACKAGE.rglob("*") if path.suffix in (".py", ".c", ".h", ".js", ".css", ".html")]


def test_files_are_small():
    assert not [path for path in sources() if len(path.read_text(encoding="utf-8").splitlines()) > LONGEST]


def test_no_room_holds_more_than_a_quarter_of_the_lines():
    lines = defaultdict(int)
    for path in sources():
        lines[path.relative_to(PACKAGE).parts[0]] += len(path.read_text(encoding="utf-8").splitlines())
    assert max(lines.values()) <= LARGEST * sum(lines.values()), dict(lines)


NAMED_AFTER_A_KEY = ("cli", "experiments/build", "experiments/config")
"""Folders whose modules are called after the key or the subcommand that they are about, and may share its name."""

STUDIES = "studies/paper/fig"
"""Studies are laid out alike: each has a CASES, SETTINGS or ARRAYS of its own."""

IN_TRACKING = {
    # modules: both trackers of noisy bearings have a tracker, a fit, hypotheses; both families of processes kernels
    *("fit", "hypotheses", "kernels", "tracker"),
}
"""Names that stand for several things within ``tracking``."""


def names_in(kind):
    """Names of the package's modules, classes or constants, each with the files that define it."""
    found = defaultdict(list)
    for path in {*PACKAGE.rglob("*.py")} - {STARTING_POINT}:
        place = path.relative_to(PACKAGE).as_posix()
        if kind == "modules":
            if path.stem != "__init__" and str(Path(place).parent) not in NAMED_AFTER_A_KEY:
                found[path.stem].append(place)
            continue
        tree = ast.parse(path.read_text(encoding="utf-8"))
        if kind == "classes":
            for node in ast.walk(tree):
                if isinstance(node, ast.ClassDef):
                    found[node.name].append(place)
            continue
        for node in tree.body:
            for target in getattr(node, "targets", [getattr(node, "target", None)]):
                if isinstance(target, ast.Name) and target.id.isupper():
                    found[target.id].append(place)
    return {name: places for name, places in found.items() if len(places) > 1}


@pytest.mark.parametrize("kind", ["modules", "classes"])
def test_a_name_stands_for_one_thing(kind):
    assert {name: places for name, places in names_in(kind).items() if name not in IN_TRACKING} == {}


def test_constants_of_a_name_have_one_value():
    found = {}
    for name, places in names_in("constants").items():
        of_studies = [place for place in places if place.startswith(STUDIES)]
        modules = [place for place in places if place not in of_studies[1:] and Path(place).stem != "__init__"]
        values = [getattr(import_module(f"gbt_ocp.{place[:-3].replace('/', '.')}"), name) for place in modules]
        if name not in IN_TRACKING and any(value != values[0] for value in values):
            found[name] = modules
    assert found == {}
