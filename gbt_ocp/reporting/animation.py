"""``gbt-ocp animate``: a run folder as a moving picture (GIF, MP4) or as a page to play with (HTML)."""

from __future__ import annotations

import os
import shutil
import subprocess
from collections.abc import Iterable, Iterator
from contextlib import suppress
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import PolyCollection
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from PIL import Image

from gbt_ocp.files import whole_file
from gbt_ocp.reporting import style
from gbt_ocp.reporting.animation_page import animation_page
from gbt_ocp.reporting.scene import Scene, outline
from gbt_ocp.typing import Array

KINDS = (".gif", ".mp4", ".html")

MOST_FRAMES = 600
"""A longer run is thinned out to so many frames of a GIF or MP4; the page keeps every step."""

_DPI = 100
_NAMES = "xyz"


def write_animation(run_dir: str | os.PathLike[str], out: str | os.PathLike[str]) -> Path:
    """Write the animation of a run folder, in the format that the ending of the name says.

    Parameters
    ----------
    run_dir
        A run folder; its ``config.yaml``, ``history.npz`` and ``summary.json`` are read.
    out
        A file that ends in ``.gif``, ``.mp4`` (needs ffmpeg) or ``.html``; it is replaced if it is there.

    Raises
    ------
    FileNotFoundError
        If a file of the run folder is missing.
    ValueError
        If one is damaged, the ending is another, or ffmpeg is needed and not installed.
    """
    target = Path(out)
    kind = target.suffix.lower()
    if kind not in KINDS:
        raise ValueError(f"found {target}; allowed: a name that ends in {', '.join(KINDS)}")
    if kind == ".mp4" and shutil.which("ffmpeg") is None:
        raise ValueError(f"found {target}, which needs ffmpeg, and ffmpeg is not installed; allowed: .gif, .html")
    scene = Scene.load(run_dir)
    with whole_file(target) as temporary:
        if kind == ".html":
            temporary.write_text(animation_page(scene), encoding="utf-8")
        else:
            _film(scene, temporary, kind)
    return target


def _film(scene: Scene, out: Path, kind: str) -> None:
    count = len(scene.history.t)
    frames = range(0, count, -(-count // MOST_FRAMES))
    with style.styled():
        pictures = Drawing(scene).pictures(frames)
        if kind == ".gif":
            _write_gif(pictures, out, scene.frames_a_second)
        else:
            _write_mp4(pictures, out, scene.frames_a_second)


def _write_gif(pictures: Iterator[Image.Image], out: Path, rate: float) -> None:
    # One palette for all: the pictures have the same few colours, and parts that do not move take no space.
    palette = _palette()
    indexed = (picture.quantize(palette=palette, dither=Image.Dither.NONE) for picture in pictures)
    next(indexed).save(out, save_all=True, append_images=indexed, duration=round(1000.0 / rate), loop=0)


def _palette() -> Image.Image:
    """The colours of a picture, each in steps down to white, as smoothed edges and translucent regions have them."""
    colours = [style.BLACK, style.GREY, style.BLUE, style.GREEN, style.VERMILLION]
    steps = np.linspace(1.0, 0.0, 20)[:, None]
    shades = [255.0 * (steps * np.array(to_rgb(colour)) + 1.0 - steps) for colour in colours]
    # against black as well: trails cross
    shades += [255.0 * steps[:10] * np.array(to_rgb(colour)) for colour in colours[2:]]
    palette = Image.new("P", (1, 1))
    palette.putpalette(np.concatenate(shades).round().astype(int).ravel().tolist())
    return palette


def _write_mp4(pictures: Iterator[Image.Image], out: Path, rate: float) -> None:
    first = next(pictures)
    width, height = first.size
    command = ["ffmpeg", "-loglevel", "error", "-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{width}x{height}"]
    command += ["-r", f"{rate:g}", "-i", "-", "-pix_fmt", "yuv420p", "-crf", "20", "-movflags", "+faststart", str(out)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stderr=subprocess.PIPE) as ffmpeg:
        assert ffmpeg.stdin is not None
        assert ffmpeg.stderr is not None
        with suppress(BrokenPipeError):  # its message is read below
            for picture in chain([first], pictures):
                ffmpeg.stdin.write(picture.tobytes())
            ffmpeg.stdin.close()
        said = ffmpeg.stderr.read().decode(errors="replace").strip()
    if ffmpeg.returncode != 0:
        raise RuntimeError(f"ffmpeg ended with {ffmpeg.returncode}: {said}")


class Drawing:
    """The figure of one frame: the run on the left, the target's surroundings on the right.

    In space the upper row is seen from above, the lower one from the side.
    """

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        views = [(0, 1)] if scene.history.dimension == 2 else [(0, 1), (0, 2)]
        # Both sides are even in pixels, as video codecs need it.
        self.figure = Figure(figsize=(7.2, 4.0 if len(views) == 1 else 7.2), dpi=_DPI, layout="constrained")
        self.canvas: Any = FigureCanvasAgg(self.figure)  # typed in part only
        grid = self.figure.subplots(len(views), 2, squeeze=False)
        half = scene.close_up()
        low, high = scene.corners()
        self.panels: list[_Panel] = []
        for row, axes in enumerate(views):
            full, near = grid[row]
            _frame_run(full, low, high, axes)
            _frame_near(near, half, axes)
            self.panels += [_Panel(full, scene, axes, follow=False), _Panel(near, scene, axes, follow=True)]
        handles, labels = grid[0][0].get_legend_handles_labels()
        self.figure.legend(handles, labels, loc="outside lower center", ncols=5)
        self.caption = self.figure.suptitle(" ", fontsize=9.0, family="monospace")
        self.moving = [artist for panel in self.panels for artist in panel.artists] + [self.caption]

    def pictures(self, frames: Iterable[int]) -> Iterator[Image.Image]:
        """Pictures of these samples. Axes and labels are drawn once, and what moves is drawn over a copy of them."""
        for artist in self.moving:
            artist.set_animated(True)
        self.canvas.draw()
        self.figure.set_layout_engine("none")
        self.canvas.draw()
        still = self.canvas.copy_from_bbox(self.figure.bbox)
        renderer = self.canvas.get_renderer()
        for frame in frames:
            self.show(frame)
            self.canvas.restore_region(still)
            for artist in self.moving:
                artist.draw(renderer)
            yield Image.fromarray(np.asarray(self.canvas.buffer_rgba())[..., :3].copy())

    def show(self, frame: int) -> None:
        """Move everything to its place at sample ``frame``."""
        for panel in self.panels:
            panel.show(frame)
        history = self.scene.history
        self.caption.set_text(
            f"{self.scene.title}   t = {history.t[frame]:6.2f} s   error {history.mean_error[frame]:8.2g} m   "
            f"range {self.scene.distance[frame]:7.3g} m"
        )


class _Panel:
    """One view of the scene, with artists that move from frame to frame."""

    def __init__(self, axes: Axes, scene: Scene, seen: tuple[int, int], *, follow: bool) -> None:
        self.scene, self.seen, self.follow = scene, seen, follow
        self.reach = 4.0 * max(float(np.ptp(axes.get_xlim())), float(np.ptp(axes.get_ylim())))
        self.target = scene.history.target[:, seen]
        self.vehicle = scene.vehicle[:, seen]
        (self.bearing,) = axes.plot([], [], color=style.GREY, linestyle=":", linewidth=1.0, label="bearing")
        (self.vehicle_trail,) = axes.plot([], [], color=style.BLUE, linewidth=1.0, label="vehicle")
        (self.target_trail,) = axes.plot([], [], color=style.BLACK, linestyle="--", linewidth=1.3, label="target")
        (self.plan,) = axes.plot([], [], color=style.GREEN, marker=".", markersize=3.5, linewidth=0.9, label="plan")
        (self.mean,) = axes.plot(
            [], [], color=style.VERMILLION, marker=".", markersize=4.0, linewidth=0.8, label="forecast, 95 %"
        )
        self.regions = PolyCollection(
            [], facecolor=style.VERMILLION, edgecolor=style.VERMILLION, alpha=0.25, linewidth=0.7
        )
        axes.add_collection(self.regions)
        (self.vehicle_now,) = axes.plot([], [], color=style.BLUE, marker="o", markersize=6.0)
        (self.target_now,) = axes.plot([], [], color=style.BLACK, marker="s", markersize=5.0)
        # in the order in which they are drawn
        self.artists: list[Artist] = [self.bearing, self.target_trail, self.vehicle_trail, self.regions, self.plan]
        self.artists += [self.mean, self.vehicle_now, self.target_now]

    def show(self, frame: int) -> None:
        scene, seen = self.scene, list(self.seen)
        history = scene.history
        origin = self.target[frame] if self.follow else np.zeros(2)
        now = slice(frame, frame + 1)
        for line, points in (
            (self.target_trail, self.target[: frame + 1]),
            (self.vehicle_trail, self.vehicle[: frame + 1]),
            (self.target_now, self.target[now]),
            (self.vehicle_now, self.vehicle[now]),
            (self.plan, scene.plan[frame][:, seen] if scene.plan.shape[1] > 1 else np.zeros((0, 2))),
            (self.mean, history.forecast_mean[frame][:, seen]),
            (self.bearing, self._ray(frame)),
        ):
            line.set_data(*(points - origin).T)
        centres = history.forecast_mean[frame][:, seen] - origin
        shapes = [
            centre + outline(covariance, self.seen)
            for centre, covariance in zip(centres, history.forecast_cov[frame], strict=True)
        ]
        self.regions.set_verts([shape for shape in shapes if np.isfinite(shape).all()])

    def _ray(self, frame: int) -> Array:
        """The measured bearing, drawn beyond the view since it says nothing of the range. Empty where it was missed."""
        direction = self.scene.history.bearing[frame][list(self.seen)]
        length = float(np.linalg.norm(direction))
        if not np.isfinite(length) or length == 0.0:
            return np.zeros((0, 2))
        start = self.vehicle[frame]
        return np.stack([start, start + self.reach * direction / length])


def _frame_run(axes: Axes, low: Array, high: Array, seen: tuple[int, int]) -> None:
    """A square view of the run."""
    middle, half = 0.5 * (low + high), 0.5 * float(np.max(high - low))
    _frame(axes, (middle[seen[0]], middle[seen[1]]), half)
    axes.set_xlabel(f"{_NAMES[seen[0]]} [m]")
    axes.set_ylabel(f"{_NAMES[seen[1]]} [m]")


def _frame_near(axes: Axes, half: float, seen: tuple[int, int]) -> None:
    _frame(axes, (0.0, 0.0), half)
    axes.set_xlabel(f"{_NAMES[seen[0]]} from the target [m]")
    axes.set_ylabel(f"{_NAMES[seen[1]]} from the target [m]")


def _frame(axes: Axes, middle: tuple[Any, Any], half: float) -> None:
    axes.set_xlim(middle[0] - half, middle[0] + half)
    axes.set_ylim(middle[1] - half, middle[1] + half)
    axes.set_aspect("equal", adjustable="box")
