"""What the site has that no file of ``docs/`` holds: the gallery, from run folders made now, and the command line.

MkDocs calls the functions ``on_…``. Runs are kept in ``.gallery/`` and made again when the package changes.
"""

from __future__ import annotations

import hashlib
import os
import re
import shutil
import subprocess
from pathlib import Path
from typing import Any

from mkdocs.structure.files import File, Files

ROOT = Path(__file__).resolve().parents[1]
RUNS = ROOT / ".gallery"

os.environ.setdefault("COLUMNS", "96")  # of the help texts
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

CASES = {
    "case1": "constant velocity in the plane",
    "case2": "figure eight in the plane",
    "case3": "circle with varying speed in the plane",
    "case4": "constant velocity in space",
    "case5": "figure eight in the plane, periodic depth",
    "case6": "circle with varying speed, periodic depth",
}
HARD = ["planner.formulation=hard", "planner.pieces=10"]
ANIMATED = {"case2": "In the plane", "case5": "In space"}
SETTINGS = {
    **{name: (name, HARD) for name in CASES},
    **{f"{name}-film": (name, [*HARD, "duration_s=12"]) for name in ANIMATED},
    "hard": ("case3", ["planner.formulation=hard", "duration_s=15"]),
    "penalty": ("case3", ["planner.formulation=penalty", "duration_s=15"]),
    "sea": ("sea2d", ["duration_s=120"]),
    "torpedo": ("torpedo2d", ["duration_s=120"]),
}
AT_SEA = {"sea", "torpedo"}
"""Run folders of the gallery: configuration and what is set in it."""

_COMPARED = {
    "error_settled": "settled error, m",
    "violation_max": "largest thrust above its limit",
    "objective_mean": "mean objective",
    "solver_iterations_mean": "mean iterations",
    "solver_time_median_ms": "median time of a plan, ms",
}


SECTIONS = {"howto": "How to", "tutorial": "Start"}
"""Where pages of a folder belong that the navigation does not name; others are about how good it is."""


def on_config(config: Any) -> Any:
    """Add the pages that the navigation does not name, so that none is left out."""
    text = str(config.nav)
    docs = Path(config.docs_dir)
    for path in sorted([*docs.rglob("*.md"), *docs.glob("*.ipynb")]):
        name = path.relative_to(docs).as_posix()
        if f"'{name}'" not in text:
            title = SECTIONS.get(path.relative_to(docs).parts[0], "How good it is")
            next(entry for entry in config.nav if title in entry)[title].append(name)
    return config


def on_files(files: Files, config: Any) -> Files:
    """Add the generated pages and pictures."""
    pages = {"gallery/index.md": gallery_page(), "command-line.md": command_line_page()}
    for name, text in pages.items():
        files.append(File.generated(config, name, content=text))
    for path in sorted(folder().glob("files/*")):
        files.append(File.generated(config, f"gallery/{path.name}", abs_src_path=str(path)))
    return files


def on_page_content(html: str, **_: Any) -> str:
    """Docstrings name things as Sphinx does; the role before a name means nothing to Markdown."""
    html = re.sub(r":(?:class|func|meth|attr|mod|data):(?=<code>)", "", html)
    return re.sub(r"<code>~(?:\w+\.)*(\w+)</code>", r"<code>\1</code>", html)


def folder() -> Path:
    """Where the gallery's runs are: a name that changes with the sources they come from."""
    found = hashlib.sha256(Path(__file__).read_bytes())
    for place in ("gbt_ocp", "problems", "configs"):
        for path in sorted((ROOT / place).rglob("*")):
            if path.is_file() and "__pycache__" not in path.parts:
                found.update(path.read_bytes())
    return RUNS / found.hexdigest()[:16]


def make_runs() -> Path:
    """Run everything in `SETTINGS` that is not there yet, with its pictures in ``files/``."""
    import gbt_ocp as gbt
    from gbt_ocp.reporting.animation import write_animation

    place = folder()
    for old in RUNS.glob("*"):
        if old != place:
            shutil.rmtree(old)
    files = place / "files"
    files.mkdir(parents=True, exist_ok=True)
    for name, (configuration, overrides) in SETTINGS.items():
        if not (place / name).is_dir():
            gbt.run(configuration, overrides=overrides).save(place / name)
        if name.endswith("-film"):
            for kind in ("html", "gif"):
                if not (files / f"{name}.{kind}").is_file():
                    write_animation(place / name, files / f"{name}.{kind}")
        for drawn in ("trajectories", "error", "thrust", *(["range"] if name in AT_SEA else [])):
            shutil.copyfile(place / name / "figures" / f"{drawn}.png", files / f"{name}-{drawn}.png")
    return place


def gallery_page() -> str:
    """The gallery, in Markdown."""
    from gbt_ocp import Result

    place = make_runs()
    results = {name: Result.load(place / name) for name in SETTINGS}
    lines = ["# Gallery", "", f"Made with the site, by `gbt-ocp` {commit()}. Each picture names its command.", ""]
    for name, title in ANIMATED.items():
        film = f"{name}-film"
        lines += [
            f"## {title}: {CASES[name]}",
            "",
            f"![Film of {name}: target, vehicle, bearing, forecast with 95 % regions, plan]({film}.gif)",
            "",
            f"[Open it as a page to play with]({film}.html): pause, scrub, zoom{', turn' if name == 'case5' else ''}, "
            "and read off what the pointer is at.",
            "",
            f"    gbt-ocp run {name} --set {' '.join(SETTINGS[film][1])} \\",
            f"        --out {name}",
            f"    gbt-ocp animate {name} --out {name}.gif",
            "",
        ]
    lines += ["## The six cases of the paper", ""]
    for name, title in CASES.items():
        error = results[name].summary["error_settled"]
        lines += [
            f"### {name}: {title}",
            "",
            f"![Paths of {name}]({name}-trajectories.png)",
            "",
            f"Settled error {error:.2g} m.",
            "",
            f"    gbt-ocp run {name} --set {' '.join(HARD)}",
            "",
        ]
    at_sea = results["sea"].summary
    lines += [
        "## At sea",
        "",
        "A boat that turns at random, bearings with 1° of noise, a standoff of 30 m.",
        "",
        "![Paths at sea, with ellipses of what is believed and the standoff](sea-trajectories.png)",
        "",
        "![Range with what is believed of it, errors in per cent of the range, power and energy](sea-range.png)",
        "",
        f"Nearest distance {at_sea['distance_min']:.1f} m, {at_sea['steps_below_standoff']} samples nearer than that, "
        f"error {100.0 * at_sea['relative_error']:.2g} % of the range from {at_sea['track_settling_s']:g} s on.",
        "",
        f"    gbt-ocp run sea2d --set {' '.join(SETTINGS['sea'][1])}",
        "",
        "[At sea](../sea.md) says how it is done.",
        "",
    ]
    torpedo = results["torpedo"].summary
    lines += [
        "## A torpedo",
        "",
        "A LAUV, which steers with fins and must keep moving, follows a slower boat at the same standoff. It weaves, "
        "since a straight line would not tell the range.",
        "",
        "![Paths of torpedo and boat, with ellipses of what is believed and the standoff](torpedo-trajectories.png)",
        "",
        "![Range with what is believed of it, errors in per cent of the range, power and energy](torpedo-range.png)",
        "",
        f"Nearest distance {torpedo['distance_min']:.1f} m, error {100.0 * torpedo['relative_error']:.2g} % of the "
        f"range from {torpedo['track_settling_s']:g} s on.",
        "",
        f"    gbt-ocp run torpedo2d --set {' '.join(SETTINGS['torpedo'][1])}",
        "",
        "[Vehicles, water, commands](../howto/vehicles.md) has the others.",
        "",
        "## A real log",
        "",
        "Bearings of a jet boat by two cameras on a ferry that hardly moves (Autoferry data set, Trondheim, May 2021, "
        "CC0; the log is not part of the package). What is told of the range is little, and the band says so.",
        "",
        "![Track of the boat with ellipses](../figures/log_track.png)",
        "",
        "![Range with its belief, deviation over range, error](../figures/log_range.png)",
        "",
        "    gbt-ocp replay boat_s13_jetboat.csv --bearing-from x",
        "",
        "[Replay a log](../howto/replay.md) says what a log must have.",
        "",
    ]
    lines += ["## Penalty against hard limits", "", "The same run, the thrust limits as the paper's penalty and hard."]
    lines += ["", "| | hard | penalty |", "|---|---|---|"]
    for key, title in _COMPARED.items():
        lines.append(f"| {title} | {results['hard'].summary[key]:.4g} | {results['penalty'].summary[key]:.4g} |")
    for name in ("hard", "penalty"):
        command = f"gbt-ocp run case3 --set {' '.join(SETTINGS[name][1])}"
        lines += ["", f"![Thrust, {name}]({name}-thrust.png)", "", f"    {command}"]
    lines += ["", "[Compare formulations](../howto/formulations.md) does this with statistics.", ""]
    return "\n".join(lines)


def commit() -> str:
    """Version, and the commit where there is one."""
    from gbt_ocp import __version__

    command = ["git", "-C", str(ROOT), "rev-parse", "--short", "HEAD"]
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=True)
    except (OSError, subprocess.CalledProcessError):
        return __version__
    return f"{__version__} ({done.stdout.strip()})"


def command_line_page() -> str:
    """Every ``--help``, in Markdown."""
    from gbt_ocp.cli.parser import parser

    top = parser()
    (commands,) = (action.choices for action in top._actions if isinstance(action.choices, dict))
    lines = ["# Command line", "", "```text", top.format_help().strip(), "```", ""]
    for name, command in commands.items():
        lines += [f"## gbt-ocp {name}", "", "```text", command.format_help().strip(), "```", ""]
    return "\n".join(lines)


if __name__ == "__main__":
    print(make_runs())
