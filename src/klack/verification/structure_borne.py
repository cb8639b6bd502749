"""A source on a receiver: joined rods, a beam on a plate, isolators, blocked forces, signals."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from math import pi, sqrt

import numpy as np
import scipy

from klack.acoustics.at_mounts import source_at_mounts
from klack.acoustics.coupled_signal import model_signal
from klack.acoustics.coupling import Coupled, couple, junction
from klack.acoustics.in_situ import virtual_test
from klack.acoustics.interface import (
    Complexes,
    Freedom,
    InterfacePoint,
    ReceiverResponse,
    SourceAtMounts,
    laplace,
)
from klack.acoustics.isolator import DynamicStiffness, Isolator, MeasuredIsolator, Spring
from klack.acoustics.plate import Plate
from klack.acoustics.receivers.plates import InfinitePlate, finite_plate
from klack.acoustics.source_levels import single_equivalents
from klack.arrays import Vector
from klack.bodies.elasticity.body import elastic_body
from klack.bodies.elasticity.eigen import eigenmodes
from klack.bodies.elasticity.statics import Flexibility
from klack.bodies.reduction.craig_bampton import craig_bampton
from klack.bodies.reduction.damping import RayleighDamping
from klack.bodies.reduction.mounting import interface_of, mounting_surface
from klack.bodies.reduction.ports import surface_port
from klack.materials.material import Material
from klack.verification.check import Check, ComparedCurve, check
from klack.verification.lattice import lattice_mesh

__all__ = [
    "KnownReceiver",
    "beam_source",
    "checks",
    "joined_rods",
    "two_masses",
    "two_masses_exact",
]

_ROUND_OFF = "round-off, which differs from one processor to the next"
_DIGITS = "digits of the table"

PLATE_STEEL = Material(name="steel", young=210e9, poisson=0.3, density=7800.0)
THIN_PLATE = Plate(thickness=1.5e-3, area=1.0, material=PLATE_STEEL)

# frequency [Hz], power in [W], of foot 1, of foot 2; 1 N peak at 37 mm
BEAM_ON_PLATE = (
    (500.0, 1.381329075e-03, 3.642751414e-04, 1.016850802e-03),
    (1000.0, 9.031108232e-04, 1.211849384e-04, 7.815519918e-04),
    (2000.0, 5.439376963e-04, 1.408496402e-06, 5.417914889e-04),
    (4000.0, 4.729403386e-04, 9.007384244e-05, 3.811817993e-04),
    (8000.0, 1.900326504e-04, 4.651932407e-05, 1.382849449e-04),
    (16000.0, 8.652196654e-06, 1.693606285e-06, 1.749676745e-06),
)
# frequency [Hz], blocked force [N], free velocity [m/s] of EN 15657
EQUIVALENTS = (
    (500.0, 9.987584e-01, 1.608878e-02),
    (1000.0, 1.000237e00, 9.294879e-03),
    (2000.0, 1.011752e00, 3.896807e-03),
    (4000.0, 1.076990e00, 2.226312e-03),
    (8000.0, 1.696931e00, 1.282928e-03),
)
# frequency [Hz], interface force [N] rigid, velocity of the far end [m/s] rigid, force by spring
RODS = (
    (1000.0, 8.2994012705e-01, 7.0809332951e-04, 1.1135097342e00),
    (7300.0, 9.7700163981e-01, 1.3830162732e-04, 6.7391747287e-02),
    (20000.0, 6.2531526558e-01, 3.3125799066e-04, 1.0343285943e-02),
    (43210.0, 2.0904021002e-02, 4.8540377228e-04, 6.5557313933e-03),
)

# frequency [Hz], free velocity [m/s], mobility [m/(N s)], blocked force [N] of the first rod
MOUNTED_ROD = (
    (1000.0, 4.0833903685e-03, 4.0759081076e-03, 1.0018357286e00),
    (7300.0, 5.7765166661e-04, 5.2214121654e-04, 1.1063130975e00),
    (20000.0, 2.6399384200e-04, 9.2966494948e-05, 2.8396665072e00),
    (43210.0, 4.9263806743e-04, 4.2619604117e-04, 1.1558954562e00),
)


def checks() -> list[Check]:
    """Run all checks of this group."""
    return [
        *_rods(),
        *_own_rod(),
        *_rod_between(),
        *_beam(),
        *_blocked(),
        *_equivalents(),
        *_plates(),
        *_signal(),
    ]


@dataclass(frozen=True, kw_only=True)
class KnownReceiver:
    """A receiver by functions of ``s``: mobility (k, n, n), and transfers (k, ears, n) if any."""

    mobility: Callable[[Complexes], Complexes]
    freedoms: tuple[Freedom, ...]
    points: tuple[InterfacePoint, ...]
    transfers: Callable[[Complexes], Complexes] | None = None
    ears: tuple[str, ...] = ()

    def at(self, s: Complexes) -> ReceiverResponse:
        """Evaluate both."""
        Y = self.mobility(s)
        none = np.zeros((s.size, 0, len(self.freedoms)), dtype=complex)
        return ReceiverResponse(
            mobility=Y, transfers=none if self.transfers is None else self.transfers(s)
        )


# --------------------------------------------------------------------------- rods


def _rod(f: Vector, length: float, area: float) -> Complexes:
    """Exact dynamic stiffness between the ends of a steel rod, loss factor 1e-3, (k, 2, 2)."""
    E = 210e9 * (1.0 + 1e-3j)
    k = 2.0 * pi * f / np.sqrt(E / 7800.0)
    a = E * area * k
    own, across = a / np.tan(k * length), -a / np.sin(k * length)
    return np.moveaxis(np.array([[own, across], [across, own]]), -1, 0)


_AXIAL = (Freedom("end", 3),)
_END = (InterfacePoint(name="end"),)


def joined_rods(f: Vector, isolator: Isolator | None = None) -> Coupled:
    """A rod of 50 mm, pushed by 1 N at its free end, on one of 120 mm; its far end is an ear."""
    s = laplace(f)
    A = s[:, None, None] * np.linalg.inv(_rod(f, 0.05, 1e-4))
    B = s[:, None, None] * np.linalg.inv(_rod(f, 0.12, 2e-4))
    source = SourceAtMounts(
        frequency=f,
        points=_END,
        freedoms=_AXIAL,
        free_velocity=A[:, 1:, 0],
        blocked_force=np.asarray(A[:, 1:, 0] / A[:, 1:, 1], dtype=complex),
        mobility=A[:, 1:, 1:],
    )
    receiver = KnownReceiver(
        points=_END,
        freedoms=_AXIAL,
        ears=("far end",),
        mobility=lambda s: B[:, :1, :1],
        transfers=lambda s: B[:, 1:, :1],
    )
    return couple(source, receiver, isolators={} if isolator is None else {"end": isolator})


def _rods() -> Iterator[Check]:
    f = np.array([row[0] for row in RODS])
    rigid = joined_rods(f)
    soft = joined_rods(f, Spring(values={3: 5e6}, loss_factor=0.05))
    source = "two rods by dynamic stiffness, E S k cot(k L), assembled directly"
    for i, (frequency, force, velocity, through_spring) in enumerate(RODS):
        for what, expected, computed in (
            ("interface force of joined rods [N]", force, rigid.force[i, 0]),
            ("velocity of the far end [m/s]", velocity, rigid.pressure[i, 0]),
            ("interface force through a spring [N]", through_spring, soft.force[i, 0]),
        ):
            yield check(
                f"{frequency / 1e3:.4g} kHz: {what}",
                expected,
                abs(computed),
                1e-9,
                source,
                reason=_DIGITS,
            )


def _own_rod() -> Iterator[Check]:
    """The first rod as a Craig-Bampton body of finite elements; 1 N at its free end."""
    length, radius = 0.05, sqrt(1e-4 / pi)
    material = Material(name="rod", young=210e9, poisson=0.0, density=7800.0)
    mesh = lattice_mesh("quad8", [np.array([0.0, radius]), np.linspace(0.0, length, 41)])
    mount = mounting_surface(mesh, ["top"], "end", kind="rigid")
    body = elastic_body("rod", mesh, {"solid": material}, fixed_nodes=mount.nodes)
    pattern = surface_port(mesh, "bottom", "z", name="push").pattern[:, None]
    with Flexibility(body) as flexibility:
        modes = eigenmodes(body, count=40, flexibility=flexibility)
        found = [
            source_at_mounts(
                [
                    craig_bampton(
                        flexibility,
                        [interface_of(body, mount)],
                        modes,
                        # at one frequency viscous losses are those of a complex modulus
                        damping=RayleighDamping(alpha=0.0, beta=1e-3 / (2.0 * pi * f)),
                        port_names=("push",),
                        patterns=pattern,
                    )
                ],
                [np.ones((1, 1), dtype=complex)],
                _END,
                np.array([f]),
            )
            for f, *_ in MOUNTED_ROD
        ]
    whole = [(x.free_velocity[0, 0], x.mobility[0, 0, 0], x.blocked_force[0, 0]) for x in found]
    for i, what in enumerate(("free velocity [m/s]", "mobility [m/(N s)]", "blocked force [N]")):
        for (f, *known), values in zip(MOUNTED_ROD, whole, strict=True):
            yield check(
                f"{what} of a rod of finite elements with 40 modes, {f / 1e3:g} kHz",
                expected=known[i],
                computed=abs(values[i]),
                tolerance=5e-4,
                source="exact rod with a complex modulus",
                reason="modes that are left out; largest beside a resonance of the free rod",
            )


def _rod_between() -> Iterator[Check]:
    """A rod as an element with inertia between two rods, through its internal resonances."""
    f = np.array([2e3, 30e3, 60e3])
    between = _rod(f, 0.08, 5e-5)
    element = MeasuredIsolator(
        name="rod",
        frequency=f,
        values={
            3: DynamicStiffness(
                driving=between[:, 0, 0], transfer=-between[:, 1, 0], receiving=between[:, 1, 1]
            )
        },
    )
    joined = joined_rods(f, element)
    whole = np.zeros((f.size, 4, 4), dtype=complex)
    for first, D in enumerate((_rod(f, 0.05, 1e-4), between, _rod(f, 0.12, 2e-4))):
        whole[:, first : first + 2, first : first + 2] += D
    push = np.array([1.0, 0.0, 0.0, 0.0])[:, None]
    exact = laplace(f)[:, None] * np.linalg.solve(whole, push)[..., 0]
    for i, frequency in enumerate(f):
        yield check(
            f"{frequency / 1e3:g} kHz: rod with inertia as element, velocity of the far end, "
            "relative",
            0.0,
            abs(joined.pressure[i, 0] / exact[i, 3] - 1.0),
            1e-10,
            "three rods by dynamic stiffness, assembled directly",
            reason=_ROUND_OFF,
        )


# --------------------------------------------------------------------------- beam

_LENGTH, _SIDE = 0.06, 8e-3  # [m]
_FEET, _PUSHED = (0.01, 0.05), 0.037  # [m]
_LOSS = 0.01
_ELASTIC = 8


def _beam_modes(x: Vector, slope: bool) -> tuple[Vector, np.ndarray]:
    """Two rigid and eight elastic modes of a free beam: omega, and shapes or slopes (modes, x)."""
    mass = 7800.0 * _SIDE**2 * _LENGTH
    roots = [
        scipy.optimize.brentq(
            lambda b: np.cos(b) - 1.0 / np.cosh(b),
            (i + 0.5) * pi - 0.3,
            (i + 0.5) * pi + 0.3,
            xtol=1e-14,
        )
        for i in range(1, _ELASTIC + 1)
    ]
    shapes = [
        np.full_like(x, float(not slope)),
        (x / _LENGTH - 0.5, 1.0 / _LENGTH + 0.0 * x)[slope],
    ]
    shapes[1] = sqrt(12.0) * shapes[1]
    for b in roots:
        k = b / _LENGTH
        ratio = (np.cosh(b) - np.cos(b)) / (np.sinh(b) - np.sin(b))
        even, odd = np.cosh(k * x), np.sinh(k * x)
        if slope:
            shapes.append(k * (odd - np.sin(k * x) - ratio * (even + np.cos(k * x))))
        else:
            shapes.append(even + np.cos(k * x) - ratio * (odd + np.sin(k * x)))
    bending = 210e9 * _SIDE**4 / 12.0
    omega = np.array([0.0, 0.0, *(np.square(roots) * sqrt(bending / (mass * _LENGTH**3)))])
    return omega, np.array(shapes) / sqrt(mass)


def beam_source(f: Vector, *, slopes: bool = False) -> SourceAtMounts:
    """Free steel beam of 60 mm pushed by 1 N at 37 mm, on two feet, with or without their tilt."""
    feet = np.array(_FEET)
    omega, across = _beam_modes(feet, slope=False)
    if slopes:
        across = np.concatenate([across, -_beam_modes(feet, slope=True)[1]], axis=1)
    pushed = _beam_modes(np.array([_PUSHED]), slope=False)[1]
    s = laplace(f)
    H = 1.0 / (omega**2 * (1.0 + 1j * _LOSS) + s[:, None] ** 2)
    Y = s[:, None, None] * np.einsum("mp,km,mq->kpq", across, H, across)
    vf = s[:, None] * np.einsum("mp,km,m->kp", across, H, pushed[:, 0])
    names = ("foot 1", "foot 2")
    return SourceAtMounts(
        frequency=f,
        points=tuple(
            InterfacePoint(name=name, position=np.array([x, 0.0, 0.0]))
            for name, x in zip(names, feet, strict=True)
        ),
        freedoms=tuple(
            Freedom(name, direction) for direction in ((3, 5) if slopes else (3,)) for name in names
        ),
        free_velocity=vf,
        blocked_force=np.linalg.solve(Y, vf[..., None])[..., 0],
        mobility=Y,
    )


def _power_in(f: Vector, joined: Coupled) -> tuple[Vector, Vector]:
    """Power of the push and power lost in the beam [W], of the modes under push and feet."""
    omega, feet = _beam_modes(np.array(_FEET), slope=False)
    pushed = _beam_modes(np.array([_PUSHED]), slope=False)[1][:, 0]
    w = 2.0 * pi * f[:, None]
    q = (pushed - joined.force @ feet.T) / (omega**2 * (1.0 + 1j * _LOSS) - w**2)
    moved = 1j * w * q
    lost = 0.5 * w[:, 0] * _LOSS * np.sum(omega**2 * np.abs(q) ** 2, axis=1)
    return 0.5 * np.real(moved @ pushed), lost


def _beam() -> Iterator[Check]:
    f = np.array([row[0] for row in BEAM_ON_PLATE])
    source = beam_source(f)
    joined = couple(source, InfinitePlate(plate=THIN_PLATE, points=source.points))
    power, lost = _power_in(f, joined)
    text = "modes of a free beam on the point and transfer mobilities of a plate, solved 2 x 2"
    for i, (frequency, given, one, two) in enumerate(BEAM_ON_PLATE):
        for what, expected, computed in (
            ("power into the beam", given, power[i]),
            ("power of foot 1", one, joined.power[i, 0]),
            ("power of foot 2", two, joined.power[i, 1]),
        ):
            yield check(
                f"{frequency:g} Hz: {what} [W]", expected, computed, 1e-8, text, reason=_DIGITS
            )
    residual = np.abs(power - lost - joined.power.sum(axis=1)) / power
    yield check(
        "beam on a plate: largest residual of the powers, relative",
        0.0,
        float(residual.max()),
        1e-12,
        "injected = lost in the beam + power of the feet",
        reason=_ROUND_OFF,
    )


def _blocked() -> Iterator[Check]:
    """Blocked force found in situ on six random receivers of 1e-4 to 1e2 of the source."""
    source = beam_source(np.array([6e3]), slopes=True)
    draw = np.random.default_rng(0)
    largest = np.abs(source.mobility).max()
    worst = 0.0
    for size in 10.0 ** draw.uniform(-4.0, 2.0, 6):
        R = draw.normal(size=(11, 6)) + 1j * draw.normal(size=(11, 6))
        Y = size * largest * (R @ R.T)
        further = tuple(Freedom(f"indicator {i}", 3) for i in range(7))
        receiver = KnownReceiver(
            mobility=partial(_constant, Y),
            freedoms=source.freedoms + further,
            points=source.points + tuple(InterfacePoint(name=f.point) for f in further),
        )
        joint = junction(source, receiver)
        for chosen in (source.freedoms, further):
            test = virtual_test(joint, length=0.04, indicators=[str(f) for f in chosen])
            worst = max(worst, float(test.deviation[0]))
    yield check(
        "blocked force found in situ on six random receivers, largest deviation, relative",
        0.0,
        worst,
        1e-9,
        "independent of the receiver (Moorhouse, Elliott & Evans 2009)",
        reason="condition numbers of up to 1e5",
    )


def _constant(Y: Complexes, s: Complexes) -> Complexes:
    return np.broadcast_to(Y, (s.size, *Y.shape))


def _equivalents() -> Iterator[Check]:
    f = np.array([row[0] for row in EQUIVALENTS])
    found = single_equivalents(beam_source(f))
    for i, (frequency, force, velocity) in enumerate(EQUIVALENTS):
        for what, expected, computed in (
            ("equivalent blocked force [N]", force, found.force[i]),
            ("equivalent free velocity [m/s]", velocity, found.velocity[i]),
        ):
            yield check(
                f"{frequency:g} Hz: {what}",
                expected,
                float(computed),
                1e-6,
                "EN 15657:2018, (15), (18), the beam on two infinite plates, by hand",
                reason=_DIGITS,
            )


# --------------------------------------------------------------------------- plates


def _plates() -> Iterator[Check]:
    yield from _rings()
    side, stiffness = 0.5, THIN_PLATE.bending_stiffness
    middle = (InterfacePoint(name="middle", position=np.array([side / 2, side / 2, 0.0])),)
    model = finite_plate(THIN_PLATE, (side, side), middle, highest=2e3)
    low = laplace(np.array([1e-3]))
    compliance = np.real(model.at(low).mobility[0, 0, 0] / low[0])
    yield check(
        "deflection of a square plate under a force in its middle, over F a^2/D",
        0.0116008,
        compliance * stiffness / side**2,
        2e-5,
        "Timoshenko & Woinowsky-Krieger 1959, sec. 34, its series summed",
    )
    feet = (
        InterfacePoint(name="a", position=np.array([0.31, 0.27, 0.0])),
        InterfacePoint(name="b", position=np.array([0.35, 0.30, 0.0])),
    )
    f = np.linspace(2e3, 8e3, 4001)
    damped = Plate(thickness=1.5e-3, area=0.8, material=PLATE_STEEL, loss_factor=0.02)
    finite = finite_plate(damped, (1.0, 0.8), feet, highest=8e3, radius=4e-3)
    infinite = InfinitePlate(plate=damped, points=feet, radius=4e-3)
    mean, limit = (receiver.at(laplace(f)).mobility.mean(axis=0) for receiver in (finite, infinite))
    for i, name in ((0, "force [m/(N s)]"), (1, "moment [1/(N m s)]")):
        for part in ("real", "imag"):
            yield check(
                f"finite plate, mean over frequency against the infinite one, {name}, {part}",
                float(getattr(limit[i, i], part)),
                float(getattr(mean[i, i], part)),
                0.06,
                "Cremer, Heckl & Petersson 2005, sec. 5.2",
                reason="the mean ends at two octaves",
            )


def _rings() -> Iterator[Check]:
    """Feet of an infinite plate against sums over points on their circles."""
    a, f = 4e-3, np.array([3e3])
    feet = (
        InterfacePoint(name="a", position=np.array([0.30, 0.25, 0.0])),
        InterfacePoint(name="b", position=np.array([0.34, 0.28, 0.0])),
    )
    Y = InfinitePlate(plate=THIN_PLATE, points=feet, radius=a).at(laplace(f)).mobility[0]
    k = (2.0 * pi * f[0]) ** 0.5 * (THIN_PLATE.mass_per_area / THIN_PLATE.bending_stiffness) ** 0.25
    angle = 2.0 * pi * (np.arange(64) + 0.5) / 64
    ring = a * np.array([np.cos(angle), np.sin(angle)]).T
    a_ring, b_ring = (foot.position[:2] + ring for foot in feet)
    r = np.linalg.norm(a_ring[:, None] - b_ring[None], axis=2)
    G = THIN_PLATE.mobility * (
        scipy.special.hankel2(0, k * r) - 2j / pi * scipy.special.kv(0, k * r)
    )
    means = np.array([np.ones(64), 2.0 / a * np.sin(angle), -2.0 / a * np.cos(angle)]) / 64
    yield check(
        "feet of a plate, 50 mm apart: all mobilities, largest deviation, relative",
        0.0,
        float(np.abs(means @ G @ means.T / Y[:3, 3:] - 1.0).max()),
        1e-12,
        "H_0 - (2i/pi) K_0 summed over 64 points of either circle",
        reason=_ROUND_OFF,
    )
    yield check(
        "real part of the moment mobility of an infinite plate [1/(N m s)]",
        2.0 * pi * f[0] / (16.0 * THIN_PLATE.bending_stiffness),
        float(np.real(Y[1, 1])),
        0.05,
        "omega/(16 D) (Cremer, Heckl & Petersson 2005, table 5.1)",
        reason="for ka << 1; here 0.3",
    )


# --------------------------------------------------------------------------- time

_M1, _M2, _K1, _C1, _MB, _KB, _CB = 0.02, 0.04, 1e7, 5.0, 0.5, 2e5, 3.0
_PULSE = 100e-6  # [s]
_STEP = 5e-6  # [s]


def two_masses(f: Vector, shift: float) -> SourceAtMounts:
    """20 g on 40 g, free, under a half sine of 1 N and 100 us on the first mass."""
    s = laplace(f, shift)
    w = pi / _PULSE
    force = (np.exp(-s * _PULSE) + 1.0) * w / (s**2 + w**2)
    D = np.empty((s.size, 2, 2), dtype=complex)
    spring = _C1 * s + _K1
    D[:, 0, 0], D[:, 1, 1] = _M1 * s**2 + spring, _M2 * s**2 + spring
    D[:, 0, 1] = D[:, 1, 0] = -spring
    Y = s[:, None, None] * np.linalg.inv(D)
    return SourceAtMounts(
        frequency=f,
        shift=shift,
        points=_END,
        freedoms=_AXIAL,
        free_velocity=Y[:, 1:, 0] * force[:, None],
        blocked_force=Y[:, 1:, 0] / Y[:, 1:, 1] * force[:, None],
        mobility=Y[:, 1:, 1:],
    )


def two_masses_exact(count: int) -> Vector:
    """Velocity of the joint [m/s], every 5 us, of the same on 0.5 kg on a damped spring."""
    M = np.diag([_M1, _M2 + _MB])
    K = np.array([[_K1, -_K1], [-_K1, _K1 + _KB]])
    C = np.array([[_C1, -_C1], [-_C1, _C1 + _CB]])
    A = np.zeros((6, 6))  # x, v, and the half sine with its generator
    A[:2, 2:4] = np.eye(2)
    A[2:4, :2], A[2:4, 2:4] = -np.linalg.solve(M, K), -np.linalg.solve(M, C)
    A[2, 4] = 1.0 / _M1
    A[4, 5], A[5, 4] = pi / _PULSE, -pi / _PULSE
    step = scipy.linalg.expm(A * _STEP)
    state, values = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 1.0]), np.empty(count)
    for i in range(count):
        if i == round(_PULSE / _STEP):
            state[4:] = 0.0
        values[i] = state[3]
        state = step @ state
    return values


DAMPED_MASS = KnownReceiver(
    points=_END,
    freedoms=_AXIAL,
    mobility=lambda s: (s / (_MB * s**2 + _CB * s + _KB))[:, None, None],
)
"""0.5 kg on a damped spring."""


def _signal() -> Iterator[Check]:
    signal = model_signal(
        two_masses, lambda source: couple(source, DAMPED_MASS), step=_STEP, duration=20e-3
    )
    found = signal.velocity[:, 0]
    exact = two_masses_exact(found.size)
    time = 1e3 * _STEP * np.arange(found.size, dtype=float)
    yield check(
        "velocity of a joint over 20 ms, largest deviation over the peak, relative",
        0.0,
        float(np.abs(found - exact).max() / np.abs(exact).max()),
        2e-6,
        "matrix exponential of both bodies and the half sine",
        curve=ComparedCurve(
            x_label="time [ms]",
            y_label="velocity [m/s]",
            expected=(time, exact),
            computed=(time, found),
        ),
    )
