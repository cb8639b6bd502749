"""Content of an impact report.

Pictures are imported where there are any: matplotlib takes half a second.
"""

from collections.abc import Callable, Sequence
from math import isfinite

import numpy as np

from klack.analyses.impact.analysis import GAUGE_COLUMNS, gauge_rows, no_estimate
from klack.analyses.impact.figures import charts
from klack.analyses.impact.measures import DEVIATION_MEASURES, measures_of
from klack.analyses.impact.pressure_view import friction_views, pressure_rows, study_views
from klack.analyses.impact.record import ImpactStudy, LevelResult
from klack.analyses.impact.wording import (
    ESTIMATE_COLUMNS,
    answer,
    estimate_rows,
    estimate_sentence,
    leaves_axis,
)
from klack.analyses.measures import Measure, glossary
from klack.analyses.page import page_of
from klack.assembling.body_summary import BodySummary
from klack.contact.restitution import Deviation, ImpactMeasures
from klack.report.chart import AnyChart
from klack.report.page import Content, NextStep, Section, Table
from klack.report.wording import (
    count,
    listed,
    quantity,
    sentence,
    share,
)

__all__ = [
    "body_table",
    "report_content",
    "size_verdict",
]


_WITHOUT_FRICTION: tuple[tuple[str, Callable[[ImpactMeasures], str]], ...] = (
    ("restitution", lambda m: f"{m.restitution:.4f}"),
    ("peak force", lambda m: quantity(m.peak_force, "N", 5)),
    ("contact time", lambda m: quantity(m.contact_time, "s", 5)),
)


_CENTRED = (
    "Law of the centred bodies, in the meridian plane. The interface level, which is off-axis, "
    "has no such law."
)


def report_content(study: ImpactStudy) -> Content:
    """Texts, tables and figures of a study."""
    found = charts(study)
    by_name = {chart.name: chart for chart in found}
    transfer = tuple(chart for chart in found if chart.name.startswith("transfer-"))

    def named(*names: str) -> tuple[AnyChart, ...]:
        return tuple(by_name[name] for name in names if name in by_name)

    sections = [_estimates(study), _computed(study)]
    sections += [_bodies_in_space(study), _bodies_at_peak(study)]
    sections.append(Section(title="Force over time", charts=named("force")))
    sections.append(Section(title="The body behind the struck body", charts=named("backing")))
    sections.append(_pressure(study))
    sections.append(_friction(study))
    sections.append(_running_in(study))
    sections.append(Section(title="Spectrum of the force", charts=named("spectrum")))
    if transfer:
        sections.append(Section(title="Transfer functions of the bodies", charts=transfer))
    law = named("law", "approach")
    centred = (_CENTRED,) if leaves_axis(study) and law else ()
    sections.append(Section(title="Local contact law", charts=law, paragraphs=centred))
    sections.append(
        Section(title="Energy", charts=named("energy", "modes"), tables=(_energy_table(study),))
    )
    sections.append(Section(title="Motion", charts=named("motion")))
    outputs = tuple(chart for chart in found if chart.name.startswith("output-"))
    sections.append(Section(title="Outputs", charts=outputs, tables=_outputs(study)))
    return page_of(
        study,
        "Dry impact",
        answer=answer(study),
        numbers=_number_table(study),
        sections=sections,
        definitions=_definitions(study),
        limits=_limits(study),
        next_steps=_next_steps(study),
    )


def _next_steps(study: ImpactStudy) -> list[NextStep]:
    meshed = all(body.elements for body in study.bodies) and not study.is_row
    steps = []
    if meshed and not leaves_axis(study) and "full" not in {*study.levels, *study.failures}:
        steps.append(
            NextStep(
                purpose="Compare with every degree of freedom of both bodies.",
                command="klack impact CASE --level reduced,full",
            )
        )
    if meshed and not study.levels[study.reference].measures.cut_off:
        steps.append(
            NextStep(
                purpose="Error of the mesh, the modes and the step, and better sizes for them.",
                command="klack advise CASE",
            )
        )
    if not study.is_row:
        sound = "The sound of this impact, with WAV files."
        steps.append(NextStep(purpose=sound, command="klack noise RESULT"))
    steps += [
        NextStep(
            purpose="Force and motion as tables for other programs.",
            command="klack export RESULT --to csv --out tables",
        ),
    ]
    return steps


def _bodies_in_space(study: ImpactStudy) -> Section:
    title = "The bodies in space"
    if study.is_row or not any(b.model == "3-D" and b.elements for b in study.bodies):
        return Section(title=title)
    if study.pictures:
        from klack.analyses.impact.solid_figure import solid_figure

        return Section(title=title, picture=solid_figure(study))
    text = (
        "No picture: this result contains no surfaces of the bodies. Results of earlier "
        "versions have none; 'klack impact CASE' adds them. In a new result the warnings state "
        "what failed."
    )
    return Section(title=title, paragraphs=(text,))


def _bodies_at_peak(study: ImpactStudy) -> Section:
    title = "The bodies at peak force"
    if study.sections:
        from klack.analyses.impact.section_figure import section_figure

        return Section(title=title, picture=section_figure(study))
    if study.is_row:
        return Section(title=title)
    text = "No picture: the displacement of the whole bodies is only available at level 'full', "
    if "full" in study.failures:
        text += "which failed; see the warnings."
    elif leaves_axis(study):
        text += "which axisymmetric bodies do not support off-axis."
    else:
        text += (
            "which was not computed. 'klack impact CASE --level reduced,full' adds it, for bodies "
            "with a mesh."
        )
    return Section(title=title, paragraphs=(text,))


# --------------------------------------------------------------------------- tables


def _number_table(study: ImpactStudy) -> Table:
    results = study.ordered
    names = [result.level for result in results]
    rows = [
        (measure.title or measure.name, *(_number(study, measure, result) for result in results))
        for measure in measures_of(*results)
        if measure.page
    ]
    rows += [
        (measure.title, *(_apart(study, measure, name) for name in names))
        for measure in DEVIATION_MEASURES
        if measure.page and study.deviations
    ]
    heads = [
        result.label + _standing(study, name) for name, result in zip(names, results, strict=True)
    ]
    return Table(columns=("", *heads), rows=tuple(rows))


def _standing(study: ImpactStudy, name: str) -> str:
    result = study.levels[name]
    if result.measures.cut_off:
        return "\n(cut off)"
    if result.doubts:
        return "\n(no reference, see warnings)"
    return "\n(reference)" if name == study.reference and len(study.levels) > 1 else ""


def _number(study: ImpactStudy, measure: Measure[LevelResult], result: LevelResult) -> str:
    cell = measure.on_page(result)
    found = study.deviations.get(result.level)
    apart = next((item for item in DEVIATION_MEASURES if item.key == measure.key), None)
    return cell if found is None or apart is None else f"{cell}\n{apart.on_page(found)}"


def _apart(study: ImpactStudy, measure: Measure[Deviation], name: str) -> str:
    found = study.deviations.get(name)
    return "–" if found is None else measure.on_page(found)


def _computed(study: ImpactStudy) -> Section:
    contact, law = study.contact, study.law
    facts = [
        ("surfaces", contact.surfaces),
        ("speed at the start", f"{study.speed:.4g} m/s"),
        ("gap at the start", quantity(study.gap, "m", 3)),
    ]
    if contact.points:  # none where bodies meet at ports
        width = "half width at peak force"
        if leaves_axis(study):
            facts.append(
                (
                    "off-axis",
                    "the rows below: a centred contact with the load of the worst\n"
                    "part of the ring, in the meridian plane",
                )
            )
            width = "half width"
        facts += [
            ("contact points", count(contact.points)),
            (width, quantity(contact.half_width, "m", 3)),
            (
                "element size over half width",
                f"{contact.size_ratio:.2f} ({size_verdict(contact.size_ratio)})",
            ),
            ("contact points across", str(contact.points_across or "–")),
            *_stuck_rows(study),
            ("doubts about the contact", "\n".join(contact.doubts) or "–"),
        ]
    facts.append(("local law", law.kind))
    return Section(
        title="Input",
        tables=(
            body_table(study.bodies),
            Table(columns=("contact", ""), rows=tuple(facts)),
            *(
                Table(columns=("press fit", f"{fit.body}.{fit.joint}"), rows=fit.rows(quantity))
                for fit in study.fits
            ),
            *(
                Table(columns=("bolts", f"{each.body}.{each.joint}"), rows=each.rows(quantity))
                for each in study.bolts
            ),
            *(
                Table(columns=("layer", f"{each.body}.{each.name}"), rows=each.rows(quantity))
                for each in study.layers
            ),
        ),
    )


def _stuck_rows(study: ImpactStudy) -> list[tuple[str, str]]:
    stuck = study.contact.stuck
    if stuck is None:
        return []
    rows = [("compliance along the normal, all points stick", stuck.normal)]
    if isfinite(stuck.tangential):
        rows += [
            ("compliance across the normal", stuck.tangential),
            ("coupling of both", stuck.coupling),
        ]
    return [(name, f"{1e9 * value:.4g} nm/N") for name, value in rows]


def _estimates(study: ImpactStudy) -> Section:
    only_full = set(study.estimates) == {"full"}
    title = f"Accuracy of the {'full order' if only_full else 'reduced level'}"
    if reason := no_estimate(study):
        return Section(title=title, paragraphs=(sentence(reason),))
    if not study.estimates:
        return Section(title=title)
    return Section(
        title=title,
        paragraphs=(estimate_sentence(study),),
        tables=(Table(columns=ESTIMATE_COLUMNS, rows=estimate_rows(study)),),
    )


def _pressure(study: ImpactStudy) -> Section:
    title = "Pressure in the contact"
    views = study_views(study)
    if not views:
        return Section(title=title)
    from klack.analyses.impact.pressure_figure import pressure_figure

    columns = ("", *(view.title for view in views))
    return Section(
        title=title,
        picture=pressure_figure(views),
        tables=(Table(columns=columns, rows=pressure_rows(views)),),
    )


def _friction(study: ImpactStudy) -> Section:
    title = "Friction between the faces"
    views = friction_views(study)
    if not views:
        return Section(title=title)
    from klack.analyses.impact.pressure_figure import friction_figure

    rubbing = [r for r in study.ordered if r.energies.get("friction")]
    rows = [
        (
            "share of the initial energy lost in friction",
            *(
                f"{100 * r.energies['friction'] / r.energies['initial kinetic']:.2f} %"
                for r in rubbing
            ),
        ),
        ("restitution", *(f"{r.measures.restitution:.4f}" for r in rubbing)),
    ]
    for name, text in _WITHOUT_FRICTION:
        values = [text(r.frictionless) if r.frictionless else "" for r in rubbing]
        if any(values):
            rows.append((f"{name} without friction", *values))
    return Section(
        title=title,
        picture=friction_figure(views),
        tables=(Table(columns=("", *(r.label for r in rubbing)), rows=tuple(rows)),),
    )


def _outputs(study: ImpactStudy) -> tuple[Table, ...]:
    rows = gauge_rows(study)
    return (Table(columns=GAUGE_COLUMNS, rows=rows),) if rows else ()


def _running_in(study: ImpactStudy) -> Section:
    title, found = "Running in", study.running_in
    if found is None:
        return Section(title=title)
    text = (
        f"{len(found.peak_force)} impacts at {quantity(study.speed, 'm/s', 3)} on the same faces, "
        f"level {found.level}."
    )
    if found.level == "reduced":
        text += (
            " The land is the strip that has been in contact; its width is that of an elliptic "
            "pressure with the same second moment."
        )
    if not found.run_in:
        text += (
            " The faces still yield at the last impact: run.run_in: true adds the missing impacts."
        )
    return Section(
        title=title,
        paragraphs=(text,),
        tables=(Table(columns=found.heads, rows=found.rows(quantity)),),
    )


def body_table(bodies: Sequence[BodySummary]) -> Table:
    """Model, material, mass, mesh and modes: one column per body."""
    return Table(
        columns=("", *(body.name for body in bodies)),
        rows=tuple((title, *(text(body) for body in bodies)) for title, text in _BODY_ROWS),
    )


def size_verdict(ratio: float) -> str:
    """Judge the element size across the contact over its half width."""
    if not np.isfinite(ratio):
        return "not known"
    return "good" if ratio <= 1 else "coarse" if ratio <= 1.5 else "too coarse"


def _mesh(body: BodySummary) -> str:
    if body.elements:
        return f"{count(body.elements)} elements, {count(body.nodes)} nodes"
    return f"{count(body.nodes)} nodes" if body.nodes else "none"


def _modes(body: BodySummary) -> str:
    if not body.frequencies.size:
        return "none"
    low, high = (quantity(value, "Hz", 3) for value in body.frequencies[[0, -1]])
    return f"{body.frequencies.size}\n{low} to {high}"


_BODY_ROWS: tuple[tuple[str, Callable[[BodySummary], str]], ...] = (
    ("model", lambda body: body.model),
    ("geometry", lambda body: body.source),
    ("support", lambda body: body.support),
    ("material", lambda body: body.material),
    ("mass", lambda body: quantity(1e3 * body.mass, "g")),
    ("mesh", lambda body: f"{_mesh(body)}\n{count(body.dofs)} degrees of freedom"),
    ("kept elastic modes", _modes),
    ("contact compliance in these modes", lambda body: share(body.compliance_share)),
)


_ROUND_OFF = 1e-12
"""Share of the initial energy below which an energy is zero."""


def _energy_table(study: ImpactStudy) -> Table:
    results = study.ordered
    names = dict.fromkeys(name for result in results for name in result.energies)
    rows = []
    for name in names:
        if not any(result.energies.get(name) for result in results):
            continue  # zero everywhere says nothing
        cells = []
        for result in results:
            initial = next(iter(result.energies.values()))
            value = result.energies.get(name)
            if value is not None and abs(value) < _ROUND_OFF * initial:
                value = 0.0
            text = "–" if value is None else quantity(value, "J")
            if value is not None and initial > 0:
                text += f"\n{share(value / initial, 2)}"
            cells.append(text)
        rows.append((name, *cells))
    residual = [f"{result.energy_residual:.1e}".replace("-", "−") for result in results]
    rows.append(("residual of the energy balance", *residual))
    return Table(columns=("", *(result.label for result in results)), rows=tuple(rows))


# --------------------------------------------------------------------------- words


def _definitions(study: ImpactStudy) -> tuple[tuple[str, str], ...]:
    return (
        *glossary(measures_of(*study.ordered)),
        *glossary(DEVIATION_MEASURES),
        (
            "spectrum",
            "Magnitude of the Fourier integral of the force of the first impact, |∫ F(t) "
            "exp(−2πi f t) dt| in N s, without a window (the force begins and ends at zero), as "
            "a level relative to 1 µN s: 20 lg(|F|/1 µN s). A third-octave level is the "
            "integral of 2 |F|² over the band (IEC 61260-1, base ten) relative to 1 pN² s; all "
            "bands together contain the integral of F² over time.",
        ),
        (
            "local law",
            "Force over indentation of the reduced contact. The consistent law is the static "
            "approach of the complete bodies minus the compliance of the kept modes.",
        ),
        *_definitions_point_by_point(study),
    )


def _definitions_point_by_point(study: ImpactStudy) -> tuple[tuple[str, str], ...]:
    found = []
    if "interface" in study.levels or study.estimates:
        found.append(
            (
                "interface level",
                "Both bodies as modes, their residual compliance between "
                "all contact points, and the contact solved point by point in every step: "
                "open, or closed and never pulling. It covers eccentric, tilted and partial "
                "contact.",
            )
        )
    if study.estimates:
        found.append(
            (
                "estimated error",
                "Deviation of a reduced level from one interface-level run at the same "
                "condition, with more modes than the reduced level keeps. It includes the error "
                "of the local law and of the omitted modes, not of the mesh. The number after ± "
                "is the deviation of that run from one with half the modes in longer steps. The "
                "steps of the full order have their own error, found from the same run with the "
                "periods and steps of the full order.",
            )
        )
    if any(result.pressure is not None for result in study.levels.values()):
        found.append(
            (
                "pressure",
                "Force of a contact point, normal to the surface, over its area. How well it is "
                "resolved depends on the elements across the contact (see Resolution); sums such "
                "as the line load are far more accurate than the pressure at one point.",
            )
        )
    return tuple(found)


def _contact_of(study: ImpactStudy) -> str:
    rubbing = [f"'{result.level}'" for result in study.ordered if result.energies.get("friction")]
    if study.contact.layer:
        return f"frictionless contact of faces with {study.contact.layer}, which stay elastic"
    if not rubbing:
        return "frictionless contact of smooth surfaces"
    if len(rubbing) == len(study.ordered):
        return "contact of smooth surfaces with Coulomb friction"
    return (
        "contact of smooth surfaces, with Coulomb friction at level "
        f"{' and '.join(rubbing)} and without it at the others"
    )


def _bodies_of(study: ImpactStudy) -> str:
    yielding = [one.label for one in study.levels.values() if "plastic" in one.energies]
    if not yielding:
        return "Linear elastic, isotropic bodies"
    return (
        f"Isotropic bodies whose faces yield at {' and '.join(yielding)}, otherwise linear elastic,"
    )


def _limits(study: ImpactStudy) -> tuple[tuple[str, str], ...]:
    tops = [
        f"{quantity(float(body.frequencies[-1]), 'Hz', 3)} ({body.name})"
        for body in study.bodies
        if body.frequencies.size
    ]
    limits = [
        (
            "Physics",
            f"{_bodies_of(study)} with small deformations; {_contact_of(study)}; no "
            f"fluid{'' if study.contact.layer else ', no roughness'}.",
        ),
        (
            "Reduced level",
            "Motion and force along the axis, with one pressure pattern. Eccentric, tilted or "
            "partial contact is outside its assumption, and no number of modes corrects "
            f"that{'' if study.is_row else ': use the interface level'}.",
        ),
        (
            "Resolution",
            f"The elements across the contact are {study.contact.size_ratio:.2g} half widths "
            "long; up to 1 is good, above 1.5 is doubtful. All levels share the same meshes: "
            "their agreement does not reveal the error of the meshes."
            if isfinite(study.contact.size_ratio)
            else "The bodies meet at ports, without contact points: neither their models nor the "
            "local law are checked against a mesh.",
        ),
    ]
    if tops:
        limits.append(
            (
                "Frequency",
                f"The highest kept modes lie at {listed(tops)}. Above the lower of them the "
                "reduced level represents the bodies only by their static compliance.",
            )
        )
    limits.append(
        (
            "Damping",
            "Losses in joints, fluid and material are included only as far as the case "
            "specifies modal damping; residual vibration therefore rings longer than in a real "
            "valve.",
        )
    )
    return tuple(limits)
