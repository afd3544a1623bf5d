"""The few kinds of picture the experiments draw, in one style."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

COLOURS = {"paper": "#d1495b", "likelihood": "#2e86ab", "ransac": "#e0a100", "published": "#7f8c9b"}
MORE_COLOURS = ("#2a9d5c", "#7b3fa0", "#f08a4b", "#5fc3e4")


def make_figure(columns: int = 1, rows: int = 1, width: float = 5.0, height: float = 3.4):
    """Return a figure without a window, and its axes as a flat list."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(columns * width, rows * height), layout="constrained")
    axes = figure.subplots(rows, columns, squeeze=False).ravel()
    for axis in axes:
        axis.spines[["top", "right"]].set_visible(False)
        axis.grid(alpha=0.25)
    return figure, list(axes)


def choose_colour(name: str, index: int) -> str:
    return COLOURS.get(name, MORE_COLOURS[index % len(MORE_COLOURS)])


def draw_grouped_bars(
    groups: Sequence[str], series: dict[str, Sequence[float]], label: str, log: bool = False
):
    """Draw a bar a series within each group.

    NaN and None leave a gap.
    """
    figure, (axis,) = make_figure(width=max(5.0, 0.9 * len(groups)))
    width = 0.8 / len(series)
    for i, (name, values) in enumerate(series.items()):
        heights = np.array([np.nan if value is None else value for value in values], float)
        axis.bar(
            np.arange(len(groups)) + (i + 0.5) * width - 0.4,
            heights,
            width,
            label=name,
            color=choose_colour(name, i),
        )
    axis.set_xticks(np.arange(len(groups)), groups, rotation=30, ha="right")
    axis.set_ylabel(label)
    if log:
        axis.set_yscale("log")
    axis.legend()
    return figure


def draw_curves(
    panels: dict[str, tuple[Sequence[float], dict[str, Sequence[float]]]],
    label: str,
    log: bool = False,
):
    """Draw a panel a name: x values and a line a series."""
    columns = min(3, len(panels))
    figure, axes = make_figure(columns, -(-len(panels) // columns), 4.2, 3.2)
    for axis in axes[len(panels) :]:
        axis.set_visible(False)
    for axis, (title, (x, series)) in zip(axes, panels.items(), strict=False):
        for i, (name, values) in enumerate(series.items()):
            y = np.array([np.nan if value is None else value for value in values], float)
            axis.plot(range(len(x)), y, "o-", label=name, color=choose_colour(name, i))
        axis.set_xticks(
            range(len(x)), [f"{value:g}" if isinstance(value, float) else str(value) for value in x]
        )
        axis.set_title(title, fontsize=10)
        axis.set_ylabel(label)
        if log:
            axis.set_yscale("log")
    axes[0].legend()
    return figure


def draw_distributions(values: dict[str, np.ndarray], label: str, top: float):
    """Draw histograms over each other, and their cumulated shares.

    Both go up to `top`.
    """
    figure, (left, right) = make_figure(2)
    bins = np.linspace(0, top, 41)
    for i, (name, numbers) in enumerate(values.items()):
        numbers = np.asarray(numbers, float)
        numbers = numbers[np.isfinite(numbers)]
        colour = choose_colour(name, i)
        shares = np.full(len(numbers), 1 / max(len(numbers), 1))
        left.hist(
            np.clip(numbers, 0, top),
            bins,
            weights=shares,
            histtype="step",
            color=colour,
            label=name,
            linewidth=1.6,
        )
        right.plot(np.sort(numbers), np.linspace(0, 1, len(numbers)), color=colour, label=name)
    right.set_xlim(0, top)
    for axis in (left, right):
        axis.set_xlabel(label)
    left.set_ylabel("share of roofs")
    right.set_ylabel("share of roofs at or below")
    left.legend()
    return figure
