"""Configurations spoilt at random, as hypothesis strategies: values, keys, YAML text and ``--set`` lines."""

import copy
import functools
import json
import string

import yaml
from hypothesis import strategies as st

from gbt_ocp.experiments.config import catalogue
from gbt_ocp.experiments.config.loading import load_config
from gbt_ocp.experiments.config.schema import kinds

VARIANTS = [
    [],
    ["preset=paper"],
    ["planner.formulation=hard"],
    ["sensor.noise_deg=1.0"],
    ["desired_bearing.period_s=20.0"],
    ["tracker.prior={position: [1.0, 2.0], std: 3.0}"],
    ["limits.keep_out=[{centre_m: [9.0, 9.0], radius_m: 1.0}, {corners_m: [[5, 5], [6, 5], [6, 6]]}]"],
    ["limits.range={nearest_m: 2.0, farthest_m: 50.0}", "desired_bearing.period_s=60.0"],
    *[[f"tracker.kind={kind}"] for kind in kinds("tracker")],
    *[[f"guidance.kind={kind}"] for kind in kinds("guidance")],
]
"""Overrides of a shipped configuration that lead to other sections."""

_DIRECTIONS = {
    "case5": ["limits.depth={lowest_m: -30.0, highest_m: 0.0}"],
    "case6": ["tracker={kind: lmc, kernels: [se, matern32, rq]}"],
}


@functools.cache
def bases():
    """Configurations that are right: as they are shipped, and resolved, so that every key can be hit."""
    found = []
    for name in catalogue.config_names():
        text = catalogue.config_path(name).read_text(encoding="utf-8")
        found.append(yaml.safe_load(text))
        for overrides in [*VARIANTS, _DIRECTIONS.get(name, [])]:
            try:
                found.append(load_config(name, overrides).to_mapping())
            except ValueError:  # a helix in the plane, a zone of two coordinates in space
                continue
    # a resolved configuration has the track's absolute path; a file names it relatively
    return found


NUMBERS = [0, 1, 2, 3, 5, 20, 0.0, -0.0, 0.5, 1.0, 10.0, -1, -1.0, 1e-9, 1e-30, 5e-324, 1e9, 1e30, 1.7e308, -1e308]
NUMBERS += [10**6, 10**9, 10**19, 10**40, -(10**19), float("nan"), float("inf"), float("-inf"), 2**31, 2**63]
TEXTS = [
    "",
    " ",
    "null",
    "nan",
    "1e3",
    "0x1F",
    "auto",
    "tuned",
    "sensor",
    "planner",
    "case1",
    "case9",
    "gp",
    "motion_gp",
    "mixture",
]
TEXTS += [
    "track",
    "problem",
    "fossen",
    "falcon",
    "ipopt",
    "\x00",
    "\u202egnp.",
    "é",
    "😀",
    "a" * 3000,
    "../../x",
    "~",
    "x",
]
TEXTS += ["x.py", "/dev/null", "/", "\n", "a\nb", "\ud800", "%s", "{d}", "${HOME}", "<<", "!!int 3", "2026-11-25"]
scalars = st.one_of(
    st.sampled_from(NUMBERS),
    st.sampled_from(TEXTS),
    st.sampled_from([None, True, False]),
    st.integers(),
    st.floats(),
    st.text(max_size=8),
)
values = st.recursive(
    scalars,
    lambda inner: (
        st.lists(inner, max_size=5) | st.dictionaries(st.text(max_size=6) | scalars.filter(hash), inner, max_size=3)
    ),
    max_leaves=8,
)
"""Anything that Python or YAML can put in the place of a value."""


def paths_of(node, path=()):
    """Key paths of everything in a tree."""
    items = node.items() if isinstance(node, dict) else enumerate(node) if isinstance(node, list) else ()
    for key, item in items:
        yield (*path, key)
        yield from paths_of(item, (*path, key))


def at(tree, path):
    for part in path:
        tree = tree[part]
    return tree


def put(tree, path, value):
    at(tree, path[:-1])[path[-1]] = value


@st.composite
def nearby(draw, value):
    """Something like a value: likely to be accepted."""
    if isinstance(value, bool):
        return not value
    if isinstance(value, int):
        return max(0, value + draw(st.integers(-3, 3)))
    if isinstance(value, float):
        return value * draw(st.sampled_from([0.1, 0.5, 0.9, 1.1, 2.0, 10.0]))
    if isinstance(value, list) and value and all(isinstance(item, float) for item in value):
        return [item * draw(st.sampled_from([0.5, 1.0, 1.5])) for item in value]
    if isinstance(value, str):
        return draw(st.sampled_from(TEXTS[2:19]))
    return copy.deepcopy(value)


def _misspelt(draw, key):
    place = draw(st.integers(0, max(0, len(key) - 1)))
    return draw(
        st.sampled_from(
            [key[:place] + key[place + 1 :], key + "s", key.upper(), key.replace("_", "-"), f" {key}", "kind"]
        )
    )


def _spoil(draw, tree):
    paths = list(paths_of(tree))
    if not paths:
        return
    path = draw(st.sampled_from(paths))
    value = at(tree, path)
    how = draw(st.sampled_from(["near"] * 6 + ["value", "value", "delete", "rename", "extra", "swap", "size", "nest"]))
    if how == "near":
        put(tree, path, draw(nearby(value)))
    elif how == "value":
        put(tree, path, draw(values))
    elif how == "delete":
        del at(tree, path[:-1])[path[-1]]
    elif how == "rename" and isinstance(path[-1], str):
        above = at(tree, path[:-1])
        above[_misspelt(draw, path[-1])] = above.pop(path[-1])
    elif how == "extra" and isinstance(value, dict):
        value[draw(st.sampled_from(["kind", "noise", "weight", "x"]) | st.text(max_size=5))] = draw(values)
    elif how == "swap":
        put(tree, path, copy.deepcopy(at(tree, draw(st.sampled_from(paths)))))
    elif how == "size" and isinstance(value, list):
        put(tree, path, draw(st.sampled_from([[], value[:-1], value * 2, [value], value[0] if value else 0])))
    else:
        put(tree, path, draw(st.sampled_from([[value], {"kind": value}, {path[-1]: value}, str(value)])))


@st.composite
def mappings(draw):
    """A right configuration, changed in one to three places."""
    tree = copy.deepcopy(draw(st.sampled_from(bases())))
    for _ in range(draw(st.integers(1, 3))):
        _spoil(draw, tree)
    return tree


INSERTS = [
    "\t",
    ":",
    "- ",
    "{",
    "}",
    "[",
    "]",
    "'",
    '"',
    "#",
    "&a ",
    "*a",
    "!!python/object/apply:os.getcwd []",
    "!!binary x",
]
INSERTS += [
    "!!float abc",
    "!!int ''",
    "!!timestamp x",
    "!!set {a}",
    "!!omap [a]",
    "<<: *b",
    "&b {x: 1}",
    "---\n",
    "...\n",
    "\r",
]
INSERTS += [
    "\ufeff",
    "\x00",
    "\x07",
    "\u2028",
    "? ",
    "| \n",
    "> \n",
    "%YAML 9.9\n",
    "[" * 400,
    "{a: " * 400,
    "é😀",
    "=",
    "0o17",
    "1:30",
]


@st.composite
def texts(draw):
    """Text of a configuration file, damaged as text, in bytes."""
    tree = draw(st.sampled_from(bases()))
    text = yaml.safe_dump(tree, sort_keys=False, default_flow_style=draw(st.sampled_from([None, False, True])))
    for _ in range(draw(st.integers(1, 3))):
        place = draw(st.integers(0, len(text)))
        how = draw(
            st.sampled_from(["insert", "insert", "cut", "delete", "double", "replace", "crlf", "tabs", "indent"])
        )
        if how == "insert":
            text = text[:place] + draw(st.sampled_from(INSERTS)) + text[place:]
        elif how == "cut":
            text = text[:place]
        elif how == "delete":
            text = text[:place] + text[place + draw(st.integers(1, 40)) :]
        elif how == "replace":
            text = text[:place] + draw(st.sampled_from(list(string.printable))) + text[place + 1 :]
        elif how == "double":
            lines = text.splitlines(keepends=True)
            k = draw(st.integers(0, max(0, len(lines) - 1)))
            text = "".join([*lines[: k + 1], *lines[k:]])
        elif how == "crlf":
            text = text.replace("\n", "\r\n")
        elif how == "tabs":
            text = text.replace("  ", "\t", 1)
        else:
            text = text.replace("\n", "\n ", draw(st.integers(1, 3)))
    coding = draw(st.sampled_from(["utf-8"] * 8 + ["utf-8-sig", "utf-16", "latin-1"]))
    return text.encode(coding, errors="replace")


@functools.cache
def resolved(name):
    return load_config(name).to_mapping()


@st.composite
def overrides(draw):
    """A shipped configuration and lines of ``--set`` for it, most of them of keys that it has."""
    name = draw(st.sampled_from(catalogue.config_names()))
    return name, draw(st.lists(_override(resolved(name)), min_size=1, max_size=2))


@st.composite
def _override(draw, tree):
    path = draw(st.sampled_from(list(paths_of(tree))))
    key = draw(st.sampled_from([".".join(map(str, path))] * 9 + [None])) or draw(st.text(max_size=10))
    value = draw(
        st.one_of(
            nearby(at(tree, path)).map(json.dumps),
            nearby(at(tree, path)).map(json.dumps),
            st.sampled_from(NUMBERS).map(str),
            st.sampled_from(TEXTS),
            st.sampled_from(INSERTS),
            values.map(lambda value: yaml.safe_dump(value, allow_unicode=True) if plain(value) else "{"),
        )
    )
    return draw(st.sampled_from([f"{key}={value}"] * 12 + [key, f"{key}:{value}", f".{key}=1", f"{key}.=1", "="]))


def plain(value):
    """Whether YAML can write a value: lone surrogates it cannot."""
    try:
        yaml.safe_dump(value, allow_unicode=True).encode()
    except (UnicodeError, yaml.YAMLError, TypeError):
        return False
    return True
