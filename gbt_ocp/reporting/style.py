"""The look of all figures: legible in print, for colour-blind readers and in grey."""

from __future__ import annotations

from typing import Any

from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

# Okabe and Ito, "Color Universal Design" (2008).
BLACK = "#000000"
ORANGE = "#E69F00"
SKY = "#56B4E9"
GREEN = "#009E73"
BLUE = "#0072B2"
VERMILLION = "#D55E00"
PURPLE = "#CC79A7"
GREY = "#7F7F7F"

CURVES: tuple[tuple[str, Any], ...] = (
    (BLUE, "-"),
    (VERMILLION, "--"),
    (GREEN, "-."),
    (ORANGE, ":"),
    (PURPLE, (0, (5, 1, 1, 1, 1, 1))),
    (SKY, (0, (8, 2))),
    (BLACK, (0, (1, 1))),
    (GREY, "-"),
)
"""Colour and dashes of the curves in a figure, in their order."""

DPI = 200
WIDTH = 6.3
"""Inches: the text width of an A4 page, so that the type is printed at its own size."""

_STYLE: Any = {  # matplotlib types the keys one by one
    "font.family": "sans-serif",
    "font.size": 9.0,
    "axes.labelsize": 9.0,
    "axes.titlesize": 9.0,
    "xtick.labelsize": 8.0,
    "ytick.labelsize": 8.0,
    "legend.fontsize": 8.0,
    "legend.frameon": False,
    "legend.handlelength": 2.6,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.linewidth": 0.7,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#DDDDDD",
    "grid.linewidth": 0.5,
    "lines.linewidth": 1.2,
    "lines.markersize": 4.0,
    "text.usetex": False,
}


def styled() -> Any:
    """Context in which figures have this style; at its end the caller's settings are back."""
    return rc_context(_STYLE)


def new_figure(height: float) -> Figure:
    """Figure of the text width and the given height in inches, drawn by Agg without pyplot."""
    # Room at the sides for the half of the last tick label outside the axes.
    figure = Figure(figsize=(WIDTH, height), layout=ConstrainedLayoutEngine(w_pad=0.08, h_pad=0.05))
    FigureCanvasAgg(figure)
    return figure


def legend_above(figure: Figure, axes: Axes, columns: int) -> None:
    """Legend above the plot, where it covers nothing; each label once."""
    handles, labels = axes.get_legend_handles_labels()
    first = dict(zip(reversed(labels), reversed(handles), strict=True))
    ordered = list(dict.fromkeys(labels))
    figure.legend([first[label] for label in ordered], ordered, loc="outside upper center", ncols=columns)


def time_axis(axes: Axes, t_end: float) -> None:
    """Label the time axis and close it at the ends of the run."""
    axes.set_xlabel("time [s]")
    axes.set_xlim(0.0, t_end if t_end > 0.0 else 1.0)


def plain_log_ticks(axis: Axis) -> None:
    """Ticks 1, 2, 5, 10 in plain numbers on a logarithmic axis, where one decade has no more than two powers of ten."""
    axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_formatter(NullFormatter())
