"""A ROS 2 package around the C of a pilot."""

from __future__ import annotations

import re
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path
from xml.sax.saxutils import escape

from gbt_ocp.files import packaged_text, whole_folder
from gbt_ocp.ocp.export.folder import write_texts
from gbt_ocp.pilot.pilot_parts import PilotParts

PILOT_FOLDER = "pilot"
"""Where the C stands in the package."""

_WHERE = {
    "package.xml": "package.xml",
    "CMakeLists.txt": "CMakeLists.txt",
    "README.md": "README.md",
    "parameters.yaml": "config/gbt_pilot.yaml",
    "gbt_pilot_node.hpp": "src/gbt_pilot_node.hpp",
    "gbt_attitude.hpp": "src/gbt_attitude.hpp",
    "gbt_pilot_node.cpp": "src/gbt_pilot_node.cpp",
}
"""Files that travel with the package of Python, and where they stand in that of ROS."""


def write_ros_package(
    folder: str | Path, parts: PilotParts, name: str, prefix: str, write_pilot: Callable[[Path], object]
) -> Path:
    """Write a package of ROS 2, completely or not at all.

    Parameters
    ----------
    folder
        A new or empty folder.
    parts
        What the pilot is made of.
    name
        Of the configuration, for the texts.
    prefix
        Of all names, that of the package and of the node included; see :func:`gbt_ocp.ocp.export.names.prefixed`.
    write_pilot
        Writes the C of the pilot into a new folder, with the same prefix.

    Raises
    ------
    ValueError
        If the inputs of the vehicle are not a force along each axis and a moment about z.
    FileExistsError
        If the folder exists and is not empty.
    """
    inputs, dimension = len(parts.vehicle.thrust_max), parts.vehicle.position_dimension
    if inputs != dimension + 1:
        raise ValueError(f"--ros2: vehicle: found {inputs} inputs; allowed: {dimension} forces and a moment about z")
    lead = parts.period if parts.lead is None else parts.lead
    marks = {
        "@VERSION@": ".".join(re.findall(r"\d+", version("gbt_ocp"))[:3]),
        "@PERIOD@": repr(float(parts.period)),
        "@LEAD@": f"{lead:g}",
        "@DIMENSION@": str(dimension),
    }
    with whole_folder(folder) as draft:
        write_pilot(draft / PILOT_FOLDER)
        texts = {place: packaged_text("gbt_ocp.pilot", "ros2", file) for file, place in _WHERE.items()}
        for place, text in texts.items():
            for mark, value in marks.items():
                text = text.replace(mark, value)
            texts[place] = text.replace("@CONFIG@", escape(name) if place == "package.xml" else name)
        write_texts(draft, texts, prefix)
    return Path(folder)
