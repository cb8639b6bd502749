"""Vibration and radiation of a held body: rods, oscillators, plates, pistons, energy."""

from collections.abc import Iterator
from dataclasses import replace
from math import pi, sqrt

import numpy as np
from scipy.special import j1

from klack.acoustics.force_response import modal_response
from klack.acoustics.harmonic import harmonic_response
from klack.acoustics.injected import injected_density, injected_energy
from klack.acoustics.mobility import transfer_mobility
from klack.acoustics.mount import Mount, mounted
from klack.acoustics.plate import Air, Plate
from klack.acoustics.radiation import piston_efficiency, power_transfer
from klack.acoustics.surface_bands import face_band_velocity
from klack.bodies.elasticity.eigen import eigenmodes
from klack.bodies.elasticity.statics import Flexibility
from klack.bodies.reduction.damping import ModalDamping
from klack.bodies.reduction.ports import Port, surface_port
from klack.bodies.reduction.structure import Structure, StructurePort, build_structure
from klack.verification.check import Check, ComparedCurve, check
from klack.verification.lattice import STEEL
from klack.verification.one_dimension import half_sines
from klack.verification.reduction import LENGTH, RADIUS, STEEL_WITHOUT_POISSON, rod

__all__ = ["checks", "oscillator", "rod_structure"]

_AREA = pi * RADIUS**2
_WAVE = STEEL_WITHOUT_POISSON.density * STEEL_WITHOUT_POISSON.bar_wave_speed * _AREA  # rho c A
_MASS = STEEL_WITHOUT_POISSON.density * _AREA * LENGTH
_TRAVEL = LENGTH / STEEL_WITHOUT_POISSON.bar_wave_speed  # of a wave along the rod [s]


def rod_structure(*, modes: int = 12, damping: float = 0.0) -> Structure:
    """Rod held at its upper end, with the ports ``"tip"`` (lower face) and ``"skin"``."""
    body, lower, _ = rod(elements=80, clamped=True)
    ports = [Port("tip", lower.pattern), surface_port(body.mesh, "outer", "z", name="skin")]
    with Flexibility(body) as flexibility:
        deflections = flexibility.solve(np.column_stack([port.pattern for port in ports]))
        pool = eigenmodes(body, count=modes, flexibility=flexibility)
    return build_structure(
        body,
        modes=pool,
        damping=ModalDamping(ratio=damping),
        ports=[
            StructurePort(port=ports[0], stop="seat", sign=-1.0),
            StructurePort(port=ports[1]),
        ],
        deflections=deflections,
        surfaces=("bottom", "outer"),
    )


def oscillator(*, mass: float, stiffness: float, base: float, damping: float = 0.0) -> Structure:
    """One mass on a spring on a base that is held: the smallest structure.

    Its surface is a plate of 1 cm^2 on the mass, facing +z; ``base`` [kg] is held.
    """
    shape, area = 1.0 / sqrt(mass), 1e-4
    columns = np.array([shape, 0.0, 1.0])
    return Structure(
        name="oscillator",
        mass=mass + base,
        dimension=2,
        omega=np.array([sqrt(stiffness / mass)]),
        damping=np.array([damping]),
        port_names=("mass",),
        port_stops=("seat",),
        port_signs=np.array([1.0]),
        port_shapes=np.array([[shape]]),
        static_compliance=np.array([[1.0 / stiffness]]),
        participation=np.array([sqrt(mass)]),
        group_names=("face",),
        group_area=np.array([area]),
        group_gram=area * columns[None, :, None] * columns[None, None, :],
        group_volume=area * columns[None],
        points=np.array([[0.0, 0.0], [sqrt(area / pi), 0.0]]),
        faces=np.array([[1, 0]]),
        face_group=np.array([0]),
        face_area=np.array([area]),
        face_shapes=np.array([[shape]], dtype=np.float32),
        face_residual=np.array([[0.0]], dtype=np.float32),
        axial_normals=np.array([1.0]),
    )


def checks() -> list[Check]:
    """Run all checks of this group."""
    return [*_rods(), *_mounts(), *_energies(), *_plates(), *_pistons(), *_surfaces()]


def _rods() -> Iterator[Check]:
    held = rod_structure()
    axis = np.linspace(0.05, 6.2, 247)  # omega L / c; no point on a resonance
    f = axis / (2.0 * pi * _TRAVEL)
    mobility, support = (
        ComparedCurve(
            x_label="omega L/c [-]",
            y_label=label,
            expected=(axis, np.abs(exact)),
            computed=(axis, np.abs(found)),
            y_log=True,
        )
        for label, exact, found in (
            (
                "mobility [1/(rho c A)]",
                np.tan(axis),
                transfer_mobility(held, "tip", "tip", f) * _WAVE,
            ),
            (
                "support force over force [-]",
                1.0 / np.cos(axis),
                harmonic_response(held, f, "tip").support_force,
            ),
        )
    )
    for x in (0.4, 2.3, 5.1):  # omega L / c between resonances; the highest mode has 36
        f = np.array([x / (2.0 * pi * _TRAVEL)])
        yield check(
            f"held rod driven at its end, mobility at omega L/c = {x:g} (1/(rho c A))",
            expected=float(np.tan(x)),
            computed=float(transfer_mobility(held, "tip", "tip", f)[0].imag * _WAVE),
            tolerance=1e-3,
            source="Y = i tan(omega L/c) / (rho c A), Cremer, Heckl & Petersson 2005",
            reason="the modes left out are taken as static: an error with omega squared",
            curve=mobility,
        )
        yield check(
            f"held rod, force on its support at omega L/c = {x:g} (driving force)",
            expected=float(1.0 / np.cos(x)),
            computed=float(harmonic_response(held, f, "tip").support_force[0].real),
            tolerance=1e-3,
            source="R = F / cos(omega L/c)",
            reason="the modes left out are taken as static: an error with omega squared",
            curve=support,
        )
    f = np.array([1.7 / (2.0 * pi * _TRAVEL)])
    there = transfer_mobility(held, "skin", "tip", f)[0]
    back = transfer_mobility(held, "tip", "skin", f)[0]
    yield check(
        "transfer mobility there over back",
        expected=1.0,
        computed=float((there / back).real),
        tolerance=5e-14,
        source="reciprocity",
    )


def _mounts() -> list[Check]:
    loose = mounted(rod_structure(), Mount(stiffness=1e-3, loss_factor=0.0))
    x = 2.3
    mass, stiffness, base, below = 0.3, 4e6, 0.9, 2e6
    pair = mounted(
        oscillator(mass=mass, stiffness=stiffness, base=base),
        Mount(stiffness=below, loss_factor=0.0),
    )
    K = np.array([[stiffness, -stiffness], [-stiffness, stiffness + below]])
    force = half_sines(step=1e-7, count=4000, times=(1e-5,), length=2e-5)
    flying = modal_response(loose, {"tip": force})
    share = float(np.sum(flying.blocked_force.values) * 1e-7 / np.sum(force.values * 1e-7))
    return [
        check(
            "two masses on two springs: lower frequency [rad/s]",
            expected=float(np.sqrt(np.linalg.eigvals(K / np.array([[mass], [base]])).min())),
            computed=float(pair.omega[0]),
            tolerance=5e-14,
            source="eigenvalues of the 2 x 2 system",
        ),
        check(
            f"rod on a very soft mount, mobility at omega L/c = {x:g} (1/(rho c A))",
            expected=float(-1.0 / np.tan(x)),
            computed=float(
                transfer_mobility(loose, "tip", "tip", np.array([x / (2.0 * pi * _TRAVEL)]))[0].imag
                * _WAVE
            ),
            tolerance=2e-3,
            source="Y = -i cot(omega L/c) / (rho c A), free rod",
        ),
        check(
            "rod on a very soft mount, force on it over that of the impact",
            expected=0.0,
            computed=share,
            tolerance=1e-5,  # (omega_0 t)^2 / 2 of the mount
            source="a free body takes all momentum",
        ),
    ]


def _energies() -> list[Check]:
    body = rod_structure(damping=0.01)
    first = half_sines(step=20e-9, count=20_000, times=(1e-5, 1.2e-4), length=1.1e-5)
    second = half_sines(step=20e-9, count=20_000, times=(5e-5,), length=2e-5)
    forces = {"tip": first, "skin": second}
    run = modal_response(body, forces)
    return [
        check(
            "energy injected less energy in the modes and lost (energy injected)",
            expected=0.0,
            computed=run.residual,
            tolerance=2e-11,
            source="balance of three sums taken apart",
        ),
        check(
            "vibration energy, over time against Re(Y) |F|^2 over frequency [J]",
            expected=run.vibration_energy,
            computed=injected_energy(injected_density(body, forces)),
            tolerance=1e-7,
            source="Parseval",
        ),
        check(
            "held rod at rest, force on its support (driving force)",
            expected=1.0,
            computed=float(harmonic_response(body, np.array([0.0]), "tip").support_force[0].real),
            tolerance=5e-14,
            source="equilibrium",
        ),
    ]


def _plates() -> list[Check]:
    plate = Plate(thickness=1e-3, area=0.5, material=STEEL)
    air = Air()
    return [
        check(
            "infinite plate, mobility at a point (1/sqrt(D m''))",
            expected=_plate_integral(0.05).real,
            computed=plate.mobility * sqrt(plate.bending_stiffness * plate.mass_per_area),
            tolerance=2e-3,  # the loss factor of 0.05 that the integral needs changes 1e-3
            source="iw/(2 pi) integral of k dk / (D (1 + i eta) k^4 - m'' w^2)",
        ),
        check(
            "steel plate of 1 mm, coincidence [kHz]",
            expected=12.0,
            computed=plate.coincidence(air) / 1e3,
            tolerance=0.03,
            source="f_c h = 12 Hz m for steel, e.g. Fahy & Gardonio 2007",
        ),
        check(
            "plate at twice its coincidence, radiation efficiency",
            expected=sqrt(2.0),
            computed=float(plate.efficiency(np.array([2.0 * plate.coincidence(air)]), air)[0]),
            tolerance=5e-14,
            source="1 / sqrt(1 - f_c / f)",
        ),
    ]


def _plate_integral(loss: float) -> complex:
    """Mobility times sqrt(D m'') with D = m'' = omega = 1, by integration over wave numbers."""
    # k = tan(x) brings infinity near; the trapezoidal rule resolves the pole near k = 1
    x = 0.5 * pi * (np.arange(20_000) + 0.5) / 20_000
    k = np.tan(x)
    return complex(
        1j / (2.0 * pi) * np.mean(k / ((1.0 + 1j * loss) * k**4 - 1.0) * (1.0 + k**2)) * 0.5 * pi
    )


def _pistons() -> Iterator[Check]:
    radius, c = 0.01, 340.0
    axis = np.geomspace(0.05, 10.0, 100)
    found = piston_efficiency(axis * c / (2.0 * pi * radius), pi * radius**2, c)
    curve = ComparedCurve(
        x_label="k a [-]",
        y_label="radiation efficiency [-]",
        expected=(axis, np.array([_piston_integral(ka) for ka in axis])),
        computed=(axis, found),
        x_log=True,
        y_log=True,
    )
    for ka in (0.1, 1.0, 3.0):
        yield check(
            f"piston in a baffle, radiation efficiency at k a = {ka:g}",
            expected=_piston_integral(ka),
            computed=float(
                piston_efficiency(np.array([ka * c / (2.0 * pi * radius)]), pi * radius**2, c)[0]
            ),
            tolerance=2e-12,
            source="far-field intensity (2 J1(x)/x)^2, x = k a sin(theta), integrated",
            reason="1 - J1(2 ka)/ka cancels at small ka; one tolerance for all",
            curve=curve,
        )


def _piston_integral(ka: float) -> float:
    nodes, weights = np.polynomial.legendre.leggauss(80)
    theta = 0.25 * pi * (nodes + 1.0)
    x = ka * np.sin(theta)
    integrand = (2.0 * j1(x) / x) ** 2 * np.sin(theta)
    return float(0.5 * ka**2 * 0.25 * pi * np.sum(weights * integrand))


def _surfaces() -> list[Check]:
    loose, air = rod_structure(), Air()
    f = np.array([20.0])
    rigid = power_transfer(
        loose, f, "tip", mount=Mount(stiffness=1e-9, loss_factor=0.0), efficiency="unity", air=air
    )
    speed = 1.0 / (2.0 * pi * f[0] * _MASS)
    body = rod_structure(damping=0.02)
    force = half_sines(step=20e-9, count=100_000, times=(1e-5,), length=1.1e-5)
    run = modal_response(body, {"tip": force}, sample=40e-9)
    face = int(np.argmin(body.axial_normals))  # on the driven end
    bands = np.column_stack([np.geomspace(1e2, 2e6, 30)[:-1], np.geomspace(1e2, 2e6, 30)[1:]])
    over_bands = np.sum(
        face_band_velocity(
            replace(body, face_residual=np.zeros_like(body.face_residual)), {"tip": force}, bands
        )[:, face]
        ** 2
    )
    return [
        check(
            "rod that moves as a whole, radiated power by rho c v^2 times its end face [W/N^2]",
            expected=air.impedance * speed**2 * _AREA,
            computed=float(rigid.total[0]),
            tolerance=1e-6,
            source="integral of n_z^2 dA = pi R^2, exactly",
        ),
        check(
            "velocity of a face, squares over the bands against those over time [m^2/s]",
            expected=float(np.sum((run.modal_velocity @ body.face_shapes[face]) ** 2) * 40e-9),
            computed=float(over_bands),
            tolerance=1e-4,
            source="Parseval",
        ),
    ]
