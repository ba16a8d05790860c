"""What all pictures share: colours, layout, and how a drawing suits a page."""

from __future__ import annotations

import io
from contextlib import AbstractContextManager
from typing import Any

import matplotlib
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Figure

from icub_jump_env.control.config import ControllerName

INK = "#24303c"
MEASURED, DESIRED, ACCENT = "#1f6f8b", "#d1495b", "#8d99ae"
"""Of curves: what happened, what was wanted, and what stands beside them."""

CONTROLLER: dict[ControllerName, str] = {"velocity": MEASURED, "torque": DESIRED}
CONTENDERS = ("0.35", "#0072b2", "#e69f00", "#009e73", "#d55e00", "#cc79a7")
"""Of those that are compared, in their order; the first one is the baseline. The others are of Okabe and
Ito's palette, which readers who see fewer colours tell apart."""

PAGE = {
    "ink": (INK, INK, "#d5dde5"),
    "measured": (MEASURED, MEASURED, "#5cb8d6"),
    "desired": (DESIRED, "#c03648", "#f4818d"),
    "accent": (ACCENT, "#5d6b82", "#97a6bd"),
}
"""Colours as drawn, on a light page, on a dark page. Text of these colours has a contrast of at
least 4.5 to the page."""

DPI = 150
NOT_FROM_ZERO = ", not from 0"
"""At an axis."""

_ON_A_PAGE: dict[Any, Any] = {
    **dict.fromkeys(("text.color", "axes.labelcolor", "axes.edgecolor"), INK),
    **dict.fromkeys(("xtick.color", "ytick.color"), INK),
    "svg.fonttype": "path",  # looks alike whatever fonts the reader has
    "svg.hashsalt": "icub-jump",  # the same jump makes the same page
}


def figure_of(size: tuple[float, float]) -> Figure:
    """An empty figure (inches)."""
    return Figure(figsize=size, dpi=DPI, layout="constrained")


def panels(
    size: tuple[float, float], rows: int = 1, columns: int = 1, **layout: Any
) -> tuple[Figure, Any]:
    """A figure and its axes, (rows, columns)."""
    figure = figure_of(size)
    with matplotlib.rc_context({"axes.spines.top": False, "axes.spines.right": False}):
        return figure, figure.subplots(rows, columns, squeeze=False, **layout)


def describe(axis: Axes, title: str, unit: str, abscissa: str = "time (s)") -> None:
    """Name what a panel shows."""
    axis.set_title(title, fontsize=10)
    axis.set(xlabel=abscissa, ylabel=unit)


def mark_takeoff(axis: Axes, time: float, label: str | None = None) -> None:
    """Draw a line at a time (s), under a name for the legend."""
    axis.axvline(time, color=ACCENT, lw=0.8, ls=":", label=label)


def name_origins(figure: Figure) -> Figure:
    """Say at each named axis that leaves out zero that it does."""
    for axis in figure.axes:
        for one in (axis.xaxis, axis.yaxis):
            label, (low, high) = one.get_label_text(), sorted(one.get_view_interval())
            if label and not low <= 0.0 <= high and not label.endswith(NOT_FROM_ZERO):
                one.set_label_text(f"{label}{NOT_FROM_ZERO}")
    return figure


def on_a_page() -> AbstractContextManager[None]:
    """Figures drawn meanwhile suit :func:`svg`."""
    return matplotlib.rc_context(_ON_A_PAGE)


def page_colors() -> str:
    """CSS that defines a variable for each colour of :data:`PAGE`, as the page's scheme wants."""
    light, dark = (
        ":root{" + ";".join(f"--{name}:{colors[scheme]}" for name, colors in PAGE.items()) + "}"
        for scheme in (1, 2)
    )
    return f"{light}@media(prefers-color-scheme:dark){{{dark}}}"


def svg(figure: Figure) -> tuple[bytes, int, int]:
    """A drawing that takes on the colour scheme of the page around it.

    Returns:
        The drawing, its width and its height (CSS pixels).
    """
    buffer = io.StringIO()
    nothing = dict.fromkeys(("Creator", "Date", "Format", "Type"))
    name_origins(figure).savefig(buffer, format="svg", transparent=True, metadata=nothing)
    drawing = buffer.getvalue()
    for name, (drawn, *_) in PAGE.items():
        drawing = drawing.replace(drawn, f"var(--{name})")
    drawing = drawing.replace("<defs>", f"<defs><style>{page_colors()}</style>", 1)
    width, height = (round(96 * inches) for inches in figure.get_size_inches())
    return drawing.encode(), width, height
