"""Magnetic circuits at rest, magnetisation curves, edge fields and eddy ladders."""

from collections.abc import Iterator
from math import pi

import numpy as np
from scipy.special import iv, jn_zeros

from klack.magnetics.air_gap import edges_beside_wall, equal_edges, round_excess, step_excess
from klack.magnetics.circuit import MagneticBranch, MagneticCircuit
from klack.magnetics.eddy import EddyLadder, cylinder_ladder, sheet_ladder
from klack.magnetics.flux_map import FluxMap
from klack.magnetics.iron import VACUUM_PERMEABILITY, froehlich
from klack.magnetics.iron_library import IRON_LIBRARY, iron_curve
from klack.magnetics.lifting_magnet import lifting_magnet
from klack.magnetics.reluctance import GapReluctance, LinearReluctance
from klack.magnetics.static import static_state
from klack.verification import published_magnets as published
from klack.verification.check import Check, ComparedCurve, check
from klack.verification.off_axis_gaps import off_axis_air_gaps

__all__ = ["checks"]

_MU0 = VACUUM_PERMEABILITY
_CORE = {"conductivity": 2e6, "length": 20e-3, "radius": 2e-3, "permeability": 1000.0}


def checks() -> list[Check]:
    """Return the checks."""
    return [
        *_two_poles(),
        *_energy(),
        *_iron(),
        *_edges(),
        *off_axis_air_gaps(),
        *_eddy(),
        *_map(),
        *_lifting_magnet(),
    ]


def _saturating_pair() -> MagneticCircuit:
    """Two equal poles of 12 mm^2, a saturating core, and a leakage of 5 nH."""
    area = 12e-6
    gap = GapReluctance([0.0, 1e-3], [1e-9, 2e-3 / (_MU0 * area)], [2.0 / (_MU0 * area)] * 2)
    return MagneticCircuit(
        branches=(
            MagneticBranch(name="gap", law=gap, turns=60.0),
            MagneticBranch(name="iron", law=froehlich(1.5, 1500.0).law(60e-3, area)),
            MagneticBranch(name="leakage", law=LinearReluctance(1.0 / 5e-9), turns=60.0),
        ),
        loops=np.array([[1, 0], [1, 0], [0, 1]]),
        main="gap",
    )


def _two_poles() -> list[Check]:
    source = "F = -phi^2/(mu0 A): two equal poles in series; Woodson and Melcher 1968, ch. 3"
    return [
        check(
            "force of two equal poles at 15 uWb, 12 mm^2 [N]",
            expected=-((15e-6) ** 2) / (_MU0 * 12e-6),
            computed=_saturating_pair().force(np.array([15e-6, 15e-6, 0.0]), 80e-6),
            tolerance=5e-14,
            source=source,
        )
    ]


def _energy() -> list[Check]:
    """Both forms of the force, and energy plus co-energy, in saturation."""
    circuit, current, gap, step = _saturating_pair(), 8.0, 80e-6, 1e-7
    state = static_state(circuit, current=current, gap=gap)
    beside = [static_state(circuit, current=current, gap=gap + s).coenergy for s in (-step, step)]
    currents = np.polynomial.legendre.leggauss(40)
    coenergy = sum(
        0.5 * current * w * static_state(circuit, current=0.5 * current * (1 + z), gap=gap).linkage
        for z, w in zip(*currents, strict=True)
    )
    return [
        check(
            "force from the flux against dW'/dx at constant current, saturated [N]",
            expected=(beside[1] - beside[0]) / (2.0 * step),
            computed=state.force,
            tolerance=1e-6,
            source="-dW/dx at constant flux = dW'/dx at constant current; difference over 0.2 um",
        ),
        check(
            "co-energy psi i - W against the integral of psi di, saturated [J]",
            expected=float(coenergy),
            computed=state.coenergy,
            tolerance=5e-8,
            source="Legendre transform; Gauss quadrature over the current",
        ),
    ]


def _iron() -> list[Check]:
    # H at B in A/m, computed from the formula by the provider of the coefficients
    given = {
        "9SMnPb28": ((1.0, 1990.7), (1.4, 3118.6), (1.8, 11842.0)),
        "X6Cr17": ((1.0, 1749.4), (1.4, 7289.2), (1.6, 18748.0)),
        "VACOFLUX 50": ((1.0, 188.12), (1.8, 468.94)),
    }
    worst = max(
        (abs(float(iron_curve(name).field(B)) / H - 1.0) for name in given for B, H in given[name])
    )
    least = min(float(np.min(iron_curve(name).slope)) for name in IRON_LIBRARY)
    curve = froehlich(2.0, 3000.0)
    H = np.linspace(1.0, 2e5, 500)
    a, b = 1.0 / (_MU0 * 2999.0), 1.0 / 2.0
    B = _MU0 * H + H / (a + b * H)
    # int B dH in closed form, and W = B H - W'
    coenergy = 0.5 * _MU0 * H**2 + (H - a / b * np.log1p(b / a * H)) / b
    return [
        check(
            "B-H curves of three materials, largest deviation [-]",
            expected=0.0,
            computed=worst,
            tolerance=5e-5,
            source="Modelica Standard Library, mu_rApprox; numbers given to 5 digits",
        ),
        check(
            "17 B-H curves rise everywhere: sign of the smallest slope dH/dB [-]",
            expected=1.0,
            computed=float(np.sign(least)),
            tolerance=0.0,
            source="monotone H(B), needed for one solution",
        ),
        check(
            "Froehlich curve, largest deviation of H(B) [-]",
            expected=0.0,
            computed=float(np.max(np.abs(curve.field(B) / H - 1.0))),
            tolerance=1e-6,
            source="B = mu0 H + H/(a + b H), 1 A/m to 200 kA/m",
        ),
        check(
            "Froehlich curve, largest deviation of the energy density [-]",
            expected=0.0,
            computed=float(np.max(np.abs(curve.energy_density(B) / (B * H - coenergy) - 1.0))),
            tolerance=1e-6,
            source="int H dB = B H - int B dH, closed form",
        ),
    ]


def _edges() -> list[Check]:
    wall, gap, shoulder = 5e-3, 20e-6, 2e-3
    narrow = 1e-6 * wall
    return [
        check(
            "edges beside a wall, narrow gap [-]",
            expected=(1.0 - np.log(2.0) + np.log(wall / narrow)) / pi,
            computed=float(edges_beside_wall(narrow, wall)[0]),
            tolerance=2e-6,
            source="limit g << D of the conformal map",
        ),
        check(
            "edges of two equal poles against Roters' arcs, shoulder 100 gaps [-]",
            expected=float(0.26 + np.log(1.0 + 2.0 * shoulder / gap) / pi),
            computed=float(equal_edges(gap, shoulder)[0]),
            tolerance=0.02,
            source="Roters 1941, ch. 5: 0.26 + ln(1 + 2 t/g)/pi (an estimate)",
        ),
        check(
            "step of a duct, small step [-]",
            expected=(2.0 / pi) * (1.0 - np.log(4e-3)),
            computed=step_excess(1e-6, 1e-3),
            tolerance=2e-6,
            source="limit g << D of Marcuvitz 1951, 5.34",
        ),
        check(
            "roundness of a wide core, edge number [-]",
            expected=0.0,
            computed=float(round_excess(1e-4, 1.0, 1.001)[0]),
            tolerance=2e-4,
            source="a wide core is flat",
        ),
    ]


def _eddy() -> list[Check]:
    mu = _MU0 * _CORE["permeability"]
    tau = mu * _CORE["conductivity"] * _CORE["radius"] ** 2
    R = _CORE["length"] / (mu * pi * _CORE["radius"] ** 2)
    one, four = (cylinder_ladder(**_CORE, terms=n) for n in (1, 4))
    sheet = sheet_ladder(
        conductivity=2e6,
        length=20e-3,
        thickness=2e-3,
        width=10e-3,
        permeability=1000.0,
        terms=4,
    )
    R_sheet = 20e-3 / (mu * 2e-3 * 10e-3)

    def impedance(ratio: np.ndarray) -> np.ndarray:
        z = np.sqrt(1j * ratio)
        return np.asarray(np.abs(z * iv(0, z) / (2.0 * iv(1, z))))

    ratios = np.geomspace(0.1, 1000.0, 80)
    driven = np.array([abs(1.0 + four.mmf_per_flux(1j * w / tau) / R) for w in ratios])
    times = np.linspace(0.01, 0.5, 99)
    steps = {
        name: ComparedCurve(
            x_label="time [mu sigma a^2]",
            y_label="mean flux over final flux [-]",
            expected=(times, exact(times)),
            computed=(times, np.array([_step(ladder, R0, t * tau) for t in times])),
        )
        for name, ladder, R0, exact in (
            ("cylinder", four, R, _cylinder_step),
            ("sheet", sheet, R_sheet, _sheet_step),
        )
    }
    return [
        check(
            "one eddy term: resistance of the shorted turn [ohm]",
            expected=8.0 * pi / (_CORE["conductivity"] * _CORE["length"]),
            computed=1.0 / one.conductances[0],
            tolerance=1e-14,
            source="Stoll 1974; R_e = 8 pi/(sigma l)",
        ),
        check(
            "four terms at omega tau = 10, |mmf/flux| of a cylinder [-]",
            expected=float(impedance(np.array(10.0))),
            computed=abs(1.0 + four.mmf_per_flux(10j / tau) / R),
            tolerance=1e-6,
            source="z I0(z)/(2 I1(z)), z^2 = j omega mu sigma a^2",
            curve=ComparedCurve(
                x_label="omega mu sigma a^2 [-]",
                y_label="mmf over flux [reluctance]",
                expected=(ratios, impedance(ratios)),
                computed=(ratios, driven),
                x_log=True,
                y_log=True,
            ),
        ),
        check(
            "four terms, slowest time constant of a cylinder over mu sigma a^2 [-]",
            expected=1.0 / float(jn_zeros(0, 1)[0]) ** 2,
            computed=float(1.0 / _rates(four, R)[0]) / tau,
            tolerance=1e-8,
            source="1/2.40483^2; Stoll 1974",
        ),
        *(
            check(
                f"four terms, mean flux of a {name} at t = {t:g} mu sigma a^2 [-]",
                expected=expected,
                computed=_step(ladder, R0, t * tau),
                tolerance=tolerance,
                source="exact series of flux diffusion after a step of the surface field",
                curve=steps[name],
            )
            for name, ladder, R0, t, expected, tolerance in (
                ("cylinder", four, R, 0.02, 0.2985639, 0.01),
                ("cylinder", four, R, 0.1, 0.6058242, 2e-4),
                ("sheet", sheet, R_sheet, 0.01, 0.2256758, 5e-3),
                ("sheet", sheet, R_sheet, 0.1, 0.6978819, 1e-6),
            )
        ),
    ]


def _cylinder_step(time: np.ndarray) -> np.ndarray:
    b = jn_zeros(0, 200)
    return np.asarray(1.0 - 4.0 * np.sum(np.exp(-np.outer(time, b**2)) / b**2, axis=1))


def _sheet_step(time: np.ndarray) -> np.ndarray:
    """Thickness ``a``, fields on both faces."""
    n = pi * (2.0 * np.arange(200) + 1.0)
    return np.asarray(1.0 - 8.0 * np.sum(np.exp(-np.outer(time, n**2)) / n**2, axis=1))


def _matrices(ladder: EddyLadder, R: float) -> tuple[np.ndarray, np.ndarray]:
    """Loop matrices of ``S phi' + K phi = (mmf, 0, ..)``."""
    n = len(ladder.conductances)
    S, K = np.zeros((n, n)), np.diag([R, *ladder.reluctances])
    for k, conductance in enumerate(ladder.conductances):
        v = np.zeros(n)
        v[k] = 1.0
        if k + 1 < n:
            v[k + 1] = -1.0
        S += conductance * np.outer(v, v)
    return S, K


def _rates(ladder: EddyLadder, R: float) -> np.ndarray:
    S, K = _matrices(ladder, R)
    return np.sort(np.linalg.eigvals(np.linalg.solve(S, K)).real)


def _step(ladder: EddyLadder, R: float, time: float) -> float:
    """Flux over its final value after a step of the mmf."""
    from scipy.linalg import expm

    S, K = _matrices(ladder, R)
    final = np.zeros(len(ladder.conductances))
    final[0] = 1.0
    return float((final - expm(-np.linalg.solve(S, K) * time) @ final)[0])


def _map() -> list[Check]:
    circuit = _saturating_pair()
    current, gap = np.linspace(0.0, 16.0, 33), np.linspace(40e-6, 160e-6, 13)
    table = [[static_state(circuit, current=i, gap=x).linkage for x in gap] for i in current]
    tabulated = FluxMap.of(current=current, gap=gap, linkage=table, force=None)
    state = static_state(circuit, current=7.3, gap=87e-6)
    return [
        check(
            "flux map of 33 currents and 13 gaps, force between the points [N]",
            expected=state.force,
            computed=tabulated.force_at(state.linkage, 87e-6),
            tolerance=2e-3,
            source="the circuit that the table was made of",
        )
    ]


def _lifting_magnet() -> Iterator[Check]:
    circuit = lifting_magnet()
    source = "finite elements; Modelica Standard Library, ComparisonQuasiStatic"
    states = [static_state(circuit, current=published.CURRENT, gap=float(x)) for x in published.GAP]
    curves = {
        what: ComparedCurve(
            x_label="gap [mm]",
            y_label=label,
            expected=(published.GAP * 1e3, known),
            computed=(published.GAP * 1e3, np.array(found)),
        )
        for what, label, known, found in (
            ("force", "force [N]", published.FORCE, [s.force for s in states]),
            (
                "inductance",
                "inductance [H]",
                published.INDUCTANCE,
                [s.inductance for s in states],
            ),
        )
    }
    for x, force, inductance, state in zip(
        published.GAP, published.FORCE, published.INDUCTANCE, states, strict=True
    ):
        for what, unit, expected, computed in (
            ("force", "N", force, state.force),
            ("inductance", "H", inductance, state.inductance),
        ):
            yield check(
                f"lifting magnet, {what} at a gap of {x * 1e3:.2f} mm [{unit}]",
                expected=float(expected),
                computed=computed,
                tolerance=0.1,
                source=source,
                curve=curves[what],
            )
