r"""A measured magnet (TEAM problem 20) by finite elements in space, and its network.

A quarter of the magnet: vector potential in H(curl) of order 2, without gradients inside elements
and a small term for those of the edges; the stationary point of
:math:`\int w(|\nabla\times A|) - J\cdot A` by Newton steps with a line search, ``w`` of klack's
curve of the iron.  Force by virtual work: Maxwell's stress times the gradient of a weight that is
1 on the pole and 0 on yoke and coil.
"""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import quad

from klack.magnetics.iron import VACUUM_PERMEABILITY, measured
from klack.verification.pole_in_yoke import FIELD, IRON, MEASURED, network_points

MM, FAR = 1e-3, 250.0
WALL, HEIGHT = 18.0 * MM, 96.6 * MM  # of the coil


def quarter_magnet(size: float):
    """Mesh of x > 0, y > 0, in mm of the drawing with the pole's axis at x = y = 0."""
    occ = pytest.importorskip("netgen.occ")
    import ngsolve as ng

    def box(x, y, z):
        low, high = (occ.Pnt(*(MM * v[k] for v in (x, y, z))) for k in (0, 1))
        return occ.Box(low, high)

    def square(half, radius):
        z, c = (26.7, 123.3), half - radius
        round_edge = occ.Cylinder(occ.Pnt(c * MM, c * MM, z[0] * MM), occ.Z, radius * MM, HEIGHT)
        sides = box((0, half), (0, c), z) + box((0, c), (0, half), z)
        return sides + round_edge * box((c, half), (c, half), z)

    hole, window = box((0, 13.5), (0, 12.5), (125, 150)), box((0, 38.5), (0, 12.5), (25, 125))
    yoke = box((0, 63.5), (0, 12.5), (0, 150)) - hole - window
    pole = box((0, 12.5), (0, 5), (26.5, 125))
    coil = square(37.5, 23) - square(19.5, 5)
    gap = box((0, 15), (0, 7.5), (25, 26.5))
    air = box((0, FAR), (0, FAR), (75 - FAR, 75 + FAR)) - yoke - pole - coil - gap
    solids = {"yoke": (yoke, 6), "pole": (pole, 2.5), "coil": (coil, 8), "gap": (gap, 1.2)}
    for name, (solid, maxh) in {**solids, "air": (air, 60)}.items():
        solid.mat(name)
        solid.maxh = maxh * size * MM
        for face in solid.faces:
            at = np.array([face.center.x, face.center.y, abs(face.center.z - 75 * MM)]) / MM
            if np.any(np.isclose(at[:2], 0.0)) or np.any(np.isclose(at, FAR)):
                face.name = "flux lines"
    pole.faces.Min(occ.Z).maxh, pole.faces.Max(occ.Z).maxh = size * MM, 1.2 * size * MM
    for edge in pole.faces.Min(occ.Z).edges:
        edge.maxh = 0.5 * size * MM
    glued = occ.OCCGeometry(occ.Glue([yoke, pole, coil, gap, air]))
    return ng.Mesh(glued.GenerateMesh(maxh=60 * size * MM, grading=0.35)).Curve(2)


class Field:
    """Vector potential of one mesh; ``solve`` starts from the last solution."""

    def __init__(self, mesh, order: int = 2):
        import ngsolve as ng

        self.ng, self.mesh = ng, mesh
        self.space = ng.HCurl(mesh, order=order, nograds=True, dirichlet="flux lines")
        B = np.append(np.linspace(0.0, 2.4, 481), [4.0, 20.0])
        curve = ng.BSpline(2, [0.0, *B], [*map(float, measured(*IRON.T).field(B))])
        u, energy = self.space.TrialFunction(), curve.Integrate()
        B2, nu, dx = ng.curl(u) * ng.curl(u), 1.0 / VACUUM_PERMEABILITY, ng.dx
        self.form = ng.BilinearForm(self.space, symmetric=True)
        iron, rest = mesh.Materials("yoke|pole"), mesh.Materials("air|gap|coil")
        self.form += ng.Variation(energy(ng.sqrt(B2 + 1e-16)).Compile() * dx(definedon=iron))
        self.form += ng.Variation((0.5 * nu * B2).Compile() * dx(definedon=rest))
        self.form += ng.Variation((0.5e-6 * nu / 0.02**2 * u * u).Compile() * dx)  # gauge
        self.inverse = ng.Preconditioner(self.form, "bddc", inverse="sparsecholesky")
        self.potential = ng.GridFunction(self.space)
        self.load = ng.LinearForm(self.space)
        self.load += self._current() * self.space.TestFunction() * dx(bonus_intorder=4)
        self.load.Assemble()
        self.weight = self._laplace(2, mesh.Materials("yoke|coil|pole"))

    def _current(self):
        """Current density of 1 A turn, freed of what is the gradient of an edge potential."""
        ng, c = self.ng, 14.5 * MM  # centre of the round edges
        x, y = ng.x - c, ng.y - c
        r = ng.sqrt(x * x + y * y + 1e-14)
        along = ng.IfPos(-x, ng.CF((-1, 0, 0)),
                         ng.IfPos(-y, ng.CF((0, 1, 0)), ng.CF((-y / r, x / r, 0))))  # fmt: skip
        J = self.mesh.MaterialCF({"coil": along / (WALL * HEIGHT)}, default=ng.CF((0, 0, 0)))
        space = ng.H1(self.mesh, order=1, dirichlet="flux lines")
        p, q = space.TnT()
        stiffness = ng.BilinearForm(ng.grad(p) * ng.grad(q) * ng.dx).Assemble().mat
        source = ng.LinearForm(J * ng.grad(q) * ng.dx(bonus_intorder=4)).Assemble().vec
        phi = ng.GridFunction(space)
        phi.vec.data = stiffness.Inverse(space.FreeDofs(), "sparsecholesky") * source
        return J - ng.grad(phi)

    def _laplace(self, order, solids):
        """Weight: harmonic in the air, 1 on the pole, 0 on the other solids."""
        ng, air = self.ng, self.mesh.Materials("air|gap")
        space = ng.H1(self.mesh, order=order)
        p, q = space.TnT()
        form = ng.BilinearForm(ng.grad(p) * ng.grad(q) * ng.dx(definedon=air)).Assemble().mat
        weight = ng.GridFunction(space)
        weight.Set(1.0, definedon=self.mesh.Materials("pole"))
        rest = (form * weight.vec).Evaluate()
        weight.vec.data -= form.Inverse(~space.GetDofs(solids), "sparsecholesky") * rest
        return weight

    def solve(self, ampere_turns: float, tolerance: float = 1e-5) -> None:
        """Newton steps until the decrement is below ``tolerance**2`` of the co-energy."""
        A, load = self.potential.vec, ampere_turns * self.load.vec
        residual, new = A.CreateVector(), A.CreateVector()

        def energy(v):
            return self.form.Energy(v) - self.ng.InnerProduct(load, v)

        load, now = load.Evaluate(), None
        for _ in range(40):
            now = energy(A) if now is None else now
            self.form.AssembleLinearization(A)
            self.form.Apply(A, residual)
            residual.data -= load
            self.inverse.Update()
            solver = self.ng.CGSolver(self.form.mat, self.inverse.mat, tol=1e-6, maxiter=400)
            step = (solver * residual).Evaluate()
            decrement, t = self.ng.InnerProduct(step, residual), 1.0
            new.data = A - step
            while energy(new) > now - 1e-4 * t * decrement + 1e-13 * abs(now) and t > 1e-3:
                t *= 0.5
                new.data = A - t * step
            A.data, now = new, energy(new)
            if decrement < tolerance**2 * abs(now):
                break
        else:
            pytest.fail("Newton's method does not converge")
        self.coenergy = -4.0 * now

    def force(self) -> float:
        """Of the whole pole, positive where it closes the gap [N]."""
        ng, B, slope = self.ng, self.ng.curl(self.potential), self.ng.grad(self.weight)
        stress = (B[2] * (B * slope) - 0.5 * (B * B) * slope[2]) / VACUUM_PERMEABILITY
        air = self.mesh.Materials("air|gap")
        return 4.0 * ng.Integrate(stress, self.mesh, definedon=air, order=4)

    def flux_density(self, x, y, z) -> float:
        """Mean along the pole over points of a section [T]; x, y: their bounds, z [mm]."""
        B, share = self.ng.curl(self.potential), (np.arange(6) + 0.5) / 6
        points = [(a[0] + (a[1] - a[0]) * share) * MM for a in (x, y)]
        each = [B(self.mesh(p, q, z * MM))[2] for p in points[0] for q in points[1]]
        return abs(float(np.mean(each)))

    def point(self, ampere_turns: float) -> SimpleNamespace:
        """Solve, and give what was measured."""
        self.solve(ampere_turns)
        return SimpleNamespace(
            force=self.force(),
            gap=self.flux_density((0, 0.1), (0, 0.1), 25.75),
            pole=self.flux_density((0, 12.5), (0, 5), 75.75),
            yoke=self.flux_density((38.5, 63.5), (0, 12.5), 75.75),
        )


@pytest.fixture(scope="module")
def field():
    ng = pytest.importorskip("ngsolve")
    ng.SetNumThreads(1)
    return Field(quarter_magnet(3.0))


@pytest.mark.slow
def test_force_is_the_slope_of_the_coenergy(field):
    ng, step = field.ng, 0.1 * MM
    field.solve(1000.0, tolerance=1e-6)
    force, rest = field.force(), field.potential.vec.FV().NumPy().copy()
    shift = ng.GridFunction(ng.VectorH1(field.mesh, order=2))
    coenergy = []
    for way in (step, -step):  # the pole moves, the mesh of the air with it
        shift.Set(ng.CF((0, 0, way * field.weight)))
        field.mesh.SetDeformation(shift)
        field.load.Assemble()
        field.solve(1000.0, tolerance=1e-6)
        coenergy.append(field.coenergy)
    field.mesh.UnsetDeformation()
    field.load.Assemble()
    field.potential.vec.FV().NumPy()[:] = rest

    # a central difference over 0.2 of 1.5 mm
    assert (coenergy[1] - coenergy[0]) / (2 * step) == pytest.approx(force, rel=0.01)


@pytest.mark.slow
@pytest.mark.parametrize("which", [0, 3])
def test_field_meets_the_measurement(field, which):
    found, known, kept = field.point(MEASURED[which].ampere_turns), MEASURED[which], FIELD[which]

    # 5 % was the goal; the gap at 1000 ampere turns misses it in every computation of others too
    assert found.force == pytest.approx(known.force, rel=0.05)
    assert found.gap == pytest.approx(known.gap, rel=0.05 if which else 0.13)
    assert found.pole == pytest.approx(known.pole, rel=0.05)
    assert found.yoke == pytest.approx(known.yoke, rel=0.05)
    for name in ("force", "gap", "pole", "yoke"):  # coarse against fine mesh
        assert getattr(found, name) == pytest.approx(getattr(kept, name), rel=0.03)


def test_two_corners_of_iron():
    # the map of the module's docstring, from corner to corner on a spiral in the upper half plane
    def offset(b):
        def slope(s):
            w = b**s * np.exp(1j * np.pi * (1.0 - s))
            root = np.sqrt(w + 1.0) * np.sqrt(w - b) * w**-1.5
            return root * w * (np.log(b) - 1j * np.pi)

        return complex(*(quad(lambda s, p=p: getattr(slope(s), p), 0, 1)[0]
                         for p in ("real", "imag")))  # fmt: skip

    def number(b):  # edge number up to unit reaches, and where the other corner is
        at = offset(b)
        K = 1.0 / abs(at)  # corners at unit distance
        return (-4.0 * np.log(2.0 * K) - np.log(b)) / np.pi, np.angle(at)

    grid = np.linspace(4.0, 6.0, 31)
    c, angle = np.array([number(b) for b in grid]).T
    level = np.interp(0.0, angle, c)
    slope = np.interp(0.0, angle, np.gradient(c, angle))

    assert level == pytest.approx(1.0031, abs=1e-4)
    assert abs(slope) == pytest.approx(0.9033, rel=1e-3)


def test_network_lies_above_the_field_in_force():
    for found, kept in zip(network_points(), FIELD, strict=True):
        # plane edges miss how the flux of the corners spreads; shown on the page of measurements
        assert 1.1 < found.force / kept.force < 1.3
        assert found.gap == pytest.approx(kept.gap, rel=0.1)
        assert found.pole == pytest.approx(kept.pole, rel=0.06)
