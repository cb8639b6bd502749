r"""A rigid sphere on contact points of an elastic half-space: oblique impacts, also measured.

A square cell of side *h* with the mean traction 1/h^2 at the origin moves the surface at (x, y)
(Boussinesq and Cerruti; Johnson 1985, section 3.2 and 3.6; Love 1929 for the integral of 1/r): with
the integrals over the cell

.. math:: I = \int \frac{dA}{r}, \quad I_{xx} = \int \frac{x^2 dA}{r^3}, \quad
    I_{xy} = \int \frac{x y \, dA}{r^3}, \quad L_x = \int \frac{x \, dA}{r^2}

a pressure moves it in by :math:`(1-\nu^2) I / (\pi E)` and towards the cell by
:math:`(1+\nu)(1-2\nu) L_x / (2 \pi E)` (which cancels between like bodies), a traction along x by
:math:`(1+\nu) [(1-\nu) I + \nu I_{xx}] / (\pi E)` along and :math:`(1+\nu) \nu I_{xy} / (\pi E)`
across.
"""

from dataclasses import dataclass
from math import cos, gamma, inf, pi, radians, sin, sqrt

import numpy as np

from klack.contact.friction import Friction
from klack.materials.material import Material
from klack.transient.interface_model import InterfaceModel
from klack.transient.interface_run import simulate_interface
from klack.verification.check import Check, ComparedCurve, check
from klack.verification.interface_bodies import modal_model

__all__ = [
    "ObliqueImpact",
    "SphereImpact",
    "alumina_on_glass",
    "half_space_compliance",
    "oblique_spheres",
]


_BEYOND = 1.3  # radii of contact that the points reach


def half_space_compliance(
    points: np.ndarray, size: float, lower: Material, upper: Material
) -> np.ndarray:
    """Compliance of two half-spaces at square cells of one grid, (3 n, 3 n) [m/N].

    Gaps of all cells first, then their tangential offsets (upper past lower) along x and along y.

    Parameters
    ----------
    points (n, 2) [m]
        Centres of the cells.
    size [m]
        Their side.
    """
    n = len(points)
    x, y = (points[:, None, :] - points[None, :, :]).transpose(2, 0, 1)  # from cell j to point i
    whole, xx, yy, xy, lx, ly = (np.zeros((n, n)) for _ in range(6))
    for sx in (-1.0, 1.0):
        for sy in (-1.0, 1.0):
            X, Y, sign = x + 0.5 * sx * size, y + 0.5 * sy * size, sx * sy
            r = np.hypot(X, Y)
            xx += sign * Y * np.log(X + r)
            yy += sign * X * np.log(Y + r)
            xy -= sign * r
            lx += sign * (Y * np.log(r) + X * np.arctan(Y / X))
            ly += sign * (X * np.log(r) + Y * np.arctan(X / Y))
    whole = xx + yy
    C = np.zeros((3 * n, 3 * n))
    for body, side in ((lower, 1.0), (upper, -1.0)):
        nu = body.poisson
        soft = (1.0 + nu) / (pi * body.young * size**2)
        drawn = side * soft * 0.5 * (1.0 - 2.0 * nu)
        C += np.block(
            [
                [soft * (1.0 - nu) * whole, -drawn * lx, -drawn * ly],
                [drawn * lx, soft * ((1.0 - nu) * whole + nu * xx), soft * nu * xy],
                [drawn * ly, soft * nu * xy, soft * ((1.0 - nu) * whole + nu * yy)],
            ]
        )
    return C


@dataclass(frozen=True, slots=True, kw_only=True)
class ObliqueImpact:
    """State after an oblique impact of a sphere.

    Parameters
    ----------
    centre [m/s]
        Tangential, of the centre.
    spin [rad/s]
        About the axis across the plane of motion; positive where it rolls on.
    surface [m/s]
        Tangential, of the point of contact.
    normal [m/s]
        Of rebound.
    lost [J]
        In friction.
    peak [-]
        Largest tangential over friction times the largest normal force.
    """

    centre: float
    spin: float
    surface: float
    normal: float
    lost: float
    peak: float


@dataclass(frozen=True, slots=True, kw_only=True)
class SphereImpact:
    """Rigid motion of a sphere that hits a half-space.

    Parameters
    ----------
    radius [m]
    speed [m/s]
        Along the normal.
    cells [-]
        Over the radius of the largest contact.
    inertia [-]
        m R^2 / I; 2.5 for a solid sphere, 0 without turning.
    """

    radius: float
    sphere: Material
    ground: Material
    speed: float
    cells: float = 6.0
    inertia: float = 2.5

    @property
    def mass(self) -> float:
        """Of the sphere [kg]."""
        return self.sphere.density * 4.0 / 3.0 * pi * self.radius**3

    @property
    def approach(self) -> float:
        """Largest approach [m] (Hertz 1882; Johnson 1985, equation 11.23)."""
        modulus = 1.0 / sum(1.0 / m.plane_strain_modulus for m in (self.sphere, self.ground))
        stiff = modulus * sqrt(self.radius)
        return float((15.0 * self.mass * self.speed**2 / (16.0 * stiff)) ** 0.4)

    @property
    def contact_time(self) -> float:
        """Of a frictionless impact [s] (Johnson 1985, equation 11.24)."""
        return 4.0 * sqrt(pi) / 5.0 * gamma(0.4) / gamma(0.9) * self.approach / self.speed

    @property
    def kappa(self) -> float:
        """Tangential over normal contact stiffness (Mindlin 1949) [-]."""
        shear = sum(
            (2.0 - m.poisson) * 2.0 * (1.0 + m.poisson) / m.young
            for m in (self.sphere, self.ground)
        )
        modulus = sum(1.0 / m.plane_strain_modulus for m in (self.sphere, self.ground))
        return float(4.0 * modulus / shear)

    def model(self, friction: Friction, turn: float = 0.0) -> InterfaceModel:
        """Interface-level model, tangential directions turned by an angle [rad]."""
        R, size = self.radius, sqrt(self.radius * self.approach) / self.cells
        count = int(_BEYOND * self.cells) + 1
        line = size * np.arange(-count, count + 1)
        points = np.stack(np.meshgrid(line, line), axis=-1).reshape(-1, 2)
        points = points[np.linalg.norm(points, axis=1) < _BEYOND * self.cells * size]
        n = len(points)
        x, y = points.T
        nothing, one = np.zeros(n), np.ones(n)
        # u = v + w x r with r = (x, y, -R)
        motion = np.array(
            [
                [nothing, nothing, one, y, -x, nothing],
                [one, nothing, nothing, nothing, -R * one, -y],
                [nothing, one, nothing, R * one, nothing, x],
            ]
        )
        unit = np.sqrt(
            np.concatenate(
                [np.full(3, 1.0 / self.mass), np.full(3, self.inertia / (self.mass * R**2))]
            )
        )
        rows = motion.transpose(0, 2, 1).reshape(3 * n, 6) * unit
        c, s, eye = np.cos(turn), np.sin(turn), np.eye(n)
        T = np.block(
            [[eye, 0 * eye, 0 * eye], [0 * eye, c * eye, s * eye], [0 * eye, -s * eye, c * eye]]
        )
        rows = T @ rows
        C = T @ half_space_compliance(points, size, self.ground, self.sphere) @ T.T
        return modal_model(
            masses=(self.mass, inf),
            omega=np.zeros(6),
            traces=rows[:n],
            compliance=0.5 * (C + C.T),
            gap=(x**2 + y**2) / (2.0 * R),
            rigid=np.diag(unit),
            points=np.column_stack([points, nothing]),
            tangents=np.ascontiguousarray(rows[n:]),
            axial_across=np.zeros(2 * n),
            friction=(friction,),
        )

    def hit(
        self, tangential: float, friction: Friction, *, steps: int = 300, turn: float = 0.0
    ) -> ObliqueImpact:
        """Impact with a tangential speed [m/s], without spin before."""
        model = self.model(friction, turn)
        run = simulate_interface(
            model,
            speed=self.speed,
            duration=1.15 * self.contact_time,
            step=self.contact_time / steps,
            velocity=np.array([tangential, 0.0, 0.0, 0.0, 0.0, 0.0]),
        )
        after = run.motion.velocity[-1]
        size = np.linalg.norm(
            run.impacts[0].friction_force.reshape(-1, 2, model.count).sum(axis=2), axis=1
        ).max()
        return ObliqueImpact(
            centre=float(after[0]),
            spin=float(after[4]),
            surface=float(after[0] - self.radius * after[4]),
            normal=float(after[2]),
            lost=run.energy.friction,
            peak=float(size / (friction.kinetic * run.history.force.max())),
        )


# Kharaz, Gorham & Salman 2001: alumina sphere of 5 mm on soda-lime glass, 3.9 m/s, mu 0.092, as
# digitised by the makers of two programs: incidence in degrees, measured value
_TANGENTIAL = (
    (1.84, 0.79344), (3.703, 0.74533), (9.496, 0.67257), (20.012, 0.59691), (30.127, 0.68756),
    (39.382, 0.77148), (49.694, 0.84761), (60.02, 0.90142), (71.0693, 0.93657), (79.2277, 0.96952),
)  # fmt: skip
_SPIN = (
    (21.251, 577.65), (31.157, 612.88), (39.143, 595.49), (50.348, 453.21), (60.328, 382.09),
    (69.9606, 242.966), (78.5602, 142.355),
)  # fmt: skip
_ANGLE = ((20.567, 12.208), (30.29, 21.67), (39.535, 32.613), (49.747, 45.125), (60.208, 57.474))
_KHARAZ = "Kharaz, Gorham & Salman 2001, Powder Technol. 120:281 (measured; no free parameter)"
_STEEP = 15.0  # degrees; nearer to the normal the measurement is not that of linear elasticity


def alumina_on_glass(normal: float, cells: float = 6.0) -> SphereImpact:
    """Sphere of 5 mm on a thick plate, at a normal speed [m/s]."""
    alumina = Material(name="alumina", young=380e9, poisson=0.23, density=4000.0)
    return SphereImpact(
        radius=2.5e-3,
        sphere=alumina,
        ground=Material(name="glass", young=70e9, poisson=0.25, density=2500.0),
        speed=normal,
        cells=cells,
    )


def oblique_spheres() -> list[Check]:
    """Alumina on glass.

    Linear elasticity with one coefficient of friction does not hold near the normal.
    """
    friction, speed = Friction.coulomb(0.092), 3.9

    def hit(degrees: float) -> tuple[float, float, float]:
        angle = radians(degrees)
        after = alumina_on_glass(speed * cos(angle)).hit(speed * sin(angle), friction, steps=200)
        return (
            after.centre / (speed * sin(angle)),
            after.spin,
            float(np.degrees(np.arctan2(after.centre, after.normal))),
        )

    tangential = np.array([hit(angle)[0] for angle, _ in _TANGENTIAL])
    spin = np.array([hit(angle)[1] for angle, _ in _SPIN])
    rebound = np.array([hit(angle)[2] for angle, _ in _ANGLE])
    angles, values = (np.array(column) for column in zip(*_TANGENTIAL, strict=True))
    steep = angles > _STEEP
    curve = ComparedCurve(
        x_label="angle of incidence [deg]",
        y_label="tangential restitution [-]",
        expected=(angles, values),
        computed=(angles, tangential),
    )
    return [
        check(
            "alumina on glass above 15 degrees: tangential restitution, rms deviation [-]",
            expected=0.0,
            computed=_rms(tangential[steep] - values[steep]),
            tolerance=0.02,
            source=_KHARAZ,
            curve=curve,
        ),
        check(
            "alumina on glass below 15 degrees: tangential restitution, rms deviation [-]",
            expected=0.0,
            computed=_rms(tangential[~steep] - values[~steep]),
            tolerance=0.12,
            source=_KHARAZ,
            curve=curve,
            reason="unlike bodies: linear elasticity with one coefficient gives 0.66 where 0.79 "
            "was measured; the difference is shown, not explained",
        ),
        check(
            "alumina on glass above 15 degrees: spin after, rms deviation [rad/s]",
            expected=0.0,
            computed=_rms(spin - np.array([row[1] for row in _SPIN])),
            tolerance=25.0,
            source=_KHARAZ,
        ),
        check(
            "alumina on glass above 15 degrees: rebound angle of the centre, rms deviation [deg]",
            expected=0.0,
            computed=_rms(rebound - np.array([row[1] for row in _ANGLE])),
            tolerance=0.4,
            source=_KHARAZ,
        ),
    ]


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))
