"""Elements of a magnetic network as a case describes them.

The flux of an element counts from its first node to its second.  A gap that moves has the width
:math:`g = x + g_r`, or, with ``opens_from``, :math:`g = g_o + (x_0 - x) + g_r`, with ``x`` the
working gap of the network, ``x_0`` that at the start and ``g_r`` the residual gap.
"""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from math import pi, sqrt
from typing import Annotated, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from klack.arrays import Vector
from klack.input.problem import refuse_key_if
from klack.input.section import Name, Number, Section
from klack.magnetics.circuit import MagneticBranch
from klack.magnetics.iron import VACUUM_PERMEABILITY
from klack.magnetics.network_loops import Tube
from klack.magnetics.reluctance import GapReluctance, LinearReluctance, ReluctanceLaw
from klack.magnetics.solenoid_parts import EddyPart, IronPart, ParasiticGap, PoleGap
from klack.magnetics.tabulation import hermite_grid
from klack.units import Area, Current, FluxDensity, Length, Permeance, Resistance

__all__ = ["MovingGap", "NetworkElement", "WorkingGaps"]

_TREE, _REST, _LEAKAGE, _GAP = range(4)  # ranks: what the spanning tree takes first
_TOLERANCE = 1e-8

Between = Annotated[
    tuple[Name, Name],
    Field(description="Magnetic nodes at its ends; flux is positive from the first."),
]


@dataclass(frozen=True, slots=True, kw_only=True)
class WorkingGaps:
    """Working gap at the start, and the gaps for which laws are tabulated [m]."""

    start: float
    usable: tuple[float, float]


class _Element(Section):
    between: Between

    @model_validator(mode="after")
    def _two_nodes(self) -> Self:
        refuse_key_if(
            self.between[0] == self.between[1],
            ("between",),
            got=f"'{self.between[0]}' twice",
            expected="two different nodes",
            hint="every element joins two nodes.",
        )
        return self

    def tubes(self, name: str, gaps: WorkingGaps) -> tuple[Tube, ...]:
        raise NotImplementedError

    def _tube(
        self,
        name: str,
        law: ReluctanceLaw,
        rank: int,
        *,
        eddy: float = 0.0,
        turns: float = 0.0,
        mmf: float = 0.0,
        circuit: str = "",
    ) -> tuple[Tube, ...]:
        branch = MagneticBranch(
            name=name, law=law, eddy=eddy, turns=turns, remanence=mmf, circuit=circuit
        )
        return (Tube(branch=branch, start=self.between[0], end=self.between[1], rank=rank),)


class IronElement(IronPart, _Element):
    """A section of iron, with hysteresis if it is given."""

    kind: Literal["iron"]

    def tubes(self, name: str, gaps: WorkingGaps) -> tuple[Tube, ...]:
        """One branch with the magnetisation curve; a shell and its turn for each term of eddy."""
        if self.eddy is not None:
            return self._shells(name)
        law = self.material.curve().law(self.length, self.area)
        branch = MagneticBranch(name=name, law=law, stops=self.stops())
        return (Tube(branch=branch, start=self.between[0], end=self.between[1], rank=_TREE),)

    def _shells(self, name: str) -> tuple[Tube, ...]:
        at, end = self.between
        out = []
        for k, shell in enumerate(self.shells(), 1):
            inner = f"{name} shell {k}"
            turn = MagneticBranch(
                name=f"{name} turn {k}", law=LinearReluctance(0.0), eddy=shell.turn
            )
            iron = MagneticBranch(name=inner, law=shell.law, stops=shell.stops)
            out.append(Tube(branch=turn, start=at, end=inner, rank=_TREE))
            out.append(Tube(branch=iron, start=inner, end=end, rank=_REST))
            at = inner
        return tuple(out)


class MovingGap(_Element):
    """A gap that the armature changes."""

    residual_gap: Length = Field(gt=0, description="Magnetic gap that remains in the closed state.")
    opens_from: Length | None = Field(
        default=None,
        ge=0,
        description="Width at the start of a gap that opens while the others close, without the "
        "residual gap.",
    )

    @property
    def width(self) -> float:
        """Size of the face [m], at which a gap is none any more."""
        raise NotImplementedError

    def reluctance(self, gap: Vector) -> tuple[Vector, Vector]:
        """Reluctance [A/Wb] at its own width [m], and its derivative."""
        raise NotImplementedError

    def bounds(self, start: float) -> tuple[float, float]:
        """Working gaps [m] from where it is closed to where it is as wide as its face."""
        wide = max(self.width, 2.0 * start + self.residual_gap)
        if self.opens_from is None:
            return 0.0, wide
        return start + self.opens_from - wide, start + self.opens_from

    def tubes(self, name: str, gaps: WorkingGaps) -> tuple[Tube, ...]:
        """One branch whose reluctance depends on the working gap."""
        low, high = gaps.usable
        ends = sorted({low, min(max(2.0 * gaps.start, low), high), high})
        law = self._law(gaps.start)
        grids = [hermite_grid(law, a, b, tolerance=_TOLERANCE) for a, b in pairwise(ends)]
        points = np.unique(np.concatenate(grids))
        return self._tube(name, GapReluctance.of(law, points), _GAP)

    def _law(self, start: float) -> Callable[[Vector], tuple[Vector, Vector]]:
        def closing(x: Vector) -> tuple[Vector, Vector]:
            return self.reluctance(x + self.residual_gap)

        def opening(x: Vector) -> tuple[Vector, Vector]:
            R, dR = self.reluctance((self.opens_from or 0.0) + start - x + self.residual_gap)
            return R, -dR

        return closing if self.opens_from is None else opening


class PoleElement(PoleGap, MovingGap):
    """A working gap between round faces, with its edge field."""

    kind: Literal["pole"]

    @model_validator(mode="after")
    def _axial(self) -> Self:
        refuse_key_if(
            self.tilts,
            ("tilts",),
            got="a pole that tilts its armature",
            expected="tilts: false",
            hint="for moments across the axis use the component 'solenoid'.",
        )
        return self

    @property
    def width(self) -> float:
        """Outer radius [m]."""
        return self.outer_radius


class FaceElement(MovingGap):
    r"""A working gap between flat faces, :math:`P = f\mu_0A/g` with a fringing factor ``f``."""

    kind: Literal["face"]
    area: Area = Field(gt=0, description="Of the faces.")
    fringing_factor: Number = Field(
        default=1.0, ge=1, description="Factor on the permeance for the field at the edges."
    )

    @property
    def width(self) -> float:
        """Radius of a round face of that area [m]."""
        return sqrt(self.area / pi)

    def reluctance(self, gap: Vector) -> tuple[Vector, Vector]:
        """Reluctance [A/Wb] at a gap [m], and its derivative by the gap."""
        slope = 1.0 / (VACUUM_PERMEABILITY * self.area * self.fringing_factor)
        return slope * gap, slope + 0.0 * gap


class AirElement(_Element):
    r"""A gap that does not move, :math:`P = f\mu_0A/l`."""

    kind: Literal["air"]
    length: Length = Field(gt=0, description="Along the flux.")
    area: Area = Field(gt=0, description="Across it.")
    fringing_factor: Number = Field(
        default=1.0, ge=1, description="Factor on the permeance for the field at the edges."
    )

    def tubes(self, name: str, gaps: WorkingGaps) -> tuple[Tube, ...]:
        """One branch of constant reluctance."""
        permeance = self.fringing_factor * VACUUM_PERMEABILITY * self.area / self.length
        return self._tube(name, LinearReluctance(1.0 / permeance), _REST)


class RingElement(ParasiticGap, _Element):
    """A gap round the armature or a joint: a ring, or a permeance."""

    kind: Literal["ring"]

    @model_validator(mode="after")
    def _centred(self) -> Self:
        return self._refuse_with(
            ("off_axis",), "kind: ring", "forces across the axis only in the component 'solenoid'"
        )

    def tubes(self, name: str, gaps: WorkingGaps) -> tuple[Tube, ...]:
        """One branch of constant reluctance."""
        return self._tube(name, LinearReluctance(self.reluctance), _REST)


class LeakageElement(_Element):
    """A leakage path."""

    kind: Literal["leakage"]
    permeance: Permeance = Field(gt=0, description="Of the path.")

    def tubes(self, name: str, gaps: WorkingGaps) -> tuple[Tube, ...]:
        """One branch of constant reluctance."""
        return self._tube(name, LinearReluctance(1.0 / self.permeance), _LEAKAGE)


class CoilElement(_Element):
    """Turns of a coil; several such elements of one electric circuit are in series."""

    kind: Literal["coil"]
    turns: Number = Field(
        description="Number of turns; a positive current drives flux from the first node to the "
        "second, with a negative number the reverse."
    )
    circuit: Name | None = Field(
        default=None,
        description="The circuit of the network that contains the coil; default: the one at the "
        "terminals.",
    )

    @model_validator(mode="after")
    def _wound(self) -> Self:
        refuse_key_if(
            self.turns == 0.0,
            ("turns",),
            got="0",
            expected="turns",
            hint="remove the coil, or give its turns.",
        )
        return self

    def tubes(self, name: str, gaps: WorkingGaps) -> tuple[Tube, ...]:
        """One branch without reluctance."""
        turns, circuit = float(self.turns), self.circuit or ""
        return self._tube(name, LinearReluctance(0.0), _TREE, turns=turns, circuit=circuit)


class ShortedCoil(_Element):
    r"""A winding closed through a resistance, such as a damping ring of one turn.

    Its current :math:`-N\dot\varphi/R` opposes the flux with :math:`N^2\dot\varphi/R`.
    """

    kind: Literal["shorted-coil"]
    turns: Number = Field(default=1.0, gt=0, description="Turns.")
    resistance: Resistance = Field(gt=0, description="Resistance of the whole closed circuit.")

    def tubes(self, name: str, gaps: WorkingGaps) -> tuple[Tube, ...]:
        """One branch with an eddy term."""
        eddy = float(self.turns) ** 2 / self.resistance
        return self._tube(name, LinearReluctance(0.0), _TREE, eddy=eddy)


class BiasCoil(_Element):
    """A winding with a constant current; what its source supplies counts as stored energy."""

    kind: Literal["bias-coil"]
    turns: Number = Field(gt=0, description="Turns.")
    current: Current = Field(description="Positive: drives flux from the first node.")

    def tubes(self, name: str, gaps: WorkingGaps) -> tuple[Tube, ...]:
        """One branch with a constant mmf."""
        mmf = float(self.turns) * self.current
        return self._tube(name, LinearReluctance(0.0), _TREE, mmf=mmf)


class MagnetElement(_Element):
    r"""A permanent magnet on its recoil line, magnetised from the first node to the second.

    .. math:: \Theta = \frac{l}{\mu_0\mu_r A}\,\varphi - \frac{B_r l}{\mu_0\mu_r}
    """

    kind: Literal["magnet"]
    remanence: FluxDensity = Field(gt=0, description="B_r at its temperature; NdFeB 1.0 to 1.4 T.")
    recoil_permeability: Number = Field(ge=1, description="mu_r of the recoil line.")
    length: Length = Field(gt=0, description="Along its magnetisation.")
    area: Area = Field(gt=0, description="Cross-section across it.")

    def tubes(self, name: str, gaps: WorkingGaps) -> tuple[Tube, ...]:
        """One branch with reluctance and constant mmf."""
        mu = VACUUM_PERMEABILITY * self.recoil_permeability
        law = LinearReluctance(self.length / (mu * self.area))
        return self._tube(name, law, _TREE, mmf=self.remanence * self.length / mu)


class EddyElement(EddyPart, _Element):
    """Eddy currents of solid iron in series: a ladder, without the reluctance of the iron."""

    kind: Literal["eddy"]

    def tubes(self, name: str, gaps: WorkingGaps) -> tuple[Tube, ...]:
        """One branch for one term; each further term adds a reluctance beside the one before."""
        ladder, at = self.ladder(), self.between[0]
        last = len(ladder.conductances) - 1
        out = []
        for k, conductance in enumerate(ladder.conductances):
            label = name if last == 0 else f"{name}.{k + 1}"
            zero = LinearReluctance(0.0)
            branch = MagneticBranch(name=label, law=zero, eddy=conductance)
            out.append(Tube(branch=branch, start=at, end=self.between[1], rank=_TREE))
            if k < last:
                inner = f"{name}.{k + 1} inside"
                core = MagneticBranch(name=inner, law=LinearReluctance(ladder.reluctances[k]))
                out.append(Tube(branch=core, start=at, end=inner, rank=_REST))
                at = inner
        return tuple(out)


NetworkElement = Annotated[
    IronElement
    | PoleElement
    | FaceElement
    | AirElement
    | RingElement
    | LeakageElement
    | CoilElement
    | ShortedCoil
    | BiasCoil
    | MagnetElement
    | EddyElement,
    Field(discriminator="kind"),
]
"""Any element of a network."""
