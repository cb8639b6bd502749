"""The solenoid of a valve: coil, pole gaps, iron, leakage, eddy currents."""

from functools import lru_cache
from itertools import pairwise
from math import cos, inf, sin
from typing import Any, ClassVar, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from klack.errors import refuse_if
from klack.input.problem import refuse_key_if
from klack.input.section import Number
from klack.magnetics.circuit import MOST_LOOPS, MagneticBranch, MagneticCircuit
from klack.magnetics.gap_range import GapRange
from klack.magnetics.insulation import InsulationClass
from klack.magnetics.magnet_rows import magnet_rows, main_circuit
from klack.magnetics.reluctance import GapReluctance, LinearReluctance
from klack.magnetics.side_pull import ArmaturePull, ArmatureRing
from klack.magnetics.solenoid_parts import (
    EddyPart,
    IronPart,
    ParasiticGap,
    PermanentMagnet,
    PoleGap,
)
from klack.magnetics.tabulation import hermite_grid
from klack.magnetics.winding import REFERENCE_TEMPERATURE, WindingTemperature
from klack.network.across import OffAxisPart
from klack.network.component import Component
from klack.network.port import COIL, ELEMENT, Port
from klack.network.rows import Rows
from klack.units import Current, Flux, Length, Permeance, Ratio, Resistance

__all__ = ["Solenoid"]

_MAIN, _LEAKAGE = 0, 1
_TABLE_TOLERANCE = 1e-8


class Solenoid(Component):
    r"""Coil that pulls an armature by magnetic flux.

    The main flux :math:`\varphi` passes the pole gaps, the parasitic gaps and the iron in series;
    a leakage flux passes the coil only:

    .. math::

        N i = \Bigl[\sum_k R_k(x) + \sum_k R_{p,k}\Bigr]\varphi + \sum_j l_j H_j(\varphi/A_j)
              - \Theta_0 + \Theta_\text{eddy}, \qquad
        N i = \varphi_\text{leak}/\Lambda, \qquad
        u = R i + N\,\frac{\mathrm d}{\mathrm dt}(\varphi + \varphi_\text{leak}) .

    The force on the armature is :math:`-\tfrac12\varphi^2\,\sum R_k'(x)` along the gap ``x`` of all
    poles; ``base`` feels the opposite one.  The leakage is a state of its own because without it
    the current would jump with the voltage (eddy currents carry no inductance), and a two-point
    driver would switch without end.

    ``residual_gap`` is what stays open when iron would touch: coating, shim, roughness.
    ``residual_flux`` sets a constant remanence with this flux through the closed gap without
    current; it lets an armature stick.  Instead, ``hysteresis`` of an iron part follows its loop
    from the demagnetised state.  ``magnets`` are permanent ones in series with the main flux.  Eddy
    currents are a ladder beside the iron (``eddy``), or of an iron part itself, with its present
    permeability (:mod:`klack.magnetics.solid_iron`).

    The stops have to end the stroke before the working gap is closed, or the case is rejected; a
    run stops where contacts yield by half of the residual gap.

    A ring of ``parasitic`` with a section ``off_axis`` and a pole with ``tilts`` act across the
    axis of a needle that moves in three dimensions: :mod:`klack.magnetics.side_pull`.

    Limits: one-dimensional flux tubes; flux between armature side and housing (large strokes) needs
    a :class:`~klack.magnetics.circuit.MagneticCircuit` of your own, as in
    :mod:`klack.magnetics.lifting_magnet`.
    Sources: Woodson & Melcher 1968; Roters 1941; Stoll 1974 (eddy currents).
    """

    type: ClassVar[str] = "solenoid"
    ports: ClassVar = {
        "armature": ELEMENT,
        "base": Port("mechanical", ELEMENT.role, optional=True),
        "terminals": COIL,
    }

    turns: Number = Field(gt=0, description="Turns of the coil.")
    resistance: Resistance = Field(gt=0, description="Of coil and harness, at 20 degC.")
    winding_temperature: WindingTemperature = Field(
        default=REFERENCE_TEMPERATURE, description="Of the copper, -200 to 1085 degC."
    )
    insulation_class: InsulationClass = None
    gap: Length = Field(gt=0, description="Working gap at the start, without the residual gap.")
    closes: Literal["upward", "downward"] = Field(
        default="upward", description="Armature motion that closes the gap; upward opens a valve."
    )
    residual_gap: Length = Field(
        gt=0, description="Magnetic gap that remains when pole and armature touch."
    )
    poles: tuple[PoleGap, ...] = Field(
        min_length=1, description="Working gaps in series, all closed by the same stroke."
    )
    parasitic: tuple[ParasiticGap, ...] = Field(
        default=(), description="Further gaps in series, independent of the stroke."
    )
    iron: tuple[IronPart, ...] = Field(default=(), description="Iron parts in series.")
    magnets: tuple[PermanentMagnet, ...] = Field(
        default=(), description="Permanent magnets in series with the main flux."
    )
    leakage: Permeance | None = Field(
        default=None, gt=0, description="Permeance of the leakage of the coil; see leakage_share."
    )
    leakage_share: Ratio = Field(
        default=0.1,
        gt=0,
        description="Leakage as a share of the main permeance at the start gap, without iron; "
        "usually 5 to 15 %. Not used if 'leakage' is given.",
    )
    eddy: tuple[EddyPart, ...] = Field(default=(), description="Solid iron with eddy currents.")
    residual_flux: Flux = Field(
        default=0.0, ge=0, description="Main flux that remains without current with the gap closed."
    )
    start_current: Current = Field(
        default=0.0, ge=0, description="Steady (holding) current before the start."
    )
    start: Literal["demagnetised", "remanent"] = Field(
        default="demagnetised",
        description="State of iron with hysteresis at the start: as new, or as left by saturation.",
    )

    @model_validator(mode="after")
    def _few_loops(self) -> Self:
        solid = [part.eddy.terms for part in self.iron if part.eddy is not None]
        terms = [*(part.terms for part in self.eddy), *solid]
        loops = 2 + sum(count - 1 for count in terms)
        refuse_key_if(
            loops > MOST_LOOPS,
            ("iron",) if solid else ("eddy",),
            got=f"eddy currents of {' + '.join(map(str, terms))} terms",
            expected=f"at most {MOST_LOOPS - 2} terms beyond the first of each part",
            hint="give more terms to the part with the largest section, one to the others.",
        )
        return self

    @model_validator(mode="after")
    def _something_remanent(self) -> Self:
        refuse_key_if(
            self.start == "remanent" and not any(part.hysteresis for part in self.iron),
            ("start",),
            got="start: remanent without hysteresis",
            expected="a part of iron with hysteresis",
            hint="add hysteresis to a part, or remove 'start'.",
        )
        return self

    @model_validator(mode="after")
    def _one_remanence(self) -> Self:
        refuse_key_if(
            self.residual_flux > 0.0 and any(part.hysteresis for part in self.iron),
            ("residual_flux",),
            got="a residual flux together with iron with hysteresis",
            expected="one of them: the iron has its own remanence",
            hint="remove residual_flux, or the sections 'hysteresis'.",
        )
        return self

    def circuit(self) -> MagneticCircuit:
        """Magnetic circuit; its ``x`` is the gap without the residual gap."""
        return _kept_circuit(self) if type(self) is Solenoid else _circuit(self)

    def add_rows(self, rows: Rows) -> None:
        """Add the coil with its driver."""
        circuit = self.circuit()
        alone = magnet_rows(
            rows,
            circuit,
            {"terminals": main_circuit(self)},
            gap=self.gap,
            closing=self.closes == "upward",
            gap_range=self.gap_range(),
            remanent=self.start == "remanent",
        )
        if self.off_axis_parts():
            refuse_if(
                not alone,
                f"components.{rows.component}",
                got="off_axis or tilts with a driver that shares its boost capacitor",
                expected="forces across the axis only of a magnet with its own capacitor",
                hint="give the driver a capacitance of its own.",
            )
            rows.side_of_element(self._side_pull(circuit.loops.shape[1]))

    def off_axis_parts(self) -> tuple[OffAxisPart, ...]:
        """Rings and working gaps that act across the axis."""
        parts = []
        for k, ring in enumerate(self.parasitic):
            if ring.off_axis is not None and ring.length is not None:
                middle, half = ring.off_axis.height, 0.5 * ring.length
                room = (ring.clearance or 0.0) - ring.off_axis.eccentricity
                parts.append(
                    OffAxisPart(
                        key=("parasitic", k, "off_axis"),
                        port="armature",
                        heights=(middle - half, middle + half),
                        room=room,
                    )
                )
        for k, pole in enumerate(self.poles):
            if pole.tilts:
                key = ("poles", k, "tilts")
                parts.append(OffAxisPart(key=key, port="armature", heights=(), room=inf))
        return tuple(parts)

    def _side_pull(self, loops: int) -> ArmaturePull:
        rings = []
        for gap in self.parasitic:
            if gap.off_axis is None or gap.radius is None:
                continue
            at, turn = gap.off_axis, gap.off_axis.direction
            rings.append(
                ArmatureRing(
                    inner=gap.radius,
                    outer=gap.radius + (gap.clearance or 0.0),
                    length=gap.length or 0.0,
                    height=at.height,
                    centre=(at.eccentricity * cos(turn), at.eccentricity * sin(turn)),
                )
            )
        return ArmaturePull(
            rings=tuple(rings),
            faces=tuple(pole for pole in self.poles if pole.tilts),
            loops=loops,
            gap=self.gap + self.residual_gap,
            way=-1.0 if self.closes == "upward" else 1.0,
        )

    def gap_range(self) -> GapRange:
        """Gaps [m] from touching poles to where a pole is no wider than its gap.

        A contact that yields closes some of the residual gap as well: warned of from a quarter, at
        half of it the run stops.
        """
        widest = max(pole.outer_radius for pole in self.poles)
        end = max(widest, 2.0 * self.gap + self.residual_gap)
        return GapRange(
            valid=(0.0, end),
            slack=0.25 * self.residual_gap,
            usable=(-0.5 * self.residual_gap, 2.0 * end),
        )

    def _gap_law(self) -> GapReluctance:
        known = self.gap_range()
        ends = (known.usable[0], 2.0 * self.gap + self.residual_gap, known.valid[1])
        return _gap_law(self.poles, self.residual_gap, ends)

    def _remanence(self, gap: GapReluctance, parasitic: float) -> float:
        """Constant mmf [A] that drives the residual flux through the closed circuit."""
        flux = self.residual_flux
        laws = [part.material.curve().law(part.length, part.area) for part in self.iron]
        iron = sum(float(law.mmf(flux, 0.0)) for law in laws)
        return (float(gap.reluctance_at(0.0)) + parasitic) * flux + iron


@lru_cache(maxsize=100)
def _kept_circuit(solenoid: Solenoid) -> MagneticCircuit:
    """Cached circuit: strokes of one valve share it while they keep its solenoid."""
    return _circuit(solenoid)


def _circuit(solenoid: Solenoid) -> MagneticCircuit:
    turns = float(solenoid.turns)
    gap = solenoid._gap_law()
    parasitic = sum(part.reluctance for part in solenoid.parasitic)
    leakage = solenoid.leakage
    if leakage is None:
        leakage = solenoid.leakage_share / (float(gap.reluctance_at(solenoid.gap)) + parasitic)
    branches = [
        MagneticBranch(
            name="gap", law=gap, turns=turns, remanence=solenoid._remanence(gap, parasitic)
        )
    ]
    if parasitic > 0.0:
        branches.append(MagneticBranch(name="parasitic", law=LinearReluctance(parasitic)))
    branches += [
        MagneticBranch(
            name=f"iron {k + 1}",
            law=part.material.curve().law(part.length, part.area),
            stops=part.stops(),
        )
        for k, part in enumerate(solenoid.iron)
        if part.eddy is None
    ]
    branches += [
        MagneticBranch(
            name=f"magnet {k + 1}", law=LinearReluctance(part.reluctance), remanence=part.mmf
        )
        for k, part in enumerate(solenoid.magnets)
    ]
    loops = [[1, 0] for _ in branches]
    branches.append(
        MagneticBranch(name="leakage", law=LinearReluctance(1.0 / leakage), turns=turns)
    )
    loops.append([0, 1])
    _add_ladders(branches, loops, solenoid.eddy)
    for k, part in enumerate(solenoid.iron):
        _add_shells(branches, loops, f"iron {k + 1}", part)
    width = max(len(row) for row in loops)
    matrix = np.array([row + [0] * (width - len(row)) for row in loops])
    return MagneticCircuit(branches=tuple(branches), loops=matrix, main="gap")


@lru_cache(maxsize=100)
def _gap_law(
    poles: tuple[PoleGap, ...], residual_gap: float, ends: tuple[float, ...]
) -> GapReluctance:
    """All poles in series, over the whole range of gaps; finest around the working gap.

    Cached, because strokes of one valve mostly differ in other numbers.
    """

    def reluctance(x: Any) -> tuple[Any, Any]:
        parts = [pole.reluctance(x + residual_gap) for pole in poles]
        return sum(R for R, _ in parts), sum(dR for _, dR in parts)

    grids = [
        hermite_grid(reluctance, start, end, tolerance=_TABLE_TOLERANCE)
        for start, end in pairwise(ends)
        if end > start
    ]
    return GapReluctance.of(reluctance, np.unique(np.concatenate(grids)))


def _add_ladders(
    branches: list[MagneticBranch], loops: list[list[int]], parts: tuple[EddyPart, ...]
) -> None:
    """Put the ladders in series with the main flux; each term after the first is a loop more.

    The first shorted turn encloses the main flux less that of the inner loop, and so on inwards.
    """
    width = 2
    for k, part in enumerate(parts):
        ladder, outer = part.ladder(), _MAIN
        for term, conductance in enumerate(ladder.conductances):
            row = [0] * width
            row[outer] = 1
            last = term == len(ladder.conductances) - 1
            if not last:
                row.append(-1)
            name = f"eddy {k + 1}.{term + 1}"
            branches.append(MagneticBranch(name=name, law=LinearReluctance(0.0), eddy=conductance))
            loops.append(row)
            if last:
                break
            inner = [0] * width + [1]
            law = LinearReluctance(ladder.reluctances[term])
            branches.append(MagneticBranch(name=f"core {k + 1}.{term + 1}", law=law))
            loops.append(inner)
            outer, width = width, width + 1


def _add_shells(
    branches: list[MagneticBranch], loops: list[list[int]], name: str, part: IronPart
) -> None:
    """Put solid iron in series with the main flux; each shell after the first is a loop more."""
    shells, outer, width = part.shells(), _MAIN, max(len(row) for row in loops)
    for k, shell in enumerate(shells):
        through = [0] * width
        through[outer] = 1
        turn = MagneticBranch(
            name=f"{name} turn {k + 1}", law=LinearReluctance(0.0), eddy=shell.turn
        )
        branches.append(turn)
        loops.append(through)
        shell_row = list(through)
        if k < len(shells) - 1:  # what lies further in is not in this shell
            shell_row.append(-1)
            outer, width = width, width + 1
        branches.append(
            MagneticBranch(name=f"{name} shell {k + 1}", law=shell.law, stops=shell.stops)
        )
        loops.append(shell_row)
