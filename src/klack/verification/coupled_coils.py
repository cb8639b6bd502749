r"""Checks of coils of one magnet on drivers of their own: a transformer, and two coils of a valve.

Without iron the linkages are linear in the currents, :math:`\psi = L i` with

.. math:: L = \begin{pmatrix} N_1^2(\Lambda + \Lambda_1) & N_1 N_2 \Lambda \\
                              N_1 N_2 \Lambda & N_2^2(\Lambda + \Lambda_2) \end{pmatrix},

and currents follow from matrix exponentials.  With iron the linkages themselves are integrated by
SciPy, the main flux being the root of one equation by Froehlich's formula.
"""

from functools import partial
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from scipy.optimize import brentq

from klack.magnetics.driver import Driver
from klack.magnetics.magnetic_network import MagneticNetwork
from klack.magnetics.static import static_state
from klack.magnetics.two_point import TwoPoint
from klack.magnetics.voltage_step import VoltageStep
from klack.magnetics.voltage_table import VoltageTable
from klack.mechanics.prescribed_motion import PrescribedMotion
from klack.network.network import Network
from klack.simulation.network_result import NetworkResult
from klack.simulation.network_run import simulate_network
from klack.verification.check import Check, compare

__all__ = ["coupled_coils", "two_coils"]

Vector = NDArray[np.float64]

_check = partial(compare, "drivers")
_MU0 = 4e-7 * np.pi
_TURNS = np.array([100.0, 40.0])
_LEAK = np.array([20e-9, 35e-9])
_RESISTANCE = np.array([0.8, 2.0])
_AREA, _GAP, _RESIDUAL = 30e-6, 100e-6, 50e-6
_MAIN = _MU0 * _AREA / (_GAP + _RESIDUAL)
_SATURATION, _INITIAL = 1.5, 1500.0
_IRON, _SECTION = 40e-3, 25e-6
_STEP = 2e-7


def two_coils(*, iron: bool = False) -> MagneticNetwork:
    """Gap with two coils, each with a leakage of its own, in series with iron or not."""
    elements: dict[str, object] = {
        "first": {"kind": "coil", "between": ["a", "b"], "turns": _TURNS[0]},
        "first_leakage": {"kind": "leakage", "between": ["a", "b"], "permeance": _LEAK[0]},
        "second": {
            "kind": "coil",
            "between": ["b", "c"],
            "turns": _TURNS[1],
            "circuit": "other",
        },
        "second_leakage": {"kind": "leakage", "between": ["b", "c"], "permeance": _LEAK[1]},
        "gap": {
            "kind": "face",
            "between": ["d" if iron else "c", "a"],
            "area": _AREA,
            "residual_gap": _RESIDUAL,
        },
    }
    if iron:
        froehlich = {"saturation": _SATURATION, "permeability": _INITIAL}
        elements["core"] = {
            "kind": "iron",
            "between": ["c", "d"],
            "material": {"froehlich": froehlich},
            "length": _IRON,
            "area": _SECTION,
        }
    return MagneticNetwork.model_validate(
        {
            "resistance": _RESISTANCE[0],
            "circuits": {"other": {"resistance": _RESISTANCE[1]}},
            "gap": _GAP,
            "elements": elements,
        }
    )


def coupled_coils() -> list[Check]:
    """Return the checks of several coils."""
    return [*_transformer(), *_flyback(), *_static(), *_saturated(), *_series()]


def _run(
    magnet: MagneticNetwork,
    first: Driver,
    second: Driver,
    *,
    duration: float,
    motion: PrescribedMotion | None = None,
    step: float = _STEP,
) -> NetworkResult:
    body = motion or PrescribedMotion(time=(0.0, 1.0), displacement=(0.0, 0.0))
    network = Network(
        {"body": body, "magnet": magnet, "one": first, "two": second},
        [
            ["body.body", "magnet.armature"],
            ["magnet.terminals", "one.terminals"],
            ["magnet.other", "two.terminals"],
        ],
    )
    return simulate_network(
        network.rows(), duration=duration, step=step, coarse=1, record=5.0 * step
    )


def _inductance() -> Vector:
    return np.asarray(np.outer(_TURNS, _TURNS) * _MAIN + np.diag(_TURNS**2 * _LEAK))


def _last(result: NetworkResult, name: str) -> float:
    return float(result.channels[f"magnet {name}"].values[-1])


def _transformer() -> list[Check]:
    """Step of 12 V at the first coil; the second one closed, or open."""
    end, L = 0.6e-3, _inductance()
    step, none = VoltageTable(time=(0.0,), voltage=(12.0,)), VoltageTable(time=(0,), voltage=(0,))
    closed = _run(two_coils(), step, none, duration=end)
    final = np.array([12.0 / float(_RESISTANCE[0]), 0.0])
    rate = -np.linalg.solve(L, np.diag(_RESISTANCE))
    expected = final - expm(rate * end) @ final
    opened = _run(two_coils(), step, VoltageStep(voltage=1.0, start=1.0), duration=end)
    rise = np.exp(-_RESISTANCE[0] * end / L[0, 0])
    half = np.exp(0.5 * _STEP * _RESISTANCE[0] / L[0, 0])  # the middle of the last step
    source = "exp(-L^-1 R t) of two coupled circuits"
    return [
        _check(
            "transformer with a closed second coil, current of the first after 0.6 ms [A]",
            expected=float(expected[0]),
            computed=_last(closed, "current"),
            tolerance=1e-8,
            source=source,
        ),
        _check(
            "transformer with a closed second coil, current of the second [A]",
            expected=float(expected[1]),
            computed=_last(closed, "other current"),
            tolerance=2e-9,
            source=source,
        ),
        _check(
            "transformer with an open second coil, current of the first [A]",
            expected=float(final[0] * (1.0 - rise)),
            computed=_last(opened, "current"),
            tolerance=1e-8,
            source="u/R (1 - exp(-R t/L))",
        ),
        _check(
            "voltage of the open second coil, mean over the last step [V]",
            expected=float(12.0 * L[0, 1] / L[0, 0] * rise * half),
            computed=_last(opened, "other voltage"),
            tolerance=2e-8,
            source="M di/dt",
        ),
        _check(
            "work of the first driver of the transformer, the second closed [J]",
            expected=12.0 * float(_charge(np.asarray(rate), final, end)[0]),
            computed=closed.books.supplies["magnet electric"],
            tolerance=1e-7,
            source="u times the charge, integral of the matrix exponential",
        ),
    ]


def _charge(rate: Vector, final: Vector, end: float) -> Vector:
    """Integral of ``final - exp(rate t) final`` [A s]."""
    return np.asarray(final * end - np.linalg.solve(rate, (expm(rate * end) - np.eye(2)) @ final))


def _flyback() -> list[Check]:
    """First coil on, and off against 30 V; the second behind a diode that blocks at first."""
    on, end, forward, down = 0.2e-3, 0.5e-3, 0.7, 30.0
    run = _run(
        two_coils(),
        VoltageStep(voltage=12.0, end=on, decay=down),
        VoltageStep(voltage=1.0, start=1.0, freewheel=forward),
        duration=end,
    )
    L, R = _inductance(), np.diag(_RESISTANCE)
    peak = 12.0 / _RESISTANCE[0] * (1.0 - np.exp(-_RESISTANCE[0] * on / L[0, 0]))
    rate, final = -np.linalg.solve(L, R), np.array([-down, -forward]) / _RESISTANCE

    def both(time: float) -> Vector:
        return np.asarray(final + expm(rate * time) @ (np.array([peak, 0.0]) - final))

    over = float(brentq(lambda t: both(t)[0], 1e-9, 0.2e-3, xtol=1e-20, rtol=1e-14))
    left = -forward / _RESISTANCE[1]
    decay = np.exp(-_RESISTANCE[1] * (end - on - over) / L[1, 1])
    current = run.channels["magnet current"].values
    return [
        _check(
            "flyback: current of the second coil 0.3 ms after the first is switched off [A]",
            expected=float(left + (both(over)[1] - left) * decay),
            computed=_last(run, "other current"),
            tolerance=1e-6,
            source="matrix exponentials until the first current ends, then exp(-R t/L)",
        ),
        _check(
            "flyback: the first coil is open then, its current [A]",
            expected=0.0,
            computed=float(np.max(np.abs(current[run.time >= on + over + 5.0 * _STEP]))),
            tolerance=1e-15,
            source="a diode blocks",
        ),
    ]


def _static() -> list[Check]:
    """Reciprocity and force of two coils in saturated iron."""
    circuit = two_coils(iron=True).circuit()
    turns = {name: circuit.turns_of(name) for name in ("", "other")}
    i1, i2, x, small = 6.0, 9.0, 80e-6, 1e-3

    def linkage(of: str, first: float, second: float) -> float:
        state = static_state(circuit, current=first, gap=x, others={"other": second})
        return float(turns[of] @ state.loop_fluxes)

    forth = (linkage("other", i1 + small, i2) - linkage("other", i1 - small, i2)) / (2 * small)
    back = (linkage("", i1, i2 + small) - linkage("", i1, i2 - small)) / (2 * small)
    step = 1e-8
    coenergy = [
        static_state(circuit, current=i1, gap=x + s, others={"other": i2}).coenergy
        for s in (-step, step)
    ]
    held = two_coils(iron=True).model_copy(update={"gap": x, "start_current": i1})
    others = {"other": held.circuits["other"].model_copy(update={"start_current": i2})}
    held = held.model_copy(update={"circuits": others})
    volts = _RESISTANCE * (i1, i2)
    run = _run(
        held,
        VoltageTable(time=(0.0,), voltage=(float(volts[0]),)),
        VoltageTable(time=(0.0,), voltage=(float(volts[1]),)),
        duration=20e-6,
    )
    return [
        _check(
            "reciprocity in saturated iron: d psi_2/d i_1 [H]",
            expected=back,
            computed=forth,
            tolerance=1e-7,
            source="d psi_1/d i_2: mutual inductance is symmetric, Woodson and Melcher 1968",
        ),
        _check(
            "force of two coils with constant currents [N]",
            expected=-(coenergy[1] - coenergy[0]) / (2.0 * step),
            computed=float(run.channels["magnet.armature force"].values[-1]),
            tolerance=2e-9,
            source="slope of the coenergy at constant currents, Woodson and Melcher 1968",
        ),
    ]


def _main_flux(linkage: Vector, x: float) -> tuple[float, Vector]:
    """Flux of the iron [Wb] and currents [A] that belong to linkages [Wb], by one root."""
    share = linkage / _TURNS
    a, b = 1.0 / (_MU0 * (_INITIAL - 1.0)), 1.0 / _SATURATION

    def field(B: float) -> float:
        """Field strength [A/m] of B = mu0 H + H/(a + b H), solved for H."""
        p, q = b * _MU0, a * _MU0 + 1.0 - abs(B) * b
        root = np.sqrt(q * q + 4.0 * p * abs(B) * a)
        H = 2.0 * abs(B) * a / (q + root)
        return float(np.sign(B) * H)

    def rest(flux: float) -> float:
        gap = (x + _RESIDUAL) / (_MU0 * _AREA) * flux
        return float(np.sum((share - flux) / _LEAK) - gap - _IRON * field(flux / _SECTION))

    flux = float(brentq(rest, -2e-4, 2e-4, xtol=1e-20, rtol=1e-15))
    return flux, (share - flux) / (_LEAK * _TURNS)


def _saturated() -> list[Check]:
    """Two coils on voltage courses, iron in saturation, armature moving."""
    end, way = 0.8e-3, 60e-6
    first = VoltageTable(time=(0.0, 0.5e-3, 0.5e-3 + 1e-7), voltage=(24.0, 24.0, -6.0))
    second = VoltageTable(time=(0.0, 0.2e-3, 0.2e-3 + 1e-7), voltage=(0.0, 0.0, 30.0))
    motion = PrescribedMotion(
        time=(0.0, 0.1e-3, 0.7e-3, 1.0), displacement=(0.0, 0.0, way, way), between="straight"
    )
    run = _run(two_coils(iron=True), first, second, duration=end, motion=motion, step=0.5 * _STEP)

    def gap(t: float) -> float:
        return _GAP - way * float(np.clip((t - 0.1e-3) / 0.6e-3, 0.0, 1.0))

    def rate(t: float, y: Vector) -> Vector:
        u = np.array(
            [
                np.interp(t, first.time, first.voltage),
                np.interp(t, second.time, second.voltage),
            ]
        )
        flux, i = _main_flux(y[:2], gap(t))
        force = flux * flux / (2.0 * _MU0 * _AREA)
        speed = way / 0.6e-3 if 0.1e-3 < t < 0.7e-3 else 0.0
        return np.array([*(u - _RESISTANCE * i), *(u * i), force * speed])

    y = np.zeros(5)
    corners = (0.0, 0.1e-3, 0.2e-3, 0.2e-3 + 1e-7, 0.5e-3, 0.5e-3 + 1e-7, 0.7e-3, end)
    for a, b in pairwise(corners):
        found = solve_ivp(rate, (a, b), y, method="DOP853", rtol=1e-11, atol=1e-15)
        y = found.y[:, -1]
    flux, currents = _main_flux(y[:2], gap(end))
    source = "linkages integrated by SciPy (DOP853), main flux by a root"
    return [
        _check(
            "two coils, saturated, moving: current of the first after 0.8 ms [A]",
            expected=float(currents[0]),
            computed=_last(run, "current"),
            tolerance=2e-6,
            source=source,
        ),
        _check(
            "two coils, saturated, moving: current of the second after 0.8 ms [A]",
            expected=float(currents[1]),
            computed=_last(run, "other current"),
            tolerance=1e-7,
            source=source,
        ),
        _check(
            "two coils, saturated, moving: flux of the gap [Wb]",
            expected=flux,
            computed=_last(run, "flux"),
            tolerance=1e-7,
            source=source,
        ),
        _check(
            "two coils, saturated, moving: work of the first driver [J]",
            expected=float(y[2]),
            computed=run.books.supplies["magnet electric"],
            tolerance=1e-6,
            source=source,
        ),
        _check(
            "two coils, saturated, moving: work of the second driver [J]",
            expected=float(y[3]),
            computed=run.books.supplies["magnet other electric"],
            tolerance=5e-8,
            source=source,
        ),
        _check(
            "two coils, saturated, moving: work on the armature [J]",
            expected=-float(y[4]),
            computed=run.books.supplies["body motion"],
            tolerance=2e-7,
            source=source,
        ),
        _check(
            "two coils, saturated, moving: energy balance [-]",
            expected=0.0,
            computed=run.books.relative_residual,
            tolerance=1e-13,
            source="both supplies = ohmic losses + work + stored",
        ),
    ]


def _series() -> list[Check]:
    """Two equal halves of a coil on equal choppers, against the coil at twice the voltage."""

    def magnet(parts: int) -> MagneticNetwork:
        elements: dict[str, object] = {
            "gap": {"kind": "face", "between": ["n2", "n0"], "area": _AREA,
                    "residual_gap": _RESIDUAL},
        }  # fmt: skip
        for k in range(2):
            nodes = [f"n{k}", f"n{k + 1}"]
            coil = {"kind": "coil", "between": nodes, "turns": 50}
            elements[f"coil{k}"] = coil | ({"circuit": "other"} if k and parts == 2 else {})
            elements[f"leakage{k}"] = {"kind": "leakage", "between": nodes, "permeance": 20e-9}
        circuits = {"other": {"resistance": 0.5}} if parts == 2 else {}
        return MagneticNetwork.model_validate(
            {"resistance": 1.0 / parts, "gap": _GAP, "elements": elements, "circuits": circuits}
        )

    def driver(voltage: float) -> TwoPoint:
        return TwoPoint(voltage=voltage, upper=5.0, lower=4.5, end=0.6e-3, freewheel=voltage / 20)

    halves = _run(magnet(2), driver(12.0), driver(12.0), duration=0.8e-3)
    whole = Network(
        {
            "body": PrescribedMotion(time=(0.0, 1.0), displacement=(0.0, 0.0)),
            "magnet": magnet(1),
            "one": driver(24.0),
        },
        [["body.body", "magnet.armature"], ["magnet.terminals", "one.terminals"]],
    )
    alone = simulate_network(
        whole.rows(), duration=0.8e-3, step=_STEP, coarse=1, record=5.0 * _STEP
    )
    current = alone.channels["magnet current"].values
    apart = halves.channels["magnet current"].values - current
    return [
        _check(
            "two halves of a coil on two equal choppers, largest difference from the whole [A]",
            expected=0.0,
            computed=float(np.max(np.abs(apart))),
            tolerance=5e-10,
            source="equal currents in series; the step of one coil",
        ),
        _check(
            "work of both choppers [J]",
            expected=alone.books.supplies["magnet electric"],
            computed=halves.books.supplies["magnet electric"]
            + halves.books.supplies["magnet other electric"],
            tolerance=4e-11,
            source="that of the whole coil",
        ),
    ]
