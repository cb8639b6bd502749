r"""Maps of force and flux linkage from the drawing of a magnet of revolution (NGSolve).

Rings of iron, those that move and those that do not, and a coil.  Unknown is the potential
:math:`A_\varphi`, cubic on triangles, zero on the axis and far away; it is where

.. math:: \int \Bigl[w(|B|) - J A_\varphi\Bigr] 2\pi r\,\mathrm dr\,\mathrm dz, \qquad
          B = \Bigl(-\frac{\partial A_\varphi}{\partial z},\
              \frac{\partial A_\varphi}{\partial r} + \frac{A_\varphi}{r}\Bigr),

is stationary, with the energy density ``w`` of the iron; Newton's method with a line search.  The
force is Maxwell's stress times the slope of a weight that is 1 on what moves and 0 on all other
solids (virtual work of the air between), the linkage :math:`N/S\int A_\varphi\,2\pi r`.

Limits: no magnets, no eddy currents, no hysteresis; one coil; motion along the axis.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from math import hypot
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from klack.errors import (
    ConvergenceError,
    InputError,
    optional_package,
    refuse_if,
    require_nonnegative,
    require_positive,
)
from klack.magnetics.iron import VACUUM_PERMEABILITY, IronCurve
from klack.units import format_si

__all__ = ["DrawnMagnet", "FieldMap", "Ring"]

Vector = NDArray[np.float64]

_ORDER = 3
_FAR = 5.0  # air around, over the size of the magnet
_COARSE = 2.0  # ratio of the two meshes
_SETTLED = 1e-6
_TOUCH = 1e-9  # of a radius: what touches as drawn may overlap by round-off
_MOST_STEPS = 60


@dataclass(frozen=True, slots=True)
class Ring:
    """Body of revolution with a rectangular section: radii, and ends along the axis [m]."""

    inner: float
    outer: float
    low: float
    high: float

    def __post_init__(self) -> None:
        if not (0.0 <= self.inner < self.outer and self.low < self.high):
            raise InputError(
                "Ring",
                got=f"radii {self.inner:g} and {self.outer:g} m, ends {self.low:g} and "
                f"{self.high:g} m",
                expected="inner radius below outer radius, lower end below upper end",
                hint="order: inner, outer, low, high, in m.",
            )

    def raised(self, way: float) -> "Ring":
        """Return it, moved along the axis [m]."""
        return Ring(self.inner, self.outer, self.low + way, self.high + way)

    def distance(self, other: "Ring") -> float:
        """Shortest distance [m]; 0 where they touch or overlap."""
        across = max(other.inner - self.outer, self.inner - other.outer, 0.0)
        along = max(other.low - self.high, self.low - other.high, 0.0)
        return hypot(across, along)

    def overlaps(self, other: "Ring") -> bool:
        """Whether both share more than an edge, round-off apart."""
        across = min(self.outer, other.outer) - max(self.inner, other.inner)
        along = min(self.high, other.high) - max(self.low, other.low)
        return min(across, along) > _TOUCH * max(self.outer, other.outer)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FieldMap:
    """Linkage [Wb] and force [N], negative where it closes the gap, over current [A] and gap [m].

    ``linkage_error`` and ``force_error`` are differences to a mesh of twice the size everywhere.
    """

    current: Vector
    gap: Vector
    linkage: Vector
    force: Vector
    linkage_error: Vector
    force_error: Vector

    @property
    def error(self) -> float:
        """Largest error, of the largest linkage or force [-]."""
        pairs = ((self.linkage_error, self.linkage), (self.force_error, self.force))
        return max(float(np.max(np.abs(e)) / (np.max(np.abs(v)) or 1.0)) for e, v in pairs)

    def write(self, file: Path) -> None:
        """Write the table that a ``force-map-solenoid`` reads: one row for each point."""
        lines = ['"Current [A]","gap [mm]","FluxLinkage [mWb]","Force [N]"']
        for (k, i), (j, x) in product(enumerate(self.current), enumerate(self.gap)):
            values = (i, 1e3 * x, 1e3 * self.linkage[k, j], self.force[k, j])
            lines.append(",".join(f"{value:.9g}" for value in values))
        file.write_text("\n".join(lines) + "\n", encoding="utf-8")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DrawnMagnet:
    """A magnet of revolution as drawn with its working gap closed.

    Parameters
    ----------
    fixed, moving
        Rings of iron; those of one group may touch or overlap.
    coil
        Section of the winding, with the turns spread evenly.
    opens
        1 where the moving rings rise along the axis as the gap opens, -1 where they sink.
    """

    fixed: tuple[Ring, ...]
    moving: tuple[Ring, ...]
    coil: Ring
    turns: float
    iron: IronCurve
    opens: int = 1

    def __post_init__(self) -> None:
        require_positive("DrawnMagnet: turns", self.turns, "1")
        refuse_if(
            self.opens not in (1, -1),
            "DrawnMagnet: opens",
            got=f"{self.opens}",
            expected="1 or -1",
            hint="1 where the moving rings rise as the gap opens, -1 where they sink.",
        )
        refuse_if(
            not (self.fixed and self.moving),
            "DrawnMagnet",
            got=f"{len(self.fixed)} fixed and {len(self.moving)} moving rings",
            expected="at least one of each",
            hint="give the iron as rings.",
        )
        refuse_if(
            any(self.coil.overlaps(ring) for ring in self.fixed),
            "DrawnMagnet: coil",
            got="a coil that overlaps a fixed ring",
            expected="a section without iron; both may touch",
            hint="draw the winding alone, without its bobbin.",
        )

    def clearance(self, gap: float) -> float:
        """Shortest distance [m] between what moves and what does not, at a working gap [m]."""
        moved = [ring.raised(self.opens * gap) for ring in self.moving]
        return min(a.distance(b) for a, b in product(moved, (*self.fixed, self.coil)))

    def field_map(
        self, current: Sequence[float], gap: Sequence[float], *, mesh_size: float | None = None
    ) -> FieldMap:
        """Compute the map on two meshes.

        Parameters
        ----------
        current, gap [A], [m]
            Increasing; gaps from 0.
        mesh_size [m]
            At corners of the iron, at most the shortest distance between what moves and what does
            not, which is the default.
        """
        i, x = np.array(current, dtype=float), np.array(gap, dtype=float)
        for name, values in (("current", i), ("gap", x)):
            refuse_if(
                not (values.size and np.all(np.isfinite(values)) and np.all(np.diff(values) > 0.0)),
                f"DrawnMagnet: {name}",
                got=f"{', '.join(f'{value:g}' for value in values)}" or "none",
                expected="increasing numbers",
                hint=f"give each {name} once, the smallest first, in SI.",
            )
        require_nonnegative("DrawnMagnet: gap", float(x[0]), "m")
        for j in x:
            self._require_resolved(float(j), mesh_size)
        tables = []
        for coarse in (1.0, _COARSE):
            columns = []
            for j in x:
                size = mesh_size or self.clearance(float(j))
                solution = _Solution(self, float(j), 0.5 * size, coarse)
                columns.append([solution.point(float(one)) for one in i])
            tables.append(np.array(columns).transpose(2, 1, 0))
        fine, rough = tables
        return FieldMap(
            current=i,
            gap=x,
            linkage=fine[0],
            force=self.opens * fine[1],
            linkage_error=fine[0] - rough[0],
            force_error=self.opens * (fine[1] - rough[1]),
        )

    def _require_resolved(self, gap: float, mesh_size: float | None) -> None:
        least = self.clearance(gap)
        if least <= 0.0:
            raise InputError(
                f"DrawnMagnet at a gap of {format_si(gap, 'm')}",
                got="a moving ring that touches a fixed one or the coil",
                expected="air between them",
                hint="draw the residual gap, too, or leave out that gap.",
            )
        if mesh_size is not None:
            require_positive("DrawnMagnet: mesh_size", mesh_size, "m")
            if mesh_size > least:
                raise InputError(
                    f"DrawnMagnet at a gap of {format_si(gap, 'm')}",
                    got=f"a mesh of {format_si(mesh_size, 'm')} for {format_si(least, 'm')} of air",
                    expected="a mesh that resolves the air between what moves and what does not",
                    hint=f"give a mesh_size of at most {format_si(least, 'm')}, or leave it out.",
                )


class _Solution:
    """Field at one gap; ``point`` starts from the last current."""

    def __init__(self, magnet: DrawnMagnet, gap: float, size: float, coarse: float) -> None:
        self.ng = ng = optional_package("ngsolve", "fields of a drawn magnet", "ngsolve")
        self.mesh = _mesh(magnet, gap, size, coarse)
        self.space = ng.H1(self.mesh, order=_ORDER, dirichlet="far|axis")
        self.potential = ng.GridFunction(self.space)
        u, r = self.space.TrialFunction(), ng.x
        B2 = self._density(u) * self._density(u)
        B = np.append(np.linspace(0.0, 2.4, 481), [4.0, 20.0])
        energy = ng.BSpline(2, [0.0, *B], [*map(float, magnet.iron.field(B))]).Integrate()
        iron, rest = self.mesh.Materials("fixed|moving"), self.mesh.Materials("air|coil")
        self.form = ng.BilinearForm(self.space, symmetric=True)
        whole, vacuum = 2 * np.pi * r, np.pi / VACUUM_PERMEABILITY * r
        # |B| is kept from 0, where its slope is not defined
        stored = (whole * energy(ng.sqrt(B2 + 1e-16))).Compile()
        self.form += ng.Variation(stored * ng.dx(definedon=iron))
        self.form += ng.Variation((vacuum * B2).Compile() * ng.dx(definedon=rest))
        coil = magnet.coil
        section = (coil.outer - coil.inner) * (coil.high - coil.low)
        turns = magnet.turns / section * whole * self.space.TestFunction()
        self.load = ng.LinearForm(turns * ng.dx("coil")).Assemble().vec
        self.weight = self._weight()

    def _density(self, u: Any) -> Any:
        slope = self.ng.grad(u)
        return self.ng.CF((-slope[1], slope[0] + u / self.ng.x))

    def _weight(self) -> Any:
        """1 on what moves, 0 on other solids and far away, harmonic in between."""
        ng, mesh = self.ng, self.mesh
        space = ng.H1(mesh, order=2, dirichlet="far")
        p, q = space.TnT()
        air = ng.dx(definedon=mesh.Materials("air"))
        stiffness = ng.BilinearForm(ng.grad(p) * ng.grad(q) * air).Assemble().mat
        weight = ng.GridFunction(space)
        weight.Set(1.0, definedon=mesh.Materials("moving"))
        rest = (stiffness * weight.vec).Evaluate()
        free = ~space.GetDofs(mesh.Materials("fixed|coil|moving")) & space.FreeDofs()
        weight.vec.data -= stiffness.Inverse(free, "sparsecholesky") * rest
        return weight

    def point(self, current: float) -> tuple[float, float]:
        """Linkage [Wb] and force along the axis [N]."""
        ng, r = self.ng, self.ng.x
        self._solve(current)
        B, slope = self._density(self.potential), ng.grad(self.weight)
        stress = (B[1] * (B * slope) - 0.5 * (B * B) * slope[1]) / VACUUM_PERMEABILITY
        air = self.mesh.Materials("air")
        force = -float(ng.Integrate(2 * np.pi * r * stress, self.mesh, definedon=air))
        return float(ng.InnerProduct(self.load, self.potential.vec)), force

    def _solve(self, current: float) -> None:
        ng, A = self.ng, self.potential.vec
        load = (current * self.load).Evaluate()
        residual, new = A.CreateVector(), A.CreateVector()

        def energy(v: Any) -> float:
            return float(self.form.Energy(v) - ng.InnerProduct(load, v))

        now = energy(A)
        for _ in range(_MOST_STEPS):
            self.form.AssembleLinearization(A)
            self.form.Apply(A, residual)
            residual.data -= load
            inverse = self.form.mat.Inverse(self.space.FreeDofs(), "sparsecholesky")
            step = (inverse * residual).Evaluate()
            decrement, t = float(ng.InnerProduct(step, residual)), 1.0
            new.data = A - step
            while energy(new) > now - 1e-4 * t * decrement + 1e-13 * abs(now) and t > 1e-3:
                t *= 0.5
                new.data = A - t * step
            A.data, now = new, energy(new)
            if decrement <= _SETTLED**2 * abs(now):
                return
        raise ConvergenceError(
            f"DrawnMagnet: the field at {current:g} A does not converge in {_MOST_STEPS} steps; "
            "give currents in smaller steps, or a smoother curve of the iron."
        )


def _mesh(magnet: DrawnMagnet, gap: float, size: float, coarse: float) -> Any:
    """Triangles of a size [m] at the corners of the iron; all sizes times ``coarse``."""
    ng = optional_package("ngsolve", "fields of a drawn magnet", "ngsolve")
    from netgen import occ

    def face(rings: Sequence[Ring]) -> Any:
        faces = [
            occ.MoveTo(r.inner, r.low).Rectangle(r.outer - r.inner, r.high - r.low).Face()
            for r in rings
        ]
        return sum(faces[1:], faces[0])

    moved = [ring.raised(magnet.opens * gap) for ring in magnet.moving]
    every = (*magnet.fixed, *moved, magnet.coil)
    low, high = min(r.low for r in every), max(r.high for r in every)
    extent = max(high - low, max(r.outer for r in every))
    reach = _FAR * extent
    fixed, moving, coil = face(magnet.fixed), face(moved), face([magnet.coil])
    air = face([Ring(0.0, reach, 0.5 * (low + high) - reach, 0.5 * (low + high) + reach)])
    air.edges.name = "far"
    air = air - fixed - moving - coil
    parts = {"fixed": fixed, "moving": moving, "coil": coil, "air": air}
    for name, part in parts.items():
        part.faces.name = name
        for edge in part.edges:
            if abs(edge.center.x) < 1e-9 * extent:
                edge.name = "axis"
    fixed.maxh = moving.maxh = coarse * extent / 20
    for part in (fixed, moving):
        for vertex in part.vertices:
            vertex.maxh = coarse * size
    shape = occ.OCCGeometry(occ.Glue([*parts.values()]), dim=2)
    return ng.Mesh(shape.GenerateMesh(maxh=coarse * reach / 5, grading=0.3))
