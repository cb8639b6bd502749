"""The map of a drawn magnet: its record, the run, what is told of it, and its report.

``result.zarr/study/linkage`` is the flux linkage over current (rows) and gap.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from time import perf_counter

import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure
from numpy.typing import NDArray

from klack.analyses.analysis import Measured, StoredAnalysis
from klack.analyses.json_parts import CASE, JsonForm, Key, Real, measured_keys, schema_key
from klack.analyses.magnet.case import MagnetCase
from klack.analyses.measures import (
    Column,
    Measure,
    described_in,
    glossary,
    page_cells,
    page_heads,
    text_table,
)
from klack.analyses.page import page_of
from klack.analyses.record import CaseRecord, case_fields, run_fields
from klack.analyses.store import RecordFormat
from klack.case.placed_errors import tells_place
from klack.errors import InputError, refuse_if
from klack.machine.progress import Progress, silent
from klack.machine.stages import StageClock
from klack.magnetics.drawn_magnet import FieldMap
from klack.magnetics.flux_map import FluxMap, ForceComparison
from klack.mesh.profile import Profile
from klack.report.chart import AxisSpec, Chart, Curve, Panel
from klack.report.looks import LOOKS, OTHER
from klack.report.page import Content, Picture, Section, Table
from klack.report.printed import STYLE, plain, svg
from klack.report.wording import printed_unit, quantity, share
from klack.terminal.tables import TextTable
from klack.units import format_si

__all__ = ["MAGNET", "MAP_NAME", "MagnetRecord", "magnet_charts", "magnet_content", "run_magnet"]

Vector = NDArray[np.float64]

MAP_NAME = "map.csv"
_DOUBTFUL = 0.02  # error of a map, of its largest value
_FEW_POINTS = 0.05  # force by virtual work, of the largest one
_SATURATED = 1e-3  # share of a volume beyond the last point of its curve
_CURVES = 6  # of a chart


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Outline:
    """Section of a part: ``role`` is ``fixed``, ``moving`` or ``coil``; points (k, 2) [m]."""

    name: str
    role: str
    points: Vector


@dataclass(frozen=True, kw_only=True, eq=False)
class MagnetRecord(CaseRecord):
    """Map of a drawn magnet; see :class:`~klack.magnetics.drawn_magnet.FieldMap`.

    Parameters
    ----------
    virtual_work [-]
        See :class:`~klack.magnetics.flux_map.ForceComparison`, ``share``.
    beyond [-]
        Largest share of the volume of a part beyond the last point of its curve.
    outlines
        At the first gap.
    """

    current: Vector
    gap: Vector
    linkage: Vector
    force: Vector
    linkage_mesh: Vector
    force_mesh: Vector
    linkage_air: Vector
    force_air: Vector
    virtual_work: float
    beyond: float
    outlines: tuple[Outline, ...]

    @property
    def map(self) -> FieldMap:
        """The fields as a map."""
        names = ("linkage", "force", "linkage_mesh", "force_mesh", "linkage_air", "force_air")
        return FieldMap(
            current=self.current,
            gap=self.gap,
            beyond=np.full(self.force.shape, self.beyond),
            **{name: getattr(self, name) for name in names},
        )


def _largest(error: Vector, value: Vector) -> float:
    return float(np.max(np.abs(error)) / (np.max(np.abs(value)) or 1.0))


MAGNET_MEASURES: tuple[Measure[MagnetRecord], ...] = described_in(
    "theory/solenoid",
    Measure(
        key="largest_force",
        symbol="F_max",
        unit="N",
        definition="Largest pull of the map.",
        read=lambda record: float(-record.force.min()),
        column=Column("N", 1.0, ".4g"),
        page=True,
    ),
    Measure(
        key="force_error_of_mesh",
        definition="Twice the largest change of a force with a mesh of twice the size, over the "
        "largest force.",
        read=lambda record: _largest(record.force_mesh, record.force),
        form="share",
        column=Column("%", 100.0, ".2g"),
        page=True,
    ),
    Measure(
        key="force_error_of_air",
        definition="Largest change of a force with half as much surrounding air, over the "
        "largest force; several times the true error.",
        read=lambda record: _largest(record.force_air, record.force),
        form="share",
        column=Column("%", 100.0, ".2g"),
        page=True,
    ),
    Measure(
        key="linkage_error",
        definition="Both errors of a flux linkage, over the largest linkage.",
        read=lambda record: _largest(record.map.linkage_error, record.linkage),
        form="share",
        column=Column("%", 100.0, ".2g"),
        page=True,
    ),
    Measure(
        key="virtual_work",
        definition="Largest difference between a force and the slope of the co-energy from the "
        "linkages, over the largest force; few gaps or currents increase it.",
        form="share",
        read=lambda record: record.virtual_work,
        column=Column("%", 100.0, ".2g"),
        page=True,
    ),
)


@tells_place
def run_magnet(case: MagnetCase, *, progress: Progress = silent) -> MagnetRecord:
    """Compute the map.

    InputError for a force that opens the gap, or linkages too rough for a map; MissingExtraError
    without NGSolve.
    """
    begin, clock, drawing = perf_counter(), StageClock(progress), case.magnet
    found = drawing.magnet.field_map(
        drawing.current, drawing.gap, mesh_size=drawing.mesh_size, progress=clock
    )
    strongest = float(np.max(np.abs(found.force)))
    refuse_if(
        strongest <= np.max(found.force_error),
        "magnet.moving",
        got=f"a force of {format_si(strongest, 'N', 2)} at most, no more than its error",
        expected="iron that is attracted by the coil",
        hint="correct the position of iron or coil in the drawing.",
    )
    if np.all(found.force[-1] >= 0.0):
        other = "downward" if drawing.opens == "upward" else "upward"
        raise InputError(
            "magnet.opens",
            got=f"a force that opens the gap at {found.current[-1]:g} A and every gap",
            expected="a force that closes the gap",
            hint=f"opens: {other}, if the gap opens in the other direction, or correct the "
            f"drawing.",
        )
    try:
        made = FluxMap.of(current=found.current, gap=found.gap, linkage=found.linkage, force=None)
    except InputError as error:
        raise InputError(
            "magnet.current",
            got=error.got,
            expected=error.expected,
            hint="more currents where the iron begins to saturate, or more gaps.",
        ) from None
    table = [found.current, found.linkage, found.force]
    if found.current[0] > 0.0:  # no field without a current
        table = [np.append(0.0, table[0]), *(np.pad(v, ((1, 0), (0, 0))) for v in table[1:])]
    compared = made.compare_force(*table)
    beyond = float(np.max(found.beyond))
    return MagnetRecord(
        **case_fields(case),
        **run_fields(begin, clock, "ngsolve"),
        current=found.current,
        gap=found.gap,
        linkage=found.linkage,
        force=found.force,
        linkage_mesh=found.linkage_mesh,
        force_mesh=found.force_mesh,
        linkage_air=found.linkage_air,
        force_air=found.force_air,
        virtual_work=compared.share,
        beyond=beyond,
        outlines=_outlines(case),
        warnings=(*_doubts(found, beyond), *_work_doubts(compared)),
    )


def _doubts(found: FieldMap, beyond: float) -> Iterator[str]:
    if found.error > _DOUBTFUL:
        yield (
            f"the error of the map is {share(found.error)} of its largest value. Try: a smaller "
            "mesh_size, or more distance between the parts where they nearly touch."
        )
    if beyond > _SATURATED:
        yield (
            f"{share(beyond)} of the volume of a part lies beyond the last measured point of its "
            "magnetisation curve, where the curve continues as saturated. Try: points up to a "
            "higher flux density, or smaller currents."
        )


def _work_doubts(compared: ForceComparison) -> Iterator[str]:
    if compared.share > _FEW_POINTS:
        low, high, gap = compared.step
        yield (
            f"a stroke derives the force from the linkages: at {compared.current:.4g} A and a "
            f"gap of {format_si(compared.gap, 'm')} that gives {compared.derived:.4g} N, but the "
            f"fields give {compared.given:.4g} N ({share(compared.share)} of the largest force). "
            f"The points are too far apart, mainly from {low:.4g} A to {high:.4g} A at "
            f"{format_si(gap, 'm')}. Try: more currents there, or more gaps."
        )


def _outlines(case: MagnetCase) -> tuple[Outline, ...]:
    magnet = case.magnet.magnet
    raised = np.array([0.0, magnet.opens * case.magnet.gap[0]])

    def points(profile: Profile) -> Vector:
        return np.array([curve.start for curve in profile.curves])

    return (
        *(Outline(name=p.name, role="fixed", points=points(p.profile)) for p in magnet.fixed),
        *(
            Outline(name=p.name, role="moving", points=points(p.profile) + raised)
            for p in magnet.moving
        ),
        Outline(name="coil", role="coil", points=points(magnet.coil)),
    )


_MAGNET = JsonForm(
    "MagnetJson",
    "``klack magnet``.",
    schema_key("klack-magnet/1"),
    *CASE,
    *measured_keys(MAGNET_MEASURES),
    Key("current_A", list[float], of="current"),
    Key("gap_m", list[float], of="gap"),
    Key("linkage_Wb", list[list[float]], "A row for each current.", "linkage"),
    Key("force_N", list[list[float]], "Negative where it closes the gap.", "force"),
    Key("linkage_mesh_error_Wb", list[list[float]], of="linkage_mesh"),
    Key("force_mesh_error_N", list[list[float]], of="force_mesh"),
    Key("linkage_air_error_Wb", list[list[float]], of="linkage_air"),
    Key("force_air_error_N", list[list[float]], of="force_air"),
    Key("beyond_curve", float, "Largest share of the volume of a part beyond its curve.", "beyond"),
    Key("wall_time_s", Real, of="wall_time"),
    Key("warnings", list[str]),
)
_HEADS = ("gap", "linkage", "its error", "force", "error of the mesh", "error of the air")


def _rows(record: MagnetRecord, text: Callable[..., str]) -> Iterator[tuple[str, ...]]:
    """At the largest current."""
    found = record.map
    for j, gap in enumerate(record.gap):
        yield (
            text(float(gap), "m", 4),
            text(float(found.linkage[-1, j]), "Wb", 4),
            text(float(found.linkage_error[-1, j]), "Wb", 2),
            text(float(found.force[-1, j]), "N", 4),
            text(abs(float(found.force_mesh[-1, j])), "N", 2),
            text(abs(float(found.force_air[-1, j])), "N", 2),
        )


def _told(record: MagnetRecord) -> Iterator[TextTable]:
    title = f"At {format_si(float(record.current[-1]), 'A')}"
    yield TextTable(title=title, columns=_HEADS, rows=list(_rows(record, format_si)))
    yield text_table(record.title, "magnet", MAGNET_MEASURES, [(record.case, record)])


def _measured(record: MagnetRecord) -> Iterator[Measured]:
    yield record.case, record, MAGNET_MEASURES


def magnet_charts(record: MagnetRecord) -> tuple[Chart, ...]:
    """Force and linkage over the gap, at several currents."""
    chosen = np.unique(np.linspace(0, len(record.current) - 1, _CURVES).round().astype(int))
    unit, factor = printed_unit(record.gap, "m")
    panels = []
    for label, values, si in (("force", -record.force, "N"), ("linkage", record.linkage, "Wb")):
        shown, scale = printed_unit(values, si)
        curves: list[Curve] = [
            (LOOKS[n] if n < len(LOOKS) else OTHER).curve(
                factor * record.gap, scale * values[k], quantity(float(record.current[k]), "A")
            )
            for n, k in enumerate(reversed(chosen))
        ]
        panels.append(Panel(y=AxisSpec(label=label, unit=shown), curves=tuple(curves)))
    return (
        Chart(
            name="magnet-map",
            title="Pull and flux linkage",
            x=AxisSpec(label="gap", unit=unit),
            panels=tuple(panels),
            note="Straight lines between the computed points; positive where it pulls.",
        ),
    )


_TINTS = {"fixed": "#b9c7d6", "moving": "#e3cfa4", "coil": "#d98e73"}


def _drawing(record: MagnetRecord) -> Picture:
    everything = np.concatenate([outline.points for outline in record.outlines])
    height = np.ptp(everything[:, 1]) / max(everything[:, 0].max(), np.ptp(everything[:, 1]))
    with rc_context(STYLE | {"axes.grid": False}):
        figure = Figure(figsize=(6.7, max(4.5 * float(height), 2.0)), layout="constrained")
        axes = figure.subplots()
        for outline in record.outlines:
            r, z = 1e3 * outline.points.T
            axes.fill(r, z, facecolor=_TINTS[outline.role], edgecolor="#22262b", linewidth=0.6)
            middle = 0.5 * (r.min() + r.max()), 0.5 * (z.min() + z.max())
            turned = 90 if np.ptp(z) > 2.0 * np.ptp(r) else 0
            axes.annotate(plain(outline.name), middle, ha="center", va="center", rotation=turned)
        axes.axvline(0, color="#22262b", linewidth=0.5, dashes=(8, 2, 2, 2))
        axes.set_aspect("equal")
        axes.set_xlabel("distance from the axis [mm]")
        axes.set_ylabel("height [mm]")
        gap = quantity(float(record.gap[0]), "m", 3)
        note = f"Half section at a gap of {gap}: fixed iron grey, moving iron yellow, coil red."
        return Picture(svg(figure), note)


def magnet_content(record: MagnetRecord) -> Content:
    """Report of a map."""
    rows = zip(page_heads(MAGNET_MEASURES), page_cells(MAGNET_MEASURES, record), strict=True)
    pull = MAGNET_MEASURES[0].on_page(record)
    return page_of(
        record,
        "Magnet",
        answer=f"The magnet pulls with {pull} at most, with an error of "
        f"{share(_largest(record.map.force_error, record.force), 2)} of it. {MAP_NAME} is the map "
        "for a force-map-solenoid.",
        numbers=Table(columns=("", "magnet"), rows=tuple(rows)),
        sections=(
            Section(title="Drawing", picture=_drawing(record)),
            Section(title="Map", charts=magnet_charts(record)),
            Section(
                title=f"At {quantity(float(record.current[-1]), 'A')}",
                tables=(Table(columns=_HEADS, rows=tuple(_rows(record, quantity))),),
            ),
        ),
        definitions=glossary(MAGNET_MEASURES),
        limits=(
            ("static", "No eddy currents, no hysteresis, no permanent magnets."),
            ("round", "Everything is a body of revolution, and moves along its axis."),
        ),
    )


MAGNET = StoredAnalysis(
    form=RecordFormat(
        name="klack magnet map",
        version=1,
        kind=MagnetRecord,
        command="klack magnet",
        units={
            "current": "A",
            "gap": "m",
            "points": "m",
            **{f"linkage{word}": "Wb" for word in ("", "_mesh", "_air")},
            **{f"force{word}": "N" for word in ("", "_mesh", "_air")},
        },
    ),
    page="magnet.analysis:magnet_content",
    json=_MAGNET.type,
    to_json=_MAGNET.json,
    told=_told,
    measures={"magnet": MAGNET_MEASURES},
    measured=_measured,
)
