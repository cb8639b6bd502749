"""Reduction against the exact rod: residual flexibility, receptance, attachment modes."""

from collections.abc import Iterator, Sequence

import numpy as np

from klack.bodies.elasticity.body import ElasticBody, elastic_body
from klack.bodies.elasticity.eigen import Modes, eigenmodes
from klack.bodies.elasticity.statics import Flexibility
from klack.bodies.reduction.attachment import shift_at
from klack.bodies.reduction.damping import LossFactor
from klack.bodies.reduction.full_order import direct_receptance, full_order_receptance
from klack.bodies.reduction.ports import Observer, Port, surface_port
from klack.bodies.reduction.receptance import reduced_receptance
from klack.bodies.reduction.reduce import reduce_body
from klack.bodies.reduction.reduced_body import ReducedBody
from klack.bodies.reduction.selection import ByCount
from klack.materials.material import Material
from klack.verification.check import Check, ComparedCurve, check
from klack.verification.lattice import lattice_mesh

__all__ = ["LENGTH", "RADIUS", "STEEL_WITHOUT_POISSON", "checks", "rod"]

LENGTH, RADIUS = 30e-3, 0.2e-3
"""So slender that all modes below 5 MHz are longitudinal [m]."""
STEEL_WITHOUT_POISSON = Material(name="bar", young=210e9, poisson=0.0, density=7850.0)
_LOSS = 1e-2
_DAMPING = LossFactor(eta=_LOSS)
_SPRING = STEEL_WITHOUT_POISSON.young * np.pi * RADIUS**2 / LENGTH  # EA / L


def rod(*, elements: int, clamped: bool) -> tuple[ElasticBody, Port, Port]:
    """Rod of revolution without Poisson's ratio, and its lower and upper end ports.

    The upper end may be clamped; ports are axial and uniform; ``elements`` have eight nodes.
    """
    mesh = lattice_mesh(
        "quad8", [np.array([0.0, RADIUS]), np.linspace(0.0, LENGTH, elements + 1)], solid="rod"
    )
    body = elastic_body(
        "rod",
        mesh,
        {"rod": STEEL_WITHOUT_POISSON},
        fixed_nodes=mesh.surface("top").nodes if clamped else (),
    )
    lower, upper = (surface_port(mesh, end, "z", name=end) for end in ("bottom", "top"))
    return body, lower, upper


def checks() -> list[Check]:
    """Run all checks of this group."""
    free, lower, upper = rod(elements=80, clamped=False)
    clamped, tip, _ = rod(elements=80, clamped=True)
    pool, flexibility = eigenmodes(free, count=12), Flexibility(free)
    pool_clamped, flexibility_clamped = eigenmodes(clamped, count=12), Flexibility(clamped)

    def reduced(count: int, correction: str) -> ReducedBody:
        return reduce_body(
            free,
            [lower, upper],
            modes=ByCount(count),
            correction=correction,  # type: ignore[arg-type]
            damping=_DAMPING,
            modes_pool=pool,
            flexibility=flexibility,
        )

    held = reduce_body(
        clamped,
        [tip],
        modes=ByCount(10),
        correction="consistent",
        damping=_DAMPING,
        modes_pool=pool_clamped,
        flexibility=flexibility_clamped,
    )
    plain, corrected = reduced(5, "consistent"), reduced(5, "attachment")
    return [
        *_static_checks(plain, corrected, held),
        *_receptance_checks(free, lower, upper, flexibility, pool),
        _correction_check(reduced(10, "attachment")),
        *_shift_checks(free, lower, upper, pool, flexibility),
    ]


def _static_checks(plain: ReducedBody, corrected: ReducedBody, held: ReducedBody) -> list[Check]:
    odd = 2 * np.arange(1, 11) - 1
    series = "series over the modes of a rod, Craig & Kurdila 2006, ch. 17"
    return [
        check(
            "free rod: elastic compliance at the end, inertia relief (L/EA)",
            expected=1 / 3,
            computed=plain.static_compliance[0, 0] * _SPRING,
            tolerance=1e-11,
            source="L / (3 E A), free-free rod",
        ),
        check(
            "free rod: compliance that 5 modes miss (L/EA)",
            expected=1 / 3 - 2 / np.pi**2 * np.sum(1 / np.arange(1, 6) ** 2),
            computed=plain.residual_compliance[0, 0] * _SPRING,
            tolerance=5e-5,
            source=series,
        ),
        check(
            "clamped rod: compliance that 10 modes miss (L/EA)",
            expected=1 - 8 / np.pi**2 * np.sum(1 / odd**2),
            computed=held.residual_compliance[0, 0] * _SPRING,
            tolerance=1e-3,
            source=series,
        ),
        check(
            "free rod: compliance that 5 modes and attachment modes miss (L/EA)",
            expected=0.0,
            computed=corrected.residual_compliance[0, 0] * _SPRING,
            tolerance=2e-12,
            source="MacNeal 1971: residual modes make the static response exact",
        ),
        check(
            "free rod: mass seen by a unit axial velocity (kg)",
            expected=STEEL_WITHOUT_POISSON.density * np.pi * RADIUS**2 * LENGTH,
            computed=float(plain.rigid_axial @ plain.rigid_axial),
            tolerance=5e-14,
            source="rho A L",
        ),
    ]


def exact_receptance(frequencies: np.ndarray) -> np.ndarray:
    """Free-free rod, ``E (1 + i eta)``: drive-point and end-to-end (n, 2) [m/N]."""
    E = STEEL_WITHOUT_POISSON.young * (1 + 1j * _LOSS)
    k = 2 * np.pi * frequencies / np.sqrt(E / STEEL_WITHOUT_POISSON.density)
    scale = -1 / (E * np.pi * RADIUS**2 * k)
    return np.stack([scale / np.tan(k * LENGTH), scale / np.sin(k * LENGTH)], axis=1)


def _receptance_checks(
    body: ElasticBody, lower: Port, upper: Port, flexibility: Flexibility, pool: Modes
) -> Iterator[Check]:
    axis = np.geomspace(1e3, 800e3, 400)
    full = full_order_receptance(
        body, [lower, upper], axis, loss_factor=_LOSS, flexibility=flexibility, checks=2
    )
    exact = exact_receptance(axis)
    source = "-cot(kL)/(EAk), -1/(sin(kL) EAk), k = w sqrt(rho/E(1+i eta)); eta 0.01"
    computed = full.receptance.values[:, 0, :]
    names = ("drive-point", "end-to-end")
    worst = np.max(np.abs(computed / exact - 1), axis=0)
    curves = [_receptance_curve(axis, exact[:, i], computed[:, i]) for i in range(2)]
    yield from [
        check(
            f"free rod, 1 to 800 kHz: largest relative deviation, {name}",
            expected=0.0,
            computed=float(deviation),
            tolerance=5e-3,
            source=source,
            curve=curve,
        )
        for name, deviation, curve in zip(names, worst, curves, strict=True)
    ]
    yield check(
        "Krylov receptance against direct solutions, largest relative deviation",
        expected=0.0,
        computed=float(full.checked_deviations.max()),
        tolerance=2e-10,
        source="K - w^2 M factorised at two frequencies",
    )
    direct = direct_receptance(body, [lower, upper], np.array([20e3, 300e3])).values
    yield check(
        "reciprocity: end-to-end receptance there and back, largest relative difference",
        expected=0.0,
        computed=float(np.max(np.abs(direct[:, 0, 1] / direct[:, 1, 0] - 1))),
        tolerance=5e-14,
        source="Maxwell-Betti; each direction has its own direct solution",
    )


def _correction_check(reduced: ReducedBody) -> Check:
    axis = np.linspace(5e3, 400e3, 400)
    computed = reduced_receptance(reduced, axis, with_residual=False, loss_factor=_LOSS)
    exact = exact_receptance(axis)[:, 0]
    return check(
        "10 modes and attachment modes, 5 to 400 kHz: largest relative deviation",
        expected=0.0,
        computed=float(np.max(np.abs(computed.values[:, 0, 0] / exact - 1))),
        tolerance=2e-2,
        source="-cot(kL)/(EAk)",
        curve=_receptance_curve(axis, exact, computed.values[:, 0, 0]),
    )


def undamped_receptance(frequency: float) -> np.ndarray:
    """The same undamped at a frequency [Hz], or ``i`` times it below zero."""
    E, rho = STEEL_WITHOUT_POISSON.young, STEEL_WITHOUT_POISSON.density
    k = 2 * np.pi * abs(frequency) * np.sqrt(complex(np.sign(frequency)) * rho / E)
    ends = -1 / (E * np.pi * RADIUS**2 * k * np.array([np.tan(k * LENGTH), np.sin(k * LENGTH)]))
    return np.asarray(ends.real)


def missing_with_shifts(frequencies: Sequence[float], *, kept: int) -> float:
    """Static compliance (L/EA) that cosines and responses at shifts miss at an end."""
    first = np.sqrt(STEEL_WITHOUT_POISSON.young / STEEL_WITHOUT_POISSON.density) / (2 * LENGTH)
    squares = np.arange(kept + 1.0, 20_001.0) ** 2  # of the omitted modes, over that of the first
    shifts = [np.sign(f) * (f / first) ** 2 for f in frequencies]
    responses = np.column_stack([1 / (squares - s) for s in shifts])
    load = responses.sum(axis=0)
    projected = load @ np.linalg.solve(responses.T @ (squares[:, None] * responses), load)
    return float(2 / np.pi**2 * (np.sum(1 / squares) - projected))


def _shift_checks(
    body: ElasticBody, lower: Port, upper: Port, pool: Modes, flexibility: Flexibility
) -> list[Check]:
    """One kept mode and two shifted attachment modes."""
    frequencies = (190e3, -40e3)
    shifts = [shift_at(f) for f in frequencies]
    reduced = reduce_body(
        body,
        [lower],
        modes=ByCount(1),
        correction="attachment",
        damping=_DAMPING,
        observers=[Observer("far end", upper.pattern)],
        modes_pool=pool,
        flexibility=flexibility,
        shifts=shifts,
        recovery_nodes=np.arange(body.mesh.node_count),
    )
    deviations = []
    for frequency, shift in zip(frequencies, shifts, strict=True):
        read = np.column_stack([reduced.port_shapes[:, 0], reduced.observer_shapes[:, 0]])
        computed = (reduced.port_shapes[:, 0] / (reduced.omega**2 - shift)) @ read
        deviations.append(np.abs(computed / undamped_receptance(frequency) - 1))
    V = np.zeros((body.dof_count, 0)) if reduced.recovery is None else reduced.recovery.shapes
    low = (-100e3, -200e3)
    static = reduce_body(
        body,
        [lower],
        modes=ByCount(1),
        correction="attachment",
        damping=_DAMPING,
        modes_pool=pool,
        flexibility=flexibility,
        shifts=[shift_at(f) for f in low],
    )
    source = "-cot(kL)/(EAk), -1/(sin(kL) EAk), undamped; imaginary k for the shift below zero"
    return [
        *(
            check(
                f"1 mode and attachment modes shifted to 190 and -40 kHz: largest relative "
                f"deviation there, {name}",
                expected=0.0,
                computed=float(max(deviation[i] for deviation in deviations)),
                tolerance=1e-5,
                source=source,
            )
            for i, name in enumerate(("drive-point", "end-to-end (no port there)"))
        ),
        check(
            "free rod, 1 mode and two shifts of one port: number of modes, the rigid one included",
            expected=4.0,
            computed=float(reduced.mode_count),
            tolerance=0.0,
            source="1 + 1 + 2",
        ),
        check(
            "the same: largest deviation from orthonormality, of mass and of stiffness/omega_max^2",
            expected=0.0,
            computed=float(
                max(
                    np.abs(V.T @ (body.M @ V) - np.eye(reduced.mode_count)).max(),
                    np.abs(V.T @ (body.K @ V) - np.diag(reduced.omega**2)).max()
                    / reduced.omega.max() ** 2,
                )
            ),
            tolerance=1e-12,
            source="V^T M V = 1, V^T K V = diag(omega^2)",
        ),
        check(
            "free rod, 1 mode and shifts of -100 and -200 kHz: compliance that is missing (L/EA)",
            expected=missing_with_shifts(low, kept=1),
            computed=static.residual_compliance[0, 0] * _SPRING,
            tolerance=1e-3,
            source="20 000 cosines of the rod, projected onto the same two responses",
        ),
    ]


def _receptance_curve(
    frequency: np.ndarray,
    exact: np.ndarray,
    computed: np.ndarray,
) -> ComparedCurve:
    return ComparedCurve(
        x_label="frequency [kHz]",
        y_label="receptance [m/N]",
        expected=(frequency / 1e3, np.abs(exact)),
        computed=(frequency / 1e3, np.abs(computed)),
        x_log=True,
        y_log=True,
    )
