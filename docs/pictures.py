"""Make the pictures of the documentation: ``python docs/pictures.py RESULT...``.

Of ``klack demo`` come section.svg and force.svg, of ``klack stroke demo-stroke`` stroke.svg, of
``klack stroke docs/how-to/two_coils.yaml`` two-coils.svg.

Of two results of ``klack impact CASE --level interface`` comes pressure.svg; their cases are
copies of ``demo-valve`` with titles of their own, the second with
``placement: {eccentricity: 1 um}`` under ``motion``.

Of two results of ``klack impact CASE --level reduced,interface,full`` with the
same two cases comes levels.svg.

Of ``klack calibrate measured --measurement cases/measured/strokes_synthetic.csv`` comes
calibration.svg, of ``klack study docs/how-to/injected_mass.yaml --study
docs/how-to/pulse_width.yaml`` injected-mass.svg, of ``klack noise demo-stroke --variant wet,dry``
click.svg, of ``klack heat warm-valve`` warm-up.svg.

Of ``klack stroke`` of a copy of ``docs/how-to/guided_stroke.yaml`` with ``placement: {seed: 4}``,
without ``shots`` and with ``run: {duration: 0.8 ms, variants: [wet]}`` come off-axis-line-load.svg
and off-axis-film.svg.
"""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

from klack.analyses.calibration.analysis import CALIBRATION
from klack.analyses.calibration.content import stroke_chart as calibration_chart
from klack.analyses.heat.content import heat_charts
from klack.analyses.heat.summary import HEAT
from klack.analyses.impact.analysis import IMPACT
from klack.analyses.impact.figures import force_chart
from klack.analyses.impact.pressure_figure import draw_pressure
from klack.analyses.impact.pressure_view import PressureView, pressure_view
from klack.analyses.impact.record import ImpactStudy
from klack.analyses.impact.section_figure import section_figure
from klack.analyses.noise.analysis import NOISE
from klack.analyses.noise.figures import click_charts
from klack.analyses.store import stored_format
from klack.analyses.stroke.analysis import STROKE
from klack.analyses.stroke.figures import actuation_chart
from klack.analyses.stroke.film_frames import film_charts
from klack.analyses.stroke.record import StrokeStudy
from klack.analyses.stroke.ring_figure import line_load_picture
from klack.analyses.study.analysis import STUDY
from klack.analyses.study.record import StudyRecord
from klack.report.chart import AxisSpec, Chart, Curve, Mark, Panel
from klack.report.printed import svg_chart

IMAGES = Path(__file__).parent / "images"


def main(results: list[Path]) -> None:
    """Write the pictures that belong to each result."""
    rings: list[PressureView] = []
    compared: list[ImpactStudy] = []
    for result in results:
        form = stored_format(result)
        if form == STROKE.form.name:
            _write_stroke(STROKE.load(result))
            continue
        if form == CALIBRATION.form.name:
            study = CALIBRATION.load(result)
            chart = calibration_chart(study, study.channels[0])
            (IMAGES / "calibration.svg").write_bytes(svg_chart(chart))
            continue
        if form == STUDY.form.name:
            (IMAGES / "injected-mass.svg").write_bytes(svg_chart(mass_chart(STUDY.load(result))))
            continue
        if form == NOISE.form.name:
            chart = click_charts(NOISE.load(result))[0]
            (IMAGES / "click.svg").write_bytes(svg_chart(chart))
            continue
        if form == HEAT.form.name:
            (IMAGES / "warm-up.svg").write_bytes(svg_chart(heat_charts(HEAT.load(result))[0]))
            continue
        impact = IMPACT.load(result)
        if {"interface", "full"} <= impact.levels.keys():
            compared.append(impact)
        elif impact.sections:
            _write_impact(impact)
        else:
            rings += _ring(impact)
    if len(rings) > 1:
        (IMAGES / "pressure.svg").write_bytes(draw_pressure(rings))
    if len(compared) > 1:
        (IMAGES / "levels.svg").write_bytes(svg_chart(levels_chart(compared)))


def mass_chart(study: StudyRecord) -> Chart:
    """Mass over the width of the pulse, and where the needle first reaches its stop."""
    pulse, mass = study.parameters[0].values, study.measures[0].values
    touch = next(item for item in study.measures if item.name == "opening_time").values
    reached = 1e3 * float(pulse[np.flatnonzero(np.isfinite(touch))[0]])
    x, y = 1e3 * pulse, 1e6 * mass
    curves = (
        Curve(x=x, y=y, colour="blue", width=1.0, listed=False),
        Curve(x=x, y=y, colour="blue", width=2.0, drawn="points", listed=False),
    )
    label = "the needle reaches its stop"
    return Chart(
        name="injected-mass",
        title="Injected mass over the width of the pulse",
        x=AxisSpec(label="width of the pulse", unit="ms"),
        panels=(
            Panel(
                y=AxisSpec(label="mass", unit="mg"),
                curves=curves,
                marks=(Mark(value=reached, label=label),),
            ),
        ),
    )


def levels_chart(studies: list[ImpactStudy]) -> Chart:
    """Force at the levels of several impacts, one panel each, under the titles of the cases."""
    shown = ("full", "interface", "reduced")
    charts = [
        force_chart(replace(s, levels={k: v for k, v in s.levels.items() if k in shown}))
        for s in studies
    ]
    panels = []
    for study, chart in zip(studies, charts, strict=True):
        curves = chart.panels[0].curves
        if panels:  # the same words once
            curves = tuple(replace(curve, listed=False) for curve in curves)
        panels.append(
            replace(chart.panels[0], y=AxisSpec(label=study.title, unit="N"), curves=curves)
        )
    return replace(charts[0], panels=tuple(panels), note="")


def stroke_chart(study: StrokeStudy) -> Chart:
    """Current, magnetic force and lift of the reference."""
    whole = actuation_chart(study)
    kept = [panel for panel in whole.panels if panel.y.label in ("current", "magnet", "lift")]
    first = kept[0]
    top = max(float(curve.y.max()) for curve in first.curves)
    axis = replace(first.y, range=(-0.05 * top, 1.4 * top))  # with room for the words of the marks
    kept[0] = replace(first, y=axis, marks=whole.panels[0].marks)
    return replace(whole, panels=tuple(kept))


def _write_stroke(study: StrokeStudy) -> None:
    """Picture of a stroke along its axis, or of the impacts of one in three dimensions."""
    rings = line_load_picture(study.reference)
    if rings is None:
        name = "two-coils.svg" if len(study.channels.current) > 1 else "stroke.svg"
        (IMAGES / name).write_bytes(svg_chart(stroke_chart(study)))
        return
    (IMAGES / "off-axis-line-load.svg").write_bytes(rings.image)
    (IMAGES / "off-axis-film.svg").write_bytes(svg_chart(film_charts(study.reference)[0]))


def _ring(study: ImpactStudy) -> list[PressureView]:
    """Contact forces of the interface level, under the title of the case."""
    result = study.levels["interface"]
    view = pressure_view(study.title, result.pressure, result.measures.first_touch)
    return [view] if view is not None and view.places.shape == "ring" else []


def _write_impact(study: ImpactStudy) -> None:
    # five times the force of all others would flatten them
    study = replace(study, levels={k: v for k, v in study.levels.items() if k != "lumped"})
    (IMAGES / "section.svg").write_bytes(section_figure(study).image)
    (IMAGES / "force.svg").write_bytes(svg_chart(force_chart(study)))


if __name__ == "__main__":
    main([Path(argument) for argument in sys.argv[1:]])
