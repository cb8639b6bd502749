"""Content of a shots report."""

from collections.abc import Callable
from math import isfinite

import numpy as np

from klack.analyses.impact.pressure_figure import pressure_figure
from klack.analyses.impact.pressure_view import PressureView, pressure_rows, pressure_view
from klack.analyses.measures import Measure, glossary
from klack.analyses.page import page_of
from klack.analyses.sample import rank_correlation
from klack.analyses.shots.figures import (
    Shown,
    distribution_chart,
    force_traces_chart,
    height_traces_chart,
    peak_chart,
    rebound_chart,
    shots_map,
)
from klack.analyses.shots.record import (
    DRAWN,
    FIRST_IMPACT,
    FRICTION_LOSS,
    PLASTIC_LOSS,
    ROCKING,
    Shot,
    ShotColumns,
    ShotsStudy,
)
from klack.analyses.shots.wording import (
    degrees,
    drawn_section,
    largest_size,
    length_unit,
    plain,
    shot_name,
    shots_answer,
)
from klack.report.page import Content, Section, Table
from klack.report.wording import count, quantity, share, signed, signed_share

__all__ = ["shots_content"]

_LISTED = 100
_RELATED = 0.5
"""Least rank correlation that is worth a sentence."""


def shots_content(study: ShotsStudy) -> Content:
    """Texts, tables and figures of a study."""
    sections = [
        Section(
            title="Is the highest rebound the centred one?",
            paragraphs=(_rule(study),),
            charts=tuple(
                rebound_chart(study, shown)
                for shown in _drawn_numbers(study)
                if shown.column in ("eccentricity", "tilt")
                or abs(_related(study, shown)) > _RELATED
            ),
        ),
        Section(title="Placement of the shots", picture=shots_map(study)),
        Section(title="Distribution of the rebounds", charts=(distribution_chart(study),)),
        Section(title="Force and time of the first impact", charts=(peak_chart(study),)),
        Section(title="Over time", charts=(height_traces_chart(study), force_traces_chart(study))),
        _pressure(study),
        _drawn(study),
        _shots(study),
    ]
    return page_of(
        study,
        f"{study.shots.count} shots",
        subtitle=(f"seed {study.seed}",),
        answer=shots_answer(study),
        numbers=_number_table(study),
        sections=sections,
        definitions=_definitions(study),
        limits=_limits(study),
    )


# --------------------------------------------------------------------------- sections


def _rule(study: ShotsStudy) -> str:
    rank, text = study.rule.rank, "No shot rebounds as high as the centred impact."
    if rank:
        those = "One shot rebounds" if rank == 1 else f"{rank} shots rebound"
        text = f"{those} at least as high as the centred impact."
    related = {shown.label: _related(study, shown) for shown in _drawn_numbers(study)}
    related = {label: value for label, value in related.items() if abs(value) > _RELATED}
    if related:
        strongest = max(related, key=lambda label: abs(related[label]))
        grows = "rises" if related[strongest] > 0 else "falls"
        text += (
            f" Of the drawn quantities, the {strongest} has the strongest correlation with the "
            f"rebound height, which {grows} with it (rank correlation "
            f"{signed(related[strongest], 2)})."
        )
    return text


def _related(study: ShotsStudy, shown: Shown) -> float:
    return rank_correlation(shown.of(study.shots), study.shots.rebound_height)


def _drawn_numbers(study: ShotsStudy) -> list[Shown]:
    candidates = (
        Shown("eccentricity", "eccentricity", *length_unit(study.shots.eccentricity)),
        Shown("tilt", "tilt", "°", np.degrees(1.0)),
        Shown("force", "closing force", "N", 1.0),
        Shown("friction", "friction in the guide", "", 1.0),
        Shown("contact_friction", "friction between the faces", "", 1.0),
        Shown("waviness", "out-of-roundness, rms", "nm", 1e9),
    )
    varying = [shown for shown in candidates if _varies(study.shots, shown.column)]
    return varying or list(candidates[:2])


def _varies(shots: ShotColumns, column: str) -> bool:
    values = getattr(shots, column)
    return float(np.ptp(values)) > 1e-9 * largest_size(values)


def _pressure(study: ShotsStudy) -> Section:
    title = "Pressure in the contact"
    lowest = int(np.nanargmin(study.shots.restitution))
    names = {
        "centric": "centred impact",
        "highest": f"highest rebound, {shot_name(study.highest)}",
        "lowest": f"lowest restitution, {shot_name(lowest)}",
    }
    found = [
        # the first record holds the first touch
        pressure_view(names.get(key, key), record, float(record.time[0]) - 0.5 * study.step)
        for key, record in study.pressures.items()
    ]
    views: list[PressureView] = [view for view in found if view is not None]
    views = [view for view in views if view.places.shape == views[0].places.shape]
    if not views:
        return Section(title=title)
    columns = ("", *(view.title for view in views))
    return Section(
        title=title,
        picture=pressure_figure(views),
        tables=(Table(columns=columns, rows=pressure_rows(views)),),
    )


def _drawn(study: ShotsStudy) -> Section:
    facts = (
        ("guide", study.guide or "none"),
        ("friction between the faces", study.faces or "none"),
        ("surfaces", study.surfaces),
        ("moving mass", quantity(1e3 * study.mass, "g")),
        (
            "start",
            f"{study.speed:.4g}\N{NO-BREAK SPACE}m/s, {quantity(study.start_height, 'm', 3)} above "
            "first touch",
        ),
        ("kept elastic modes", " + ".join(count(number) for number in study.modes)),
        ("contact points", count(study.points)),
        ("time step", _step(study)),
    )
    return drawn_section(study, facts, "shots", study.shot_time)


def _step(study: ShotsStudy) -> str:
    text = quantity(study.step, "s", 3)
    if study.halvings:
        text += f", shots.step divided by {2**study.halvings}"
    if isfinite(study.step_change):
        text += f"; twice as long, it changes shots by {share(study.step_change)} of the limit"
    return text


def _shots(study: ShotsStudy) -> Section:
    shown = [column for column in _columns(study) if column[3] or _varies(study.shots, column[2])]
    rows = [("centred", *(text(study.centric.row(0)) for _, text, _, _ in shown))]
    for i in range(min(study.shots.count, _LISTED)):
        row = study.shots.row(i)
        mark = "\nhighest" if i == study.highest else ""
        rows.append((f"{i}{mark}", *(text(row) for _, text, _, _ in shown)))
    paragraphs: tuple[str, ...] = ()
    if study.shots.count > _LISTED:
        paragraphs = (f"The first {_LISTED} of {count(study.shots.count)} shots.",)
    return Section(
        title="All shots",
        paragraphs=paragraphs,
        tables=(Table(columns=("shot", *(title for title, *_ in shown)), rows=tuple(rows)),),
    )


_ShotText = Callable[[dict[str, float]], str]


def _columns(study: ShotsStudy) -> tuple[tuple[str, _ShotText, str, bool], ...]:
    unit, factor = length_unit(study.shots.rebound_height)
    return (
        ("eccentricity\n[µm]", _fixed("eccentricity", 1e6, 2), "eccentricity", True),
        ("towards\n[°]", lambda row: degrees(row["direction"]), "direction", False),
        ("tilt\n[°]", _fixed("tilt", np.degrees(1.0), 4), "tilt", True),
        ("towards\n[°]", lambda row: degrees(row["tilt_direction"]), "tilt_direction", False),
        ("force\n[N]", _fixed("force", 1.0, 2), "force", False),
        ("friction\nguide", _fixed("friction", 1.0, 3), "friction", False),
        ("friction\nfaces", _fixed("contact_friction", 1.0, 3), "contact_friction", False),
        ("waviness\n[nm]", _fixed("waviness", 1e9, 0), "waviness", False),
        ("restitution", _fixed("restitution", 1.0, 4), "restitution", True),
        (f"rebound\n[{unit}]", _fixed("rebound_height", factor, 3), "rebound_height", True),
        ("peak\n[N]", _fixed("peak_force", 1.0, 1), "peak_force", True),
        ("contact\n[µs]", _fixed("contact_time", 1e6, 2), "contact_time", True),
        ("lost\n[%]", _fixed("friction_loss", 100.0, 1), "friction_loss", False),
    )


def _fixed(column: str, factor: float, decimals: int) -> _ShotText:
    return lambda row: plain(factor * row[column], decimals)


# --------------------------------------------------------------------------- numbers


def _number_table(study: ShotsStudy) -> Table:
    rows = [_number_row(study, measure) for measure in (*FIRST_IMPACT, *_shares(study))]
    worst = largest_size(study.shots.energy_residual)
    rows.append(("energy residual, largest", "", "", "", "", f"{worst:.1e}".replace("-", "−")))
    return Table(
        columns=(
            "",
            "centred impact",
            f"highest rebound\n{shot_name(study.highest)}",
            "mean",
            "standard deviation",
            f"range of {study.shots.count} shots",
        ),
        rows=tuple(rows),
    )


def _number_row(study: ShotsStudy, measure: Measure[Shot]) -> tuple[str, ...]:
    values = np.asarray(getattr(study.shots, measure.key))
    centred = float(getattr(study.centric, measure.key)[0])
    if not np.isfinite(values).any():
        return (measure.name, measure.printed(centred), *["–"] * 4)
    best = float(values[study.highest])
    apart, printed = best - centred, measure.printed
    bias = ""
    if measure in FIRST_IMPACT and measure.unit != "1":
        bias = f"\n{signed_share(apart / centred) if centred else '–'}"
    elif measure in FIRST_IMPACT:
        bias = f"\n{signed(apart, 4)}"
    return (
        measure.name,
        printed(centred),
        f"{printed(best)}{bias}",
        printed(float(np.nanmean(values))),
        printed(float(np.nanstd(values))),
        f"{printed(float(np.nanmin(values)))} to {printed(float(np.nanmax(values)))}",
    )


def _shares(study: ShotsStudy) -> tuple[Measure[Shot], ...]:
    rubbing = (FRICTION_LOSS,) if study.faces else ()
    yielding = (PLASTIC_LOSS,) if np.any(study.shots.plastic_loss) else ()
    return (ROCKING, *rubbing, *yielding)


# --------------------------------------------------------------------------- words

_CENTRED_RUBS = (
    " Friction between the faces is kept, with the mean coefficient: the faces of a centred "
    "valve also slip on each other."
)


def _definitions(study: ShotsStudy) -> tuple[tuple[str, str], ...]:
    drawn = [item for item in DRAWN if study.faces or item.key != "contact_friction"]
    return (
        (
            "shot",
            "One drop of the moving body onto its seat, with its bounces, at the interface "
            "level: both bodies as modes, a point-resolved contact, six rigid degrees of "
            "freedom of the moving body. Shots differ only in the quantities listed under "
            "'Distributions'.",
        ),
        (
            "centred impact",
            "The same drop without eccentricity, tilt, out-of-roundness and Coulomb friction in "
            "the guide, with the mean closing force." + (_CENTRED_RUBS if study.faces else ""),
        ),
        (
            "the rule, its bias",
            "Rebounds of dry shots scatter, and the highest one is usually taken for the centred "
            "impact. The bias is the highest value minus the centred one: the error of the "
            "rule for this valve. It depends on the number of shots and on the distributions.",
        ),
        *glossary((*drawn, *FIRST_IMPACT, *_shares(study))),
        (
            "pressure",
            "Force of a contact point, normal to the surface, over its area. Sums such as the line "
            "load are far more accurate than the pressure at one point.",
        ),
    )


def _limits(study: ShotsStudy) -> tuple[tuple[str, str], ...]:
    contact = (
        "contact of smooth surfaces with Coulomb friction, whose coefficient is the same at every "
        "point and in every impact of a shot"
        if study.faces
        else f"frictionless contact of faces with {study.layer}, which stay elastic"
        if study.layer
        else "frictionless contact of smooth surfaces"
    )
    return (
        (
            "Physics",
            f"Linear elastic bodies with small deformations; {contact}; no fluid, no plastic "
            "flow. Out-of-roundness is a fixed shape of the ring that differs from shot to shot.",
        ),
        (
            "Chance",
            "A different seed draws different shots: the highest of that many is itself a "
            "random number. The answer holds for the distributions stated, not for others.",
        ),
    )
