"""The page of an animation: one HTML file that needs no network, with the run's arrays inside."""

from __future__ import annotations

import base64
import html
import json
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gbt_ocp.files import packaged_text
from gbt_ocp.reporting.scene import Scene
from gbt_ocp.simulation.calibration import region_radius

SCRIPTS = ("camera.js", "run.js", "pictures.js", "player.js")
"""Parts of the script, in the order in which they use each other."""


def _text(name: str) -> str:
    return packaged_text("gbt_ocp.reporting", "player", name)


def animation_page(scene: Scene) -> str:
    """The page, complete: markup, style, script and data.

    The script draws on a canvas: the run or the surroundings of the target, in space from any side. Arrays are in
    base64: times and positions as 64-bit floats, since 32 bits lose half a metre of a map coordinate; everything else,
    which is shown with three digits, as 32-bit floats.
    """
    # "</" would end the script element in the middle of a text.
    data = json.dumps(_data(scene), ensure_ascii=False).replace("</", "<\\/")
    page = _text("player.html")
    for mark, text in (
        ("{{title}}", html.escape(scene.title)),
        ("{{style}}", _text("player.css")),
        ("{{data}}", data),
        ("{{script}}", "".join(map(_text, SCRIPTS))),
    ):
        page = page.replace(mark, text)
    return page


def _data(scene: Scene) -> dict[str, Any]:
    history = scene.history
    d = history.dimension
    words, status = np.unique(history.solver_status, return_inverse=True)
    low, high = scene.corners()
    rows, columns = np.triu_indices(d)
    return {
        "title": scene.title,
        "dimension": d,
        "steps": len(history.t),
        "times": history.forecast_mean.shape[1],
        "pieces": history.plan.shape[1],
        "speed": scene.speed,
        "radius": region_radius(d),
        "closeUp": scene.close_up(),
        "low": low.tolist(),
        "high": high.tolist(),
        "statusWords": [str(word) for word in words],
        "fallback": [str(word) for word in history.fallback],
        "arrays": {
            "t": _packed(history.t, 64),
            "target": _packed(history.target, 64),
            "vehicle": _packed(scene.vehicle, 64),
            "yaw": _packed(history.vehicle_pose[:, d]),
            "bearing": _packed(history.bearing),
            "mean": _packed(history.forecast_mean, 64),
            # xx, xy, yy in the plane; xx, xy, xz, yy, yz, zz in space
            "covariance": _packed(history.forecast_cov[:, :, rows, columns]),
            "plan": _packed(scene.plan, 64),
            "error": _packed(history.error),
            "meanError": _packed(history.mean_error),
            "distance": _packed(scene.distance),
            "condition": _packed(history.condition_number),
            "solverTime": _packed(1e3 * history.solver_time),
            "status": _packed(status),
        },
    }


def _packed(values: NDArray[Any], bits: int = 32) -> tuple[int, str]:
    """Size of a float, and the floats in base64."""
    data = np.ascontiguousarray(values, dtype=f"<f{bits // 8}").tobytes()
    return bits, base64.b64encode(data).decode("ascii")
