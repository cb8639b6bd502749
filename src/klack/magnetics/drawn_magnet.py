r"""Maps of force and flux linkage from the drawing of a magnet of revolution (NGSolve).

Parts of iron, those that move and those that do not, and a coil.  Unknown is the potential
:math:`A_\varphi`, cubic on triangles, zero on the axis and far away; it is where

.. math:: \int \Bigl[w(|B|) - J A_\varphi\Bigr] 2\pi r\,\mathrm dr\,\mathrm dz, \qquad
          B = \Bigl(-\frac{\partial A_\varphi}{\partial z},\
              \frac{\partial A_\varphi}{\partial r} + \frac{A_\varphi}{r}\Bigr),

is stationary, with the energy density ``w`` of the iron; Newton's method with a line search.  The
force is Maxwell's stress times the slope of a weight that is 1 on what moves and 0 on all other
solids (virtual work of the air between), the linkage :math:`N/S\int A_\varphi\,2\pi r`.

Two errors of every point: of the mesh, twice the difference to one of twice the size everywhere,
because fields at corners converge slowly; of the end of the air, on that mesh, the difference to a
potential of zero at half the distance.  The field far away is one of a dipole, so the latter is
several times the true one.

Limits: no magnets, no eddy currents, no hysteresis; one coil; motion along the axis.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations, product
from math import inf
from pathlib import Path
from typing import Any

import numpy as np

from klack.arrays import Vector
from klack.errors import (
    ConvergenceError,
    InputError,
    optional_package,
    refuse_if,
    require_nonnegative,
    require_positive,
)
from klack.machine.progress import Progress, silent
from klack.magnetics.iron import VACUUM_PERMEABILITY, IronCurve
from klack.mesh.occ import MM, plane_face
from klack.mesh.profile import Line, Profile
from klack.units import format_si

__all__ = ["DrawnMagnet", "DrawnPart", "FieldMap", "section"]


_ORDER = 3
_FAR = 5.0  # air around, over the size of the magnet
_COARSE = 2.0  # ratio of the two meshes
_MARGIN = 2.0  # of the error over their difference: up to 1.1 of it was found at corners
_SETTLED = 1e-6
_TOUCH = 1e-9  # [-] of an area: what touches as drawn may overlap by round-off
_NARROWEST = 2e-4  # air between parts, over the size of the magnet
_MOST_STEPS = 60


def section(*corners: tuple[float, float]) -> Profile:
    """Half section (r, z) [m]: its corners in turn; two of them are those of a rectangle."""
    if len(corners) == 2:
        (r, z), (far, high) = corners
        corners = ((r, z), (far, z), (far, high), (r, high))
    return Profile(corners[0], tuple(Line(corner) for corner in (*corners[1:], corners[0])))


@dataclass(frozen=True, slots=True, eq=False)
class DrawnPart:
    """Body of revolution of one iron, whose curve is known up to ``limit`` [T]."""

    name: str
    profile: Profile
    iron: IronCurve
    limit: float = inf


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FieldMap:
    """Linkage [Wb] and force [N], negative where it closes the gap, over current [A] and gap [m].

    Parameters
    ----------
    linkage_mesh, force_mesh
        Twice the differences to a mesh of twice the size everywhere.
    linkage_air, force_air
        Differences to half as much air around.
    beyond [-]
        Largest share of the volume of a part beyond its limit.
    """

    current: Vector
    gap: Vector
    linkage: Vector
    force: Vector
    linkage_mesh: Vector
    force_mesh: Vector
    linkage_air: Vector
    force_air: Vector
    beyond: Vector

    @property
    def linkage_error(self) -> Vector:
        """Both errors [Wb]."""
        return np.asarray(np.abs(self.linkage_mesh) + np.abs(self.linkage_air))

    @property
    def force_error(self) -> Vector:
        """Both errors [N]."""
        return np.asarray(np.abs(self.force_mesh) + np.abs(self.force_air))

    @property
    def error(self) -> float:
        """Largest error, of the largest linkage or force [-]."""
        pairs = ((self.linkage_error, self.linkage), (self.force_error, self.force))
        return max(float(np.max(e) / (np.max(np.abs(v)) or 1.0)) for e, v in pairs)

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
        Iron; parts of one group and one iron may touch or overlap.
    coil
        Section of the winding, with the turns spread evenly.
    opens
        1 where the moving parts rise along the axis as the gap opens, -1 where they sink.
    """

    fixed: tuple[DrawnPart, ...]
    moving: tuple[DrawnPart, ...]
    coil: Profile
    turns: float
    opens: int = 1

    def __post_init__(self) -> None:
        require_positive("DrawnMagnet: turns", self.turns, "1")
        refuse_if(
            self.opens not in (1, -1),
            "DrawnMagnet: opens",
            got=f"{self.opens}",
            expected="1 or -1",
            hint="1 if the moving parts rise as the gap opens, -1 if they descend.",
        )
        refuse_if(
            not (self.fixed and self.moving),
            "DrawnMagnet",
            got=f"{len(self.fixed)} fixed and {len(self.moving)} moving parts",
            expected="at least one of each",
            hint="draw the iron of fixed and moving parts.",
        )
        for part in self.fixed:
            refuse_if(
                _overlap(self.coil, part.profile),
                "DrawnMagnet: coil",
                got=f"a coil that overlaps '{part.name}'",
                expected="a section without iron; coil and iron may touch",
                hint="draw only the winding, without its bobbin, inside its window.",
            )
        for one, other in (*combinations(self.fixed, 2), *combinations(self.moving, 2)):
            refuse_if(
                one.iron is not other.iron and _overlap(one.profile, other.profile),
                f"DrawnMagnet: {other.name}",
                got=f"a part that overlaps '{one.name}', which has another iron",
                expected="one iron at every place; parts may touch",
                hint="let the two parts share only an edge.",
            )

    @property
    def extent(self) -> float:
        """Size of the magnet [m]: of its height and its radius the larger."""
        (_, low), (outer, high) = self._box()
        return max(high - low, outer)

    def _box(self) -> tuple[tuple[float, float], tuple[float, float]]:
        profiles = (self.coil, *(part.profile for part in (*self.fixed, *self.moving)))
        ends = np.array([curve.at(s) for p in profiles for curve in p.curves for s in (0.0, 0.5)])
        low, high = ends.min(axis=0), ends.max(axis=0)
        return (float(low[0]), float(low[1])), (float(high[0]), float(high[1]))

    def clearance(self, gap: float) -> tuple[float, str, str]:
        """Shortest distance [m] between what moves and what does not, and which parts."""
        still = [*((part.name, part.profile) for part in self.fixed), ("coil", self.coil)]
        return min(
            (self._moved(part, gap).Distance(plane_face(profile)) / MM, part.name, name)
            for part in self.moving
            for name, profile in still
        )

    def _moved(self, part: DrawnPart, gap: float) -> Any:
        return plane_face(part.profile).Move((0.0, self.opens * gap * MM, 0.0))

    def field_map(
        self,
        current: Sequence[float],
        gap: Sequence[float],
        *,
        mesh_size: float | None = None,
        progress: Progress = silent,
    ) -> FieldMap:
        """Compute the map on two meshes.

        Parameters
        ----------
        current, gap [A], [m]
            Increasing; currents from 0, gaps from 0.
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
            require_nonnegative(f"DrawnMagnet: {name}", float(values[0]), "A m"[2 * (values is x)])
        for j in x:
            self.require_resolved(float(j), mesh_size)
        points = np.zeros((3, 3, i.size, x.size))  # meshes and air, results, currents, gaps
        for j, width in enumerate(x):
            size = 0.5 * (mesh_size or self.clearance(float(width))[0])
            for first, coarse, ends in ((0, 1.0, ("far",)), (1, _COARSE, ("far", "near|far"))):
                progress("fields", (j + 0.6 * first) / x.size)
                mesh = _mesh(self, float(width), size, coarse)
                solutions = [_Solution(self, mesh, end) for end in ends]
                for c, amperes in enumerate(i):
                    for k, solution in enumerate(solutions):
                        if k:
                            solution.begin_at(solutions[0])
                        points[first + k, :, c, j] = solution.point(float(amperes))
        fine, rough, near = points
        return FieldMap(
            current=i,
            gap=x,
            linkage=fine[0],
            force=self.opens * fine[1],
            linkage_mesh=_MARGIN * (fine[0] - rough[0]),
            force_mesh=_MARGIN * self.opens * (fine[1] - rough[1]),
            linkage_air=rough[0] - near[0],
            force_air=self.opens * (rough[1] - near[1]),
            beyond=fine[2],
        )

    def require_resolved(self, gap: float, mesh_size: float | None) -> None:
        """Raise where parts touch at a working gap [m], or a mesh does not resolve the air."""
        least, moving, still = self.clearance(gap)
        where = f"DrawnMagnet at a gap of {format_si(gap, 'm')}"
        refuse_if(
            least <= _NARROWEST * self.extent,
            where,
            got=f"'{moving}' that touches '{still}'"
            if least <= 0.0
            else f"{format_si(least, 'm')} of air between '{moving}' and '{still}'",
            expected=f"more than {format_si(_NARROWEST * self.extent, 'm', 2)} of air "
            "between moving and fixed parts",
            hint="draw the residual gap too, or leave out this gap.",
        )
        if mesh_size is not None:
            require_positive("DrawnMagnet: mesh_size", mesh_size, "m")
            if mesh_size > least:
                raise InputError(
                    where,
                    got=f"a mesh of {format_si(mesh_size, 'm')} for {format_si(least, 'm')} of air",
                    expected="a mesh that resolves the air between moving and fixed parts",
                    hint=f"give a mesh_size of at most {format_si(least, 'm')}, or leave it out.",
                )


def _overlap(one: Profile, other: Profile) -> bool:
    shared = sum(face.mass for face in (plane_face(one) * plane_face(other)).faces) / MM**2
    return bool(shared > _TOUCH * min(one.area, other.area))


class _Solution:
    """Field on one mesh, zero at ``end``; ``point`` starts from the last current."""

    def __init__(self, magnet: DrawnMagnet, mesh: Any, end: str) -> None:
        self.ng = ng = optional_package("ngsolve", "fields of a drawn magnet", "ngsolve")
        self.mesh = mesh
        self.space = ng.H1(self.mesh, order=_ORDER, dirichlet=f"{end}|axis")
        self.potential = ng.GridFunction(self.space)
        u, r = self.space.TrialFunction(), ng.x
        B2 = self._density(u) * self._density(u)
        B = np.append(np.linspace(0.0, 2.4, 481), [4.0, 20.0])
        self.form = ng.BilinearForm(self.space, symmetric=True)
        whole, vacuum = 2 * np.pi * r, np.pi / VACUUM_PERMEABILITY * r
        self.limits = []
        for name, parts in _groups(magnet).items():
            curve = ng.BSpline(2, [0.0, *B], [*map(float, parts[0].iron.field(B))])
            # |B| is kept from 0, where its slope is not defined
            stored = (whole * curve.Integrate()(ng.sqrt(B2 + 1e-16))).Compile()
            self.form += ng.Variation(stored * ng.dx(definedon=mesh.Materials(name)))
            self.limits.append((mesh.Materials(name), min(part.limit for part in parts)))
        rest = mesh.Materials("air|coil")
        self.form += ng.Variation((vacuum * B2).Compile() * ng.dx(definedon=rest))
        turns = magnet.turns / magnet.coil.area * whole * self.space.TestFunction()
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
        weight.Set(1.0, definedon=mesh.Materials("moving.*"))
        rest = (stiffness * weight.vec).Evaluate()
        free = ~space.GetDofs(mesh.Materials("fixed.*|coil|moving.*")) & space.FreeDofs()
        weight.vec.data -= stiffness.Inverse(free, "sparsecholesky") * rest
        return weight

    def point(self, current: float) -> tuple[float, float, float]:
        """Linkage [Wb], force along the axis [N], share of iron beyond its limit [-]."""
        ng, r = self.ng, self.ng.x
        self._solve(current)
        B, slope = self._density(self.potential), ng.grad(self.weight)
        stress = (B[1] * (B * slope) - 0.5 * (B * B) * slope[1]) / VACUUM_PERMEABILITY
        air = self.mesh.Materials("air")
        force = -float(ng.Integrate(2 * np.pi * r * stress, self.mesh, definedon=air))
        linkage = float(ng.InnerProduct(self.load, self.potential.vec))
        return linkage, force, max(self._beyond(B, *limit) for limit in self.limits)

    def begin_at(self, other: "_Solution") -> None:
        """Start the next point from the field of another end on the same mesh."""
        keep = self.ng.Projector(self.space.FreeDofs(), True)
        self.potential.vec.data = keep * other.potential.vec

    def _beyond(self, B: Any, region: Any, limit: float) -> float:
        if limit == inf:
            return 0.0
        ng, r = self.ng, self.ng.x
        high = r * ng.IfPos(B * B - limit**2, 1.0, 0.0)
        above, volume = (ng.Integrate(f, self.mesh, definedon=region) for f in (high, r))
        return float(above / volume)

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


def _groups(magnet: DrawnMagnet) -> dict[str, list[DrawnPart]]:
    """Parts of one iron that move together, by the name of their region."""
    curves = list({id(part.iron): 0 for part in (*magnet.fixed, *magnet.moving)})
    groups: dict[str, list[DrawnPart]] = {}
    for word, parts in (("fixed", magnet.fixed), ("moving", magnet.moving)):
        for part in parts:
            groups.setdefault(f"{word}{curves.index(id(part.iron))}", []).append(part)
    return groups


def _mesh(magnet: DrawnMagnet, gap: float, size: float, coarse: float) -> Any:
    """Triangles of a size [m] at the corners of the iron; all sizes times ``coarse``."""
    ng = optional_package("ngsolve", "fields of a drawn magnet", "ngsolve")
    from netgen import occ

    extent = magnet.extent * MM
    (_, low), (_, high) = magnet._box()
    middle, reach = 0.5 * (low + high) * MM, _FAR * extent

    def air(reach: float, name: str) -> Any:
        face = occ.MoveTo(0.0, middle - reach).Rectangle(reach, 2.0 * reach).Face()
        face.edges.name = name
        return face

    iron = []
    for name, parts in _groups(magnet).items():
        faces = [magnet._moved(part, gap if name.startswith("moving") else 0.0) for part in parts]
        body = sum(faces[1:], faces[0])
        body.faces.name, body.faces.maxh = name, coarse * extent / 20
        for vertex in body.vertices:
            vertex.maxh = coarse * size * MM
        iron.append(body)
    coil = plane_face(magnet.coil)
    coil.faces.name = "coil"
    near = air(0.5 * reach, "near")
    around = air(reach, "far") - near
    for body in (*iron, coil):
        near = near - body
    near.faces.name = around.faces.name = "air"
    shape = occ.Glue([*iron, coil, near, around])
    for edge in shape.edges:
        if abs(edge.center.x) < 1e-9 * extent:
            edge.name = "axis"
    made = occ.OCCGeometry(shape, dim=2).GenerateMesh(maxh=coarse * reach / 5, grading=0.3)
    made.Scale(1.0 / MM)
    return ng.Mesh(made)
