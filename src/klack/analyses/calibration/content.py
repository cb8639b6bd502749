"""Content of the report of a calibration."""

from collections.abc import Iterable, Sequence
from math import isfinite
from textwrap import fill
from typing import Any

import numpy as np
import scipy
from matplotlib import rc_context
from matplotlib.figure import Figure
from numpy.typing import NDArray

from klack.analyses.calibration.record import (
    BOUNDS,
    CALIBRATION_MEASURES,
    FITTED_MEASURES,
    INTERVAL,
    SCATTER,
    STANDARD_ERROR,
    START,
    VALUE,
    CalibratedParameter,
    CalibrationStudy,
    FittedChannel,
    ProfileCurve,
)
from klack.analyses.measures import glossary, page_cells, page_heads
from klack.analyses.page import page_of
from klack.measurement.fit_window import FitWindow
from klack.report.chart import AxisSpec, Band, Chart, Curve, Mark, Panel
from klack.report.looks import thinned
from klack.report.page import Content, Picture, Section, Table
from klack.report.printed import STYLE, plain, svg
from klack.report.wording import listed, printed_unit, quantity

__all__ = ["calibration_content", "stroke_chart"]


_WIDTH = 6.7  # [in], text of an A4 page

_SIDE_BY_SIDE = 6
"""Parameters of two matrices whose numbers fit beside each other."""
_TITLE_LETTERS = 36


def correlation_figure(
    names: Sequence[str],
    matrices: Sequence[tuple[str, NDArray[np.float64]]],
    note: str,
) -> Picture:
    """Draw correlation matrices (p, p) side by side; every field carries its number."""
    count = len(names)
    stacked = count > _SIDE_BY_SIDE
    height = (0.9 + min(0.42 * count, 2.8)) * (len(matrices) if stacked else 1)
    with rc_context(STYLE | {"axes.grid": False}):
        figure = Figure(figsize=(_WIDTH, height), layout="constrained")
        shape = (len(matrices), 1) if stacked else (1, len(matrices))
        grid = figure.subplots(*shape, squeeze=False).ravel()
        for k, (axes, (title, matrix)) in enumerate(zip(grid, matrices, strict=True)):
            named = stacked or k == 0
            _draw(axes, names if named else [""] * count, names, title, matrix)
        return Picture(image=svg(figure), note=note)


def _draw(
    axes: Any,
    rows: Sequence[str],
    columns: Sequence[str],
    title: str,
    matrix: NDArray[np.float64],
) -> None:
    axes.imshow(matrix, cmap="RdBu_r", vmin=-1.0, vmax=1.0, aspect="auto")
    axes.set_title(fill(plain(title), _TITLE_LETTERS))
    axes.set_yticks(range(len(rows)), [plain(name) for name in rows])
    axes.set_xticks(range(len(columns)), [plain(name) for name in columns], rotation=35, ha="right")
    axes.tick_params(length=0)
    for i in range(len(columns)):
        for j in range(len(columns)):
            value = matrix[i, j]
            axes.text(
                j,
                i,
                f"{value:+.2f}".replace("-", "\N{MINUS SIGN}") if i != j else "1",
                ha="center",
                va="center",
                color="white" if abs(value) > 0.6 else "black",
                fontweight="bold" if i != j and abs(value) > 0.95 else "normal",
            )


Floats = NDArray[np.float64]

_MARGIN = 0.05
_HEADROOM = 1.25
"""Range over the largest residual, so that the legend covers no curve."""


def stroke_chart(study: CalibrationStudy, channel: FittedChannel) -> Chart:
    """Whole stroke of one channel, measured and computed, and the difference."""
    return _overlay(
        study,
        channel,
        name=f"stroke-{channel.role}",
        title=f"{channel.role.capitalize()}, measured and computed",
        span=(float(study.time[0]), float(study.time[-1])),
        note=(
            "Shaded: fitted range. Outside, bounces magnify the differences between strokes. "
            "Below: mean of the measured strokes minus computed."
        ),
    )


def window_chart(study: CalibrationStudy, channel: FittedChannel, window: FitWindow) -> Chart:
    """One fitted window, from the first motion of the channel."""
    inside = (study.time >= window.first) & (study.time <= window.last)
    moved = np.abs(channel.mean - channel.mean[inside][0]) > 0.04 * np.ptp(channel.mean[inside])
    times = study.time[inside & moved]
    first = float(times[0]) if times.size else window.first
    length = window.last - first
    return _overlay(
        study,
        channel,
        name=f"window-{channel.role}-{window.what.split(',')[0]}",
        title=f"{channel.role.capitalize()}, {window.what.split(',')[0]}",
        span=(max(first - 0.15 * length, window.first), window.last + 0.03 * length),
        note="The same, enlarged.",
    )


def _overlay(
    study: CalibrationStudy,
    channel: FittedChannel,
    *,
    name: str,
    title: str,
    span: tuple[float, float],
    note: str,
) -> Chart:
    unit, factor = printed_unit(channel.mean, channel.unit)
    seen = (study.time >= span[0]) & (study.time <= span[1])
    time = 1e3 * study.time[seen]

    def curve(values: Floats, **look: object) -> Curve:
        x, y = thinned(time, factor * values[seen])
        return Curve(x=x, y=y, **look)  # type: ignore[arg-type]

    band = "90 % of the measured strokes"
    curves = (
        curve(channel.low, label=band, colour="sky", width=1.0),
        curve(channel.high, colour="sky", width=1.0),
        curve(channel.mean, label="mean of the measured strokes", colour="black", width=2.4),
        curve(channel.before, label="before", colour="orange", style="dotted", width=2.0),
        curve(channel.after, label="calibrated", colour="red", style="dashed", width=2.0),
    )
    left = factor * (channel.mean - channel.after)
    fitted = seen & (channel.weight > 0.0)
    largest = float(np.max(np.abs(left[fitted]))) if fitted.any() else 1.0
    small, shrink = printed_unit(np.array([largest / factor]), channel.unit)
    residual = _HEADROOM * largest * shrink / factor
    windows = tuple(
        Band(low=1e3 * w.first, high=1e3 * w.last, label=w.what.split(",")[0])
        for w in study.windows
    )
    return Chart(
        name=name,
        title=title,
        x=AxisSpec(label="time since the trigger", unit="ms", range=(1e3 * span[0], 1e3 * span[1])),
        panels=(
            Panel(y=AxisSpec(label=channel.role, unit=unit), curves=curves, bands=windows),
            Panel(
                y=AxisSpec(label="residual", unit=small, range=(-residual, residual)),
                curves=(
                    curve(
                        (channel.mean - channel.after) * shrink / factor,
                        label="measured less calibrated",
                        colour="blue",
                        width=1.2,
                    ),
                ),
                bands=tuple(Band(low=w.low, high=w.high, label="") for w in windows),
                marks=(Mark(value=0.0, axis="y"),),
                share=0.55,
            ),
        ),
        note=note,
    )


def profile_chart(profile: ProfileCurve, parameter: CalibratedParameter) -> Chart:
    """Misfit when one parameter is held off its best value."""
    unit, factor = printed_unit(profile.values, parameter.unit)
    x = factor * profile.values
    line = np.linspace(x[0], x[-1], 121)
    parabola = ((line - factor * parameter.value) / (factor * parameter.standard_error)) ** 2
    # the signed root of a profile is nearly a straight line
    root = np.sqrt(profile.excess) * np.sign(x - factor * parameter.value)
    smooth = scipy.interpolate.PchipInterpolator(x, root)(line) ** 2
    top = 1.8 * profile.threshold
    ends = [
        Mark(value=factor * end, label=f"{factor * end:.5g}")
        for end in (profile.lower, profile.upper)
        if isfinite(end)
    ]
    return Chart(
        name=f"profile-{profile.name}",
        title=f"Profile likelihood of '{profile.name}'",
        x=AxisSpec(label=profile.name, unit=unit),
        panels=(
            Panel(
                y=AxisSpec(label="excess Λ", range=(-0.03 * top, top)),
                curves=(
                    Curve(
                        x=line,
                        y=parabola,
                        label="standard error alone",
                        colour="grey",
                        style="dashed",
                    ),
                    Curve(x=line, y=smooth, label="profile", colour="blue", width=2.2),
                    Curve(x=x, y=profile.excess, colour="blue", width=2.0, drawn="points"),
                ),
                marks=(
                    *ends,
                    Mark(value=profile.threshold, axis="y", label="95 %"),
                ),
            ),
        ),
        note=(
            "All other parameters are fitted again at each point. The interval is where the curve "
            "stays below the horizontal line; where it leaves the dashed parabola, the standard "
            "error alone would mislead."
        ),
    )


_STOPS = {"opening": "opening stop", "seat": "seat"}


def calibration_content(study: CalibrationStudy) -> Content:
    """Put a calibration into words, tables and figures."""
    by_name = {item.name: item for item in study.parameters}
    keys = Table(
        columns=("parameter", "key of the case"),
        rows=tuple((name, ", ".join(item.keys)) for name, item in by_name.items()),
    )
    impacts = Table(
        columns=("first impact on", *page_heads(FITTED_MEASURES)),
        rows=tuple(
            (_STOPS.get(impact.stop, impact.stop), *page_cells(FITTED_MEASURES, impact))
            for impact in study.impacts
        ),
    )
    sections = [
        Section(title="The strokes", charts=tuple(stroke_chart(study, c) for c in study.channels)),
        Section(
            title="First impacts and flights",
            charts=tuple(
                window_chart(study, channel, window)
                for channel in study.channels[:1]
                for window in study.windows
            ),
            tables=(impacts,) if study.impacts else (),
        ),
        _correlations(study),
        Section(
            title="Profile likelihood",
            charts=tuple(profile_chart(p, by_name[p.name]) for p in study.profiles),
        ),
        Section(title="Input", tables=(keys, _fact_table(study))),
    ]
    return page_of(
        study,
        "Calibration to measured strokes",
        answer=_answer(study),
        numbers=_parameter_table(study),
        sections=sections,
        definitions=_DEFINITIONS,
        limits=_LIMITS,
    )


def _answer(study: CalibrationStudy) -> str:
    names = listed([_found(item) for item in study.parameters])
    text = (
        f"{len(study.strokes)} {study.variant} strokes of {study.source} give {names} "
        "(value ± standard error). "
    )
    text += (
        f"Inside the fitted windows the computed lift is {quantity(study.residual_rms, 'm', 3)} "
        f"from the mean stroke (root mean square; {quantity(study.residual_rms_before, 'm', 3)} "
        "with the values of the case)"
    )
    judged = "no more than" if study.misfit <= 1.5 else f"{study.misfit:.1f} times"
    text += f", {judged} the value expected from the scatter of the strokes and their noise."
    if study.warnings:
        text += " Read the notes below before using the numbers."
    return text


def _found(item: CalibratedParameter) -> str:
    if not isfinite(item.standard_error):
        return f"{item.name} (not determined)"
    return f"{item.name} {VALUE.on_page(item)} ± {STANDARD_ERROR.on_page(item)}"


# --------------------------------------------------------------------------- tables


def _parameter_table(study: CalibrationStudy) -> Table:
    profiles = {profile.name: profile for profile in study.profiles}
    rows = []
    for item in study.parameters:
        known = isfinite(item.standard_error)
        cells = [
            item.name,
            VALUE.on_page(item),
            STANDARD_ERROR.on_page(item),
            _span(end.on_page(item) for end in INTERVAL) if known else "not determined",
        ]
        if profiles:
            profile = profiles.get(item.name)
            cells.append("–" if profile is None else _profile_span(item, profile))
        cells += [
            SCATTER.on_page(item),
            START.on_page(item),
            _span(end.on_page(item) for end in BOUNDS),
        ]
        rows.append(tuple(cells))
    columns = ["parameter", VALUE.name, STANDARD_ERROR.name, "95 % interval"]
    columns += ["95 % by profile"] if profiles else []
    columns += [SCATTER.name, START.name, "bounds"]
    return Table(columns=tuple(columns), rows=tuple(rows))


def _profile_span(item: CalibratedParameter, profile: ProfileCurve) -> str:
    ends = (profile.lower, profile.upper)
    return _span(
        quantity(end, item.unit, item.digits) if isfinite(end) else "bound" for end in ends
    )


def _span(ends: Iterable[str]) -> str:
    return " to ".join(ends)


def _fact_table(study: CalibrationStudy) -> Table:
    window = "; ".join(
        f"{w.what}: {quantity(w.first, 's')} to {quantity(w.last, 's')}" for w in study.windows
    )
    rows = [
        ("measured", study.source),
        ("discarded", "; ".join(study.rejected) or "none"),
        ("variant", study.variant),
        ("channels", ", ".join(c.role for c in study.channels if c.weight.any())),
        ("windows", window),
        *(
            (head, cell)
            for head, cell in zip(
                page_heads(CALIBRATION_MEASURES),
                page_cells(CALIBRATION_MEASURES, study),
                strict=True,
            )
        ),
        (
            "singular values of the sensitivities",
            ", ".join(f"{value:.3g}" for value in study.singular_values),
        ),
    ]
    return Table(columns=("calibration", ""), rows=tuple(rows))


# --------------------------------------------------------------------------- sections


def _correlations(study: CalibrationStudy) -> Section:
    title = "Correlation of the parameters"
    if len(study.parameters) < 2:
        return Section(title=title)
    figure = correlation_figure(
        [item.name for item in study.parameters],
        (
            ("of the estimates, from the scatter of the strokes", study.correlation),
            ("of the sensitivities only", study.design_correlation),
        ),
        "Near +1 or −1 two parameters have the same effect on the data. Left: correlation of "
        "the fitted values, from the scatter of the strokes. Right: correlation from the "
        "sensitivities in the measured windows, as if all samples scattered independently.",
    )
    return Section(title=title, picture=figure)


# --------------------------------------------------------------------------- words


_DEFINITIONS: tuple[tuple[str, str], ...] = (
    *glossary((VALUE, STANDARD_ERROR)),
    (
        "95 % interval",
        "Value plus and minus the standard error times Student's quantile for one degree of "
        "freedom less than strokes. 'Profile' is the interval of the profile likelihood, which "
        "does not assume a linear model.",
    ),
    *glossary((SCATTER, *(item for item in CALIBRATION_MEASURES if item.key == "misfit"))),
    (
        "first impact",
        "Time at which the fitted approach reaches the level of the stop, determined for the "
        "mean measured stroke and the computed strokes in the same way.",
    ),
    (
        "windows",
        "Free flights and first impacts, up to the impact after the last fitted one. Samples "
        "are weighted with the inverse variance between strokes.",
    ),
)

_LIMITS: tuple[tuple[str, str], ...] = (
    (
        "model",
        "The errors come from the scatter of the strokes. Effects missing from the model shift "
        "the fitted parameters without widening any interval: check the residual over time.",
    ),
    (
        "sensor",
        "A wrong calibration or bandwidth of the sensor is attributed to the valve, unless its "
        "values are among the parameters.",
    ),
    (
        "trigger",
        "Jitter of the trigger counts as scatter of the strokes; a constant delay of the recorder "
        "between channels is not visible and shifts the result.",
    ),
)
