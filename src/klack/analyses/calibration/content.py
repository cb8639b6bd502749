"""What a calibration report says, before it is laid out: the same words for screen and paper."""

from collections.abc import Iterable
from math import isfinite

from klack.analyses.calibration.figures import (
    correlation_figure,
    profile_chart,
    stroke_chart,
    window_chart,
)
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
    ProfileCurve,
)
from klack.analyses.measures import glossary, page_cells, page_heads
from klack.analyses.page import page_of
from klack.report.page import Content, Section, Table
from klack.report.wording import listed, quantity

__all__ = ["calibration_content"]

_STOPS = {"opening": "opening stop", "seat": "seat"}


def calibration_content(study: CalibrationStudy) -> Content:
    """Put a calibration into words, tables and figures."""
    sections = [
        Section(title="The strokes", charts=tuple(stroke_chart(study, c) for c in study.channels)),
        Section(
            title="First impacts and flights",
            charts=tuple(
                window_chart(study, channel, window)
                for channel in study.channels[:1]
                for window in study.windows
            ),
            tables=(_impact_table(study),) if study.impacts else (),
        ),
        _correlations(study),
        _profiles(study),
        Section(title="Input", tables=(_key_table(study), _fact_table(study))),
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
        text += " Read the notes below before you use the numbers."
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
    """Ends of an interval that the profile may leave open towards a bound."""
    ends = (profile.lower, profile.upper)
    return _span(
        quantity(end, item.unit, item.digits) if isfinite(end) else "bound" for end in ends
    )


def _span(ends: Iterable[str]) -> str:
    return " to ".join(ends)


def _key_table(study: CalibrationStudy) -> Table:
    rows = tuple((item.name, ", ".join(item.keys)) for item in study.parameters)
    return Table(columns=("parameter", "key of the case"), rows=rows)


def _impact_table(study: CalibrationStudy) -> Table:
    return Table(
        columns=("first impact on", *page_heads(FITTED_MEASURES)),
        rows=tuple(
            (_STOPS.get(impact.stop, impact.stop), *page_cells(FITTED_MEASURES, impact))
            for impact in study.impacts
        ),
    )


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
            ("of the sensitivities alone", study.design_correlation),
        ),
        "Near +1 or −1 two parameters have the same effect on the data. Left: of the fitted "
        "values, from the scatter of the strokes. Right: separable in principle from the measured "
        "windows, if all samples scattered independently.",
    )
    return Section(title=title, picture=figure)


def _profiles(study: CalibrationStudy) -> Section:
    by_name = {item.name: item for item in study.parameters}
    return Section(
        title="Profile likelihood",
        charts=tuple(profile_chart(p, by_name[p.name]) for p in study.profiles),
    )


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
        "Time at which the fitted approach reaches the level of the stop, read off the mean "
        "measured stroke and the computed ones in the same way.",
    ),
    (
        "windows",
        "Free flights and first impacts, up to the impact after the last one that is fitted. "
        "Samples are weighted with the inverse variance between strokes.",
    ),
)

_LIMITS: tuple[tuple[str, str], ...] = (
    (
        "model",
        "The errors are those of the strokes. Effects missing in the model shift the fitted "
        "parameters, which no interval shows: check the residual over time.",
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
