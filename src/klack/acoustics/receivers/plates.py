r"""Plates as receivers: infinite, and simply supported of finite size.

A force :math:`F` normal to an infinite thin plate at the distance :math:`r` gives (Cremer, Heckl &
Petersson 2005, sec. 3.3, 5.2)

.. math:: \frac{v}{F} = Y_0 \left[ H_0^{(2)}(kr) - \frac{2i}{\pi} K_0(kr) \right], \qquad
          Y_0 = \frac{1}{8 \sqrt{D m''}}, \qquad k^4 = \frac{m'' \omega^2}{D}

A moment at a point would turn the plate without bound.  So each foot has a radius :math:`a`: force
and moment act evenly and as :math:`\cos\varphi` along its circle, velocities are the same means,
so the mobility stays reciprocal and passive.  By the addition theorem a foot multiplies
:math:`H_0` by :math:`J_0(ka)` for a force and its derivatives by :math:`2 J_1(ka)/(ka)` for a
moment (:math:`K_0` with :math:`I_0, I_1`), and at the foot itself

.. math:: \frac{v}{F} = Y_0 \left[ J_0 H_0^{(2)} - \tfrac{2i}{\pi} I_0 K_0 \right], \qquad
          \frac{w_y}{M_y} = \frac{2 Y_0}{a^2} \left[ J_1 H_1^{(2)} - \tfrac{2i}{\pi} I_1 K_1
          \right], \qquad \mathrm{Re}\,\frac{w_y}{M_y} \to \frac{\omega}{16 D}

all at ``ka``.  With ``omega = -i s`` both hold beside the axis of frequency too.

Far above a plate in a rigid wall, at the distance :math:`R` in the direction :math:`n` from its
first foot, the pressure is the Rayleigh integral

.. math:: p = \frac{\rho s\, e^{-sR/c}}{2\pi R} \int v\, e^{(s/c)\, n\cdot x}\,\mathrm dA

of a mode in closed form, and of a force on an infinite plate, with :math:`\theta` from the normal,

.. math:: \frac pF = \frac{\rho\, e^{-sR/c}}{2\pi R}\,
          \frac{1}{m'' + D s^2 \sin^4\theta / c^4}

(Junger & Feit 1986, sec. 8.4 and 9.8; Wallace 1972), without the load of the air.

The frame of a plate has z along its normal; it is known along z and about x and y only.  In its
plane it is stiff.  Thin plates: bending waves longer than six thicknesses.
"""

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import scipy

from klack.acoustics.interface import (
    Complexes,
    Freedom,
    InterfacePoint,
    ReceiverResponse,
    freedoms_of,
)
from klack.acoustics.plate import Air, Plate
from klack.acoustics.receivers.modal import ModalReceiver
from klack.arrays import Matrix, Vector
from klack.errors import AccuracyWarning, refuse_if, require_nonnegative, require_positive

__all__ = ["InfinitePlate", "PlateSound", "finite_plate"]

_THICK = 2.0 * np.pi / 6.0  # k h where a bending wave is six thicknesses long


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PlateSound:
    """Ears far above a plate in a rigid wall.

    Parameters
    ----------
    places
        Ear -> way from the first foot (3,) [m], z along the normal.
    air
    """

    places: Mapping[str, Vector]
    air: Air = field(default_factory=Air)

    def __post_init__(self) -> None:
        for name, place in self.places.items():
            refuse_if(
                not float(place[2]) > 0.0,
                f"ear '{name}'",
                got=f"a height of {place[2]:g} m above the plate",
                expected="above 0",
                hint="z counts along the normal of the plate; 1 m is usual.",
            )

    def spreading(self, s: Complexes, place: Vector) -> Complexes:
        """``rho s exp(-s R/c) / (2 pi R)``, shape (k,)."""
        R = float(np.linalg.norm(place))
        return np.asarray(
            self.air.density * s * np.exp(-s * R / self.air.sound_speed) / (2.0 * np.pi * R)
        )

    def trace(self, s: Complexes, place: Vector) -> Complexes:
        """``(s/c) n`` along x and y of the plate [1/m], shape (k, 2)."""
        n = np.asarray(place[:2], dtype=float) / np.linalg.norm(place)
        return np.asarray(s[:, None] / self.air.sound_speed * n)


def _warn_thick(wavenumber: float, thickness: float) -> None:
    if wavenumber * thickness > _THICK * (1.0 + 1e-9):
        times = (_THICK / (wavenumber * thickness)) ** 2
        warnings.warn(
            f"Bending waves of the plate of {thickness * 1e3:.3g} mm are shorter than six "
            f"thicknesses above {times:.2g} of the highest frequency: there the plate is not "
            "thin and its mobility is too low.",
            AccuracyWarning,
            stacklevel=4,
        )


def _plate_freedoms(points: Sequence[InterfacePoint], radius: float) -> tuple[Freedom, ...]:
    """Along z, and about x and y of feet that have a size."""
    names = ("z", "rx", "ry") if radius > 0.0 else ("z",)
    for point in points:
        refuse_if(
            not np.allclose(point.axes, np.eye(3)),
            f"point '{point.name}' of a plate",
            got="its own axes",
            expected="the axes of the plate, z along its normal",
            hint="turn the source instead (placement: axes).",
        )
    return tuple(freedom for point in points for freedom in freedoms_of(point.name, names))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class InfinitePlate:
    """Infinite thin plate; its area and loss factor are not used.

    Parameters
    ----------
    plate
    points
        Feet, positions in the plane.
    radius [m]
        Of the feet; 0 for forces alone.
    ideal
        Thin at every frequency, as a definition and no plate: no warning.
    sound
        Ears, if any.
    """

    plate: Plate
    points: tuple[InterfacePoint, ...]
    radius: float = 0.0
    ideal: bool = False
    sound: PlateSound | None = None

    def __post_init__(self) -> None:
        require_nonnegative("InfinitePlate.radius", self.radius, "m")
        places = np.array([point.position[:2] for point in self.points])
        apart = np.linalg.norm(places[:, None] - places[None], axis=2)
        np.fill_diagonal(apart, np.inf)
        refuse_if(
            not np.all(apart > 2.0 * self.radius),
            "InfinitePlate: points",
            got=f"feet {apart.min() * 1e3:.3g} mm apart, of {self.radius * 1e3:.3g} mm radius",
            expected="feet that do not overlap",
            hint="give a smaller radius.",
        )

    @property
    def freedoms(self) -> tuple[Freedom, ...]:
        """Along z, and with a radius about x and y."""
        return _plate_freedoms(self.points, self.radius)

    @property
    def ears(self) -> tuple[str, ...]:
        """Names of the ears."""
        return () if self.sound is None else tuple(self.sound.places)

    def at(self, s: Complexes) -> ReceiverResponse:
        """Return mobility and transfers at ``s``."""
        omega = -1j * s
        k = np.sqrt(omega) * (self.plate.mass_per_area / self.plate.bending_stiffness) ** 0.25
        if not self.ideal:
            _warn_thick(float(np.abs(k).max(initial=0.0)), self.plate.thickness)
        freedoms = self.freedoms
        place = {point.name: point.position for point in self.points}
        Y = np.empty((s.size, len(freedoms), len(freedoms)), dtype=complex)
        for i, out in enumerate(freedoms):
            for j, force in enumerate(freedoms):
                apart = place[out.point] - place[force.point]
                orders = _order(out), _order(force)
                if out.point == force.point:
                    Y[:, i, j] = _at_the_foot(k, self.radius, orders)
                else:
                    Y[:, i, j] = _between_feet(k, self.radius, apart[:2], orders)
        return ReceiverResponse(
            mobility=(self.plate.mobility * Y).astype(complex), transfers=self._transfers(s)
        )

    def _transfers(self, s: Complexes) -> Complexes:
        freedoms, plate = self.freedoms, self.plate
        H = np.zeros((s.size, len(self.ears), len(freedoms)), dtype=complex)
        if self.sound is None:
            return H
        place = {point.name: point.position - self.points[0].position for point in self.points}
        for e, (name, ear) in enumerate(self.sound.places.items()):
            trace = self.sound.trace(s, ear)
            squared = np.sum(trace**2, axis=1)
            stiff = plate.bending_stiffness * squared**2 / s**2
            refuse_if(
                bool(np.any(np.abs(stiff) >= 0.7 * plate.mass_per_area)),
                f"ear '{name}'",
                got=f"{np.degrees(np.arctan2(np.hypot(*ear[:2]), ear[2])):.3g} degrees from the "
                "normal, where bending waves of the infinite plate are as fast as sound along it",
                expected=f"a direction nearer the normal, for {np.abs(s).max() / 2 / np.pi:.4g} Hz",
                hint="put the ear above the mount, or take a plate of finite size.",
            )
            point = self.sound.spreading(s, ear) / (s * (plate.mass_per_area + stiff))
            k_a = 1j * np.sqrt(squared) * self.radius
            for j, freedom in enumerate(freedoms):
                axis, sign = _order(freedom)
                turned = sign * trace[:, axis] if axis >= 0 else 1.0
                phase = np.exp(trace @ place[freedom.point][:2])
                H[:, e, j] = point * turned * phase * _foot(k_a, axis >= 0, "propagating")
        return H


Order = tuple[int, float]
"""Axis of the derivative (-1: none) and its sign: a rotation is (dw/dy, -dw/dx)."""


def _order(freedom: Freedom) -> Order:
    return {3: (-1, 1.0), 4: (1, 1.0), 5: (0, -1.0)}[freedom.direction]


def _at_the_foot(k: Complexes, a: float, orders: tuple[Order, Order]) -> Complexes:
    """Mobility over Y_0 at one foot; force and moments do not couple."""
    (out, _), (force, _) = orders
    if out != force:
        return np.zeros_like(k)
    if a == 0.0:
        return np.ones_like(k)
    x = k * a
    J, kernel, ((bent, K)) = _cylinder(x, 0 if out < 0 else 1)
    own = J * kernel - 2j / np.pi * bent * K
    return own if out < 0 else 2.0 * own / a**2


def _cylinder(x: Complexes, n: int) -> tuple[Complexes, Complexes, tuple[Complexes, Complexes]]:
    """Functions of order n of propagating and near-field waves: J, H^(2), I, K."""
    return (
        scipy.special.jv(n, x),
        scipy.special.hankel2(n, x),
        (scipy.special.iv(n, x), scipy.special.kv(n, x)),
    )


def _between_feet(k: Complexes, a: float, apart: Vector, orders: tuple[Order, Order]) -> Complexes:
    """Mobility over Y_0 from one foot to another at the distance vector ``apart``.

    The velocity at x from a force at x' is G(x - x'); a rotation differentiates by x, a moment,
    by reciprocity, by x' with the same sign.
    """
    r = float(np.linalg.norm(apart))
    total = np.zeros_like(k)
    for factor, wave in ((1.0, "propagating"), (-2j / np.pi, "near")):
        part = np.full_like(k, factor)
        axes = []
        for (axis, sign), side in zip(orders, (1.0, -1.0), strict=True):
            part = part * _foot(k * a, axis >= 0, wave)
            if axis >= 0:
                axes.append(axis)
                part = part * sign * side
        total += part * _derivative(k, r, apart / r, axes, wave)
    return total


def _foot(x: Complexes, turned: bool, wave: str) -> Complexes:
    """Factor of a ring of radius a: J_0 or 2 J_1/(ka), of near fields I_0 or 2 I_1/(ka)."""
    function = scipy.special.jv if wave == "propagating" else scipy.special.iv
    if np.all(x == 0.0):
        return np.ones_like(x)
    return np.asarray(2.0 * function(1, x) / x if turned else function(0, x))


def _derivative(k: Complexes, r: float, unit: Vector, axes: list[int], wave: str) -> Complexes:
    """Derivatives of H_0^(2)(kr) or K_0(kr) along axes of the plane."""
    function = scipy.special.hankel2 if wave == "propagating" else scipy.special.kv
    x = k * r
    f_0 = function(0, x)
    if not axes:
        return np.asarray(f_0)
    f_1 = -k * function(1, x)  # df/dr of either
    if len(axes) == 1:
        return np.asarray(f_1 * unit[axes[0]])
    second = (-1.0 if wave == "propagating" else 1.0) * k**2 * f_0 - f_1 / r
    along = unit[axes[0]] * unit[axes[1]]
    return np.asarray(second * along + f_1 / r * (float(axes[0] == axes[1]) - along))


def finite_plate(
    plate: Plate,
    sides: tuple[float, float],
    points: Sequence[InterfacePoint],
    *,
    highest: float,
    radius: float = 0.0,
    sound: PlateSound | None = None,
) -> ModalReceiver:
    r"""Simply supported rectangular plate by its modes.

    .. math:: \omega_{mn} = \sqrt{\tfrac{D}{m''}}\,\kappa^2, \qquad
              \kappa^2 = \left(\tfrac{m\pi}{l_x}\right)^2 + \left(\tfrac{n\pi}{l_y}\right)^2,
              \qquad \varphi = \frac{2}{\sqrt{m'' l_x l_y}}
              \sin\tfrac{m\pi x}{l_x} \sin\tfrac{n\pi y}{l_y}

    with the damping ratio ``loss_factor / 2``, the means over feet as for the infinite plate, and
    modes up to twice the highest frequency.  Modes up to four times that wavenumber, and beyond
    it their mean density :math:`l_x l_y \kappa / (2\pi)`, give the static rest.

    Parameters
    ----------
    plate
        Its area is not used.
    sides [m]
        ``l_x, l_y``.
    points
        Feet; positions from a corner.
    highest [Hz]
    radius [m]
        Of the feet; moments need one.
    sound
        Ears, if any; the static rest does not radiate.
    """
    require_positive("finite_plate: highest", highest, "Hz")
    freedoms = _plate_freedoms(points, radius)
    edges = np.asarray(sides, dtype=float)
    for point in points:
        refuse_if(
            not np.all((point.position[:2] > radius) & (point.position[:2] < edges - radius)),
            f"point '{point.name}' of a plate",
            got=f"({point.position[0]:g}, {point.position[1]:g}) m",
            expected=f"a foot inside 0 to {edges[0]:g} m and 0 to {edges[1]:g} m",
            hint="positions count from a corner of the plate.",
        )
    stretch = np.sqrt(plate.bending_stiffness / plate.mass_per_area)
    top = np.sqrt(2.0 * 2.0 * np.pi * highest / stretch)
    _warn_thick(float(top / np.sqrt(2.0)), plate.thickness)
    wave, shapes = _plate_modes(plate, edges, points, freedoms, 4.0 * top, radius)
    dynamic = np.hypot(*wave) <= top
    omega = stretch * np.sum(wave**2, axis=0)
    scaled = shapes[~dynamic] / omega[~dynamic, None]
    moving = wave[:, dynamic]

    def radiated(s: Complexes) -> Complexes:
        assert sound is not None
        ears = [_of_modes(sound, s, ear, moving, edges, points[0]) for ear in sound.places.values()]
        return 2.0 / np.sqrt(plate.mass_per_area * edges[0] * edges[1]) * np.stack(ears, axis=1)

    return ModalReceiver(
        points=tuple(points),
        freedoms=freedoms,
        omega=omega[dynamic],
        damping=np.full(int(dynamic.sum()), 0.5 * plate.loss_factor),
        shapes=shapes[dynamic],
        residual=scaled.T @ scaled + np.diag(_static_tail(plate, freedoms, 4.0 * top, radius)),
        ears=() if sound is None else tuple(sound.places),
        radiated=None if sound is None else radiated,
    )


def _of_modes(
    sound: PlateSound,
    s: Complexes,
    ear: Vector,
    wave: Matrix,
    edges: Vector,
    first: InterfacePoint,
) -> Complexes:
    """Rayleigh integral of ``sin sin`` of each mode, shape (k, modes)."""
    trace = sound.trace(s, ear)
    found = sound.spreading(s, ear) * np.exp(-trace @ first.position[:2])
    for side in range(2):
        k, place = np.unique(wave[side], return_inverse=True)
        beta = trace[:, side, None] + 1e-9 * k  # 0/0 where the trace of the sound is the mode's
        end = np.cos(k * edges[side]) * np.exp(beta * edges[side])
        found = found.reshape(s.size, -1) * (k * (1.0 - end) / (k**2 + beta**2))[:, place]
    return np.asarray(found)


def _static_tail(plate: Plate, freedoms: tuple[Freedom, ...], top: float, radius: float) -> Vector:
    r"""Compliance of the modes above ``top`` [1/m] by their mean density, shape (n,).

    .. math:: \frac{1}{2\pi D} \int \frac{J_0^2(\kappa a)}{\kappa^3} \,\mathrm d\kappa, \qquad
              \frac{1}{4\pi D} \int \frac{(2 J_1(\kappa a))^2}{(\kappa a)^2 \kappa}
              \,\mathrm d\kappa
    """
    kappa = top * np.geomspace(1.0, 1e3, 4001)
    x = kappa * radius
    weight = {3: scipy.special.j0(x) ** 2 / kappa**2}
    if radius > 0.0:
        weight[4] = weight[5] = 0.5 * (2.0 * scipy.special.j1(x) / x) ** 2
    whole = {
        direction: np.trapezoid(values, np.log(kappa)) / (2.0 * np.pi * plate.bending_stiffness)
        for direction, values in weight.items()
    }
    return np.array([whole[freedom.direction] for freedom in freedoms])


def _plate_modes(
    plate: Plate,
    edges: Vector,
    points: Sequence[InterfacePoint],
    freedoms: tuple[Freedom, ...],
    top: float,
    radius: float,
) -> tuple[Matrix, Matrix]:
    """Wavenumbers (2, modes) below ``top`` [1/m] and shapes (modes, freedoms)."""
    m, n = (np.arange(1, max(int(top * side / np.pi), 1) + 1) for side in edges)
    grid = np.array([a.ravel() for a in np.meshgrid(m, n, indexing="ij")])
    wave = np.pi * grid / edges[:, None]
    wave = wave[:, np.hypot(*wave) <= max(top, np.hypot(*(np.pi / edges)))]
    size = 2.0 / np.sqrt(plate.mass_per_area * edges[0] * edges[1])
    x = np.hypot(*wave) * radius
    factor = {False: scipy.special.j0(x), True: np.ones_like(x)}
    if radius > 0.0:
        factor[True] = 2.0 * scipy.special.j1(x) / x
    place = {point.name: point.position[:2] for point in points}
    shapes = []
    for freedom in freedoms:
        axis, sign = _order(freedom)
        phase = wave * place[freedom.point][:, None]
        parts = [np.sin(phase[0]), np.sin(phase[1])]
        if axis >= 0:
            parts[axis] = sign * wave[axis] * np.cos(phase[axis])
        shapes.append(size * factor[axis >= 0] * parts[0] * parts[1])
    return wave, np.array(shapes).T
