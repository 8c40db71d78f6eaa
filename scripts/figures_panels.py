# SPDX-License-Identifier: GPL-3.0-or-later
"""What the drawings of figures share: sheets of panels with a legend below them, axes, points with
intervals. Needs matplotlib."""
import io
import math
import pathlib

from whole_output import naming

COLUMN, PAGE = 3.4, 7.0  # widths of paper columns, in
MARKERS = "osD^vPX*"
COLOURS = ["#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000"]
LEGEND_ROW = 0.17  # in


def load_pyplot():
    import matplotlib
    matplotlib.use("Agg")
    from matplotlib import pyplot
    pyplot.style.use(pathlib.Path(__file__).with_name("figures.mplstyle"))
    return pyplot


def save(figure, folder, stem):
    """Writes a figure as PDF and PNG and closes it; returns the names of both. It is drawn in
    memory, so that a full disk is nothing that matplotlib has to deal with."""
    from matplotlib import pyplot
    for ending, options in (("pdf", {"metadata": {"CreationDate": None}}), ("png", {})):
        drawn = io.BytesIO()
        figure.savefig(drawn, format=ending, **options)
        path = folder / f"{stem}.{ending}"
        with naming(path):
            path.write_bytes(drawn.getvalue())
    pyplot.close(figure)
    return [f"{stem}.pdf", f"{stem}.png"]


def pretty(name):
    scene, _, part = name.partition("/scene_")
    return f"{scene} {part}".replace("_", " ").strip()


def colour(i):
    return COLOURS[i % len(COLOURS)]


def shades(pyplot, n):
    """n colours of an ordered quantity, dark to light, none too light on white."""
    return [pyplot.get_cmap("cividis")(0.02 + 0.83 * i / max(1, n - 1)) for i in range(n)]


class Sheet:
    """A figure of panels with room for a legend of `labels` below them, and `more` inches for long
    labels of the last row's ticks."""

    def __init__(self, pyplot, rows, columns, row_height, labels=(), width=None, more=0.0,
                 **options):
        self.width = width or (COLUMN if columns == 1 else PAGE)
        entries = [0.42 + 0.062 * len(label) for label in labels]
        fitting = len(labels) if sum(entries) < self.width else int(self.width / max(entries))
        self.legend_columns = max(1, fitting)
        lines = math.ceil(len(labels) / self.legend_columns)
        below = LEGEND_ROW * lines + 0.06 if lines else 0
        height = rows * row_height + more + below
        self.figure, self.panels = pyplot.subplots(
            rows, columns, figsize=(self.width, height), squeeze=False, **options)
        self.figure.get_layout_engine().set(rect=(0, below / height, 1, 1 - below / height))

    def flat(self, used):
        """The first panels in reading order; the others are left blank."""
        panels = [p for row in self.panels for p in row]
        for panel in panels[used:]:
            panel.remove()
        return panels[:used]

    def legend(self, handles, labels):
        self.figure.legend(handles, labels, loc="lower center", ncol=self.legend_columns,
                           borderaxespad=0.2)


def crowded(labels, width):
    """Whether labels of a panel `width` inches wide would touch when written side by side."""
    longest = max(len(line) for label in labels for line in label.split("\n"))
    return 0.072 * longest > 0.8 * width / len(labels)


def name_places(panel, labels, width):
    """Names of places 0, 1, ... below a panel: across, or leaning where they are crowded."""
    lean = crowded(labels, width)
    options = {"rotation": 45, "ha": "right", "rotation_mode": "anchor"} if lean else {}
    if lean:
        labels = [label.replace("\n", ", ") for label in labels]
    panel.set_xticks(range(len(labels)), labels, fontsize=8, **options)
    panel.set_xlim(-0.55, len(labels) - 0.45)


def room_for_places(labels, width):
    """Inches that name_places() wants beyond a line of text."""
    if not crowded(labels, width):
        return 0.0
    return 0.05 * max(len(label) for label in labels)


def grid_of(count, most=3):
    """Rows and columns for so many panels, with as few blank ones as the rows allow."""
    rows = math.ceil(count / most)
    return rows, math.ceil(count / rows)


def errors_of(points):
    """What errorbar wants; None where no point has two seeds."""
    if not any(p["seeds"] > 1 for p in points):
        return None
    return [[max(0, p["value"] - p["low"]) for p in points],
            [max(0, p["high"] - p["value"]) for p in points]]


def draw_points(panel, xs, points, line=True, **style):
    """Points with their intervals; returns the handle for a legend."""
    style.setdefault("linestyle", "-" if line else "")
    return panel.errorbar(xs, [p["value"] for p in points], yerr=errors_of(points),
                          elinewidth=0.8, **style)


def bounds_of(rows):
    return [v for r in rows for v in (r["value"], r["low"], r["high"]) if v is not None]


def short(value, plain):
    """A tick's label: 0.02, 300; where not all of an axis are `plain` 10^-5."""
    if value == 0 or plain or value == 1:
        return f"{value:,.10g}"
    exponent = math.floor(math.log10(abs(value)) + 1e-9)
    mantissa = value / 10 ** exponent
    if abs(mantissa - 1) < 1e-6:
        return f"$10^{{{exponent}}}$"
    return f"${mantissa:.3g}\\!\\cdot\\!10^{{{exponent}}}$"


def ratio_axis(axis, values, margin=1.25, smallest=0.0):
    """A logarithmic axis for these values, with few, short labels. With zeros among them it is
    linear below the least that is not zero; so it is below `smallest`, where values count as
    zero."""
    from matplotlib import ticker
    panel, name = axis.axes, axis.axis_name
    positive = [v for v in values if v > smallest]
    set_scale = panel.set_xscale if name == "x" else panel.set_yscale
    set_limits = panel.set_xlim if name == "x" else panel.set_ylim
    if not positive:  # all of it is zero
        set_limits(-0.1, 1)
        axis.set_major_locator(ticker.FixedLocator([0]))
        return
    least, most = min(positive), max(positive)
    margin = max(margin, (most / least) ** 0.05)
    zeros = len(positive) < len(values)
    if zeros:
        least = 10 ** math.floor(math.log10(least))
        set_scale("symlog", linthresh=least, linscale=0.5)
        set_limits(-0.25 * least, most * margin)
        ticks = [0] + decades(least, most * margin)
    else:
        low, high = least / margin, most * margin
        if high / low < 4:  # half a decade at least
            low, high = math.sqrt(low * high) / 2, math.sqrt(low * high) * 2
        set_scale("log")
        set_limits(low, high)
        ticks = log_ticks(low, high)
    while len(ticks) > 5:
        ticks = ([0] if zeros else []) + [t for t in ticks if t != 0][::2]
    axis.set_major_locator(ticker.FixedLocator(ticks))
    plain = reads_plain(ticks)
    axis.set_major_formatter(ticker.FuncFormatter(lambda v, _: short(v, plain)))
    minor = [m for m in decades(least / 10, most * 10, range(1, 10))]
    axis.set_minor_locator(ticker.FixedLocator(minor))
    axis.set_minor_formatter(ticker.NullFormatter())


def decades(low, high, subs=(1,)):
    first, last = math.floor(math.log10(low)) - 1, math.ceil(math.log10(high)) + 1
    ticks = [s * 10.0 ** e for e in range(first, last + 1) for s in subs]
    return [float(f"{t:.6g}") for t in ticks if low * 0.999999 <= t <= high * 1.000001]


def log_ticks(low, high):
    """Round values, three where there is room for three."""
    for subs in ((1,), (1, 3), (1, 2, 5), (1, 2, 3, 5, 7), range(1, 10)):
        ticks = decades(low, high, subs)
        if len(ticks) >= 3:
            break
    return ticks


def reads_plain(ticks):
    return all(t == 0 or 0.00099 < t < 1e5 for t in ticks)


def color_bar(figure, image, panels):
    """The bar of a map, labelled as a logarithmic axis where its norm is one."""
    from matplotlib import colors, ticker
    bar = figure.colorbar(image, ax=panels, pad=0.02, aspect=14)
    if isinstance(image.norm, colors.LogNorm):
        ticks = log_ticks(image.norm.vmin, image.norm.vmax)
        while len(ticks) > 5:
            ticks = ticks[::2]
        bar.set_ticks(ticks, labels=[short(t, reads_plain(ticks)) for t in ticks])
        bar.ax.yaxis.set_minor_formatter(ticker.NullFormatter())
    return bar


def powers_of_two(low, high):
    first, last = math.ceil(math.log2(low)), math.floor(math.log2(high))
    return [2.0 ** e for e in range(first, last + 1)]


def stored_axis(axis, rows, most):
    """For numbers of probes stored, which are hardly ever round."""
    stored = [r["stored"] for r in rows]
    low, high = min(stored) / 1.25, max(stored) * 1.25
    count_axis(axis, powers_of_two(low, high) or stored, most)
    axis.axes.set_xlim(low, high)


def count_axis(axis, values, most=4):
    """A logarithmic axis whose labels are among the values themselves (powers of two, say)."""
    from matplotlib import ticker
    panel, name = axis.axes, axis.axis_name
    values = sorted(set(values))
    (panel.set_xscale if name == "x" else panel.set_yscale)("log", base=2)
    step = max(1, math.ceil(len(values) / most))
    axis.set_major_locator(ticker.FixedLocator(values[(len(values) - 1) % step::step]))
    axis.set_major_formatter(ticker.FuncFormatter(lambda v, _: f"{v:,.10g}"))
    axis.set_minor_locator(ticker.FixedLocator(values))
    axis.set_minor_formatter(ticker.NullFormatter())
    low, high = values[0] / 1.25, values[-1] * 1.25
    (panel.set_xlim if name == "x" else panel.set_ylim)(low, high)


def floor_lines(panel, xs, rows):
    """The noise floor at each place where it is not zero; returns a handle or None."""
    handle = None
    for x, row in zip(xs, rows):
        if row.get("floor"):
            handle = panel.hlines(row["floor"], *x, color="black", linewidth=0.9, linestyle=":")
    return handle


def end_labels(panel, labels, gap=0.1):
    """Texts to the right of the panel for (y, text, colour), moved apart; after limits are set."""
    to_axes = panel.transData + panel.transAxes.inverted()
    x = panel.get_xlim()[1]
    placed = sorted([to_axes.transform((x, y))[1], text, c] for y, text, c in labels)
    for first, second in zip(placed, placed[1:]):
        second[0] = max(second[0], first[0] + gap)
    for i, label in enumerate(reversed(placed)):
        label[0] = min(label[0], 1.0 - gap * i)
    for y, text, c in placed:
        panel.text(1.02, y, text, transform=panel.transAxes, color=c, fontsize=7, va="center")
