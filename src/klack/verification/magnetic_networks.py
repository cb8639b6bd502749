r"""Magnetic networks given in a case, against node potentials and equations of time.

klack solves loop fluxes; here, node potentials: a tube of iron carries :math:`A\,B(\Delta/l)` at
the potential difference :math:`\Delta`, by Froehlich's formula itself.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from scipy.integrate import simpson, solve_ivp
from scipy.linalg import expm
from scipy.optimize import brentq, fsolve

from klack.magnetics.flux_map import FluxMap
from klack.magnetics.magnetic_network import MagneticNetwork
from klack.magnetics.map_choice import MapFile
from klack.magnetics.static import static_state
from klack.magnetics.voltage_step import VoltageStep
from klack.verification import published_magnets as published
from klack.verification.check import Check, check
from klack.verification.drivers import run_coil

__all__ = ["force_of", "linkage_of", "maps_from_files", "networks_of_tubes", "written"]


_MU0 = 4e-7 * np.pi
_SATURATION, _INITIAL = 1.5, 1500.0  # Froehlich: [T], relative
_GAP, _RESIDUAL = 100e-6, 40e-6

_IRON = {"froehlich": {"saturation": _SATURATION, "permeability": _INITIAL}}


def _network(elements: Mapping[str, object], gap: float = _GAP) -> MagneticNetwork:
    return MagneticNetwork.model_validate({"resistance": 0.8, "gap": gap, "elements": elements})


@cache
def _e_core() -> MagneticNetwork:
    """Middle leg with coil and working gap, two outer legs, one with a magnet."""
    return _network(
        {
            "middle": {"kind": "iron", "between": ["top", "m"], "material": _IRON, "length": 20e-3,
                       "area": 30e-6},
            "coil": {"kind": "coil", "between": ["m", "n"], "turns": 80},
            "gap": {"kind": "face", "between": ["n", "bottom"], "area": 30e-6,
                    "fringing_factor": 1.1, "residual_gap": _RESIDUAL},
            "left": {"kind": "iron", "between": ["bottom", "top"], "material": _IRON,
                     "length": 50e-3, "area": 12e-6},
            "right": {"kind": "iron", "between": ["bottom", "r"], "material": _IRON,
                      "length": 50e-3, "area": 18e-6},
            "magnet": {"kind": "magnet", "between": ["r", "top"], "remanence": 0.4,
                       "recoil_permeability": 1.05, "length": 0.3e-3, "area": 18e-6},
            "leakage": {"kind": "leakage", "between": ["m", "bottom"], "permeance": 30e-9},
        }
    )  # fmt: skip


def _iron_flux(drop: float, length: float, area: float) -> float:
    """Flux of a tube of Froehlich's iron at a potential difference."""
    H = abs(drop) / length
    a, b = 1.0 / (_MU0 * (_INITIAL - 1.0)), 1.0 / _SATURATION
    return float(np.sign(drop)) * area * (_MU0 * H + H / (a + b * H))


def _nodal(current: float, gap: float) -> tuple[float, float]:
    """Linkage and working flux [Wb] of the E core, by node potentials."""
    gap_permeance = 1.1 * _MU0 * 30e-6 / (gap + _RESIDUAL)
    magnet = 0.3e-3 / (_MU0 * 1.05)  # [m^2/Wb A] over the area

    def fluxes(v: np.ndarray) -> tuple[float, ...]:
        top, m, r = 100.0 * v  # bottom is 0; n is m plus the mmf of the coil
        return (
            _iron_flux(top - m, 20e-3, 30e-6),
            (m + 80.0 * current) * gap_permeance,
            _iron_flux(-top, 50e-3, 12e-6),
            _iron_flux(-r, 50e-3, 18e-6),
            (r - top + 0.4 * magnet) * 18e-6 / magnet,
            m * 30e-9,
        )

    def rest(v: np.ndarray) -> list[float]:
        middle, through, left, right, of_magnet, leak = fluxes(v)
        return [1e5 * (middle - left - of_magnet), 1e5 * (middle - through - leak),
                1e5 * (right - of_magnet)]  # fmt: skip

    through = fluxes(fsolve(rest, np.zeros(3), xtol=1e-11))[1]
    return 80.0 * through, through


def _at_rest() -> list[Check]:
    circuit, out = _e_core().circuit(), []
    source = "node potentials of Froehlich's iron, SciPy fsolve, coded independently"
    for current, gap in ((0.0, 100e-6), (1.5, 100e-6), (6.0, 20e-6)):
        state = static_state(circuit, current=current, gap=gap)
        linkage, through = _nodal(current, gap)
        place = f"E core with a magnet, {current:g} A, {1e6 * gap:.0f} um"
        out.append(
            check(
                f"{place}: linkage [mWb]",
                expected=1e3 * linkage,
                computed=1e3 * state.linkage,
                tolerance=1e-7,
                source=source,
            )
        )
        out.append(
            check(
                f"{place}: force [N]",
                expected=-0.5 * through**2 / (1.1 * _MU0 * 30e-6),
                computed=state.force,
                tolerance=1e-7,
                source=f"Maxwell's pull of the flux of that solution; {source}",
            )
        )
    nodes, weights = np.polynomial.legendre.leggauss(80)
    step, current = 0.2e-6, 6.0

    def coenergy(gap: float) -> float:  # above that without current
        currents = 0.5 * current * (nodes + 1.0)
        return float(0.5 * current * weights @ [_nodal(i, gap)[0] for i in currents])

    forces = [static_state(circuit, current=i, gap=50e-6).force for i in (current, 0.0)]
    out.append(
        check(
            "E core with a magnet, 6 A, 50 um: force above that of the magnet [N]",
            expected=(coenergy(50e-6 + step) - coenergy(50e-6 - step)) / (2.0 * step),
            computed=forces[0] - forces[1],
            tolerance=1e-5,
            source="slope of the co-energy, the integral of psi di of the nodal solutions",
        )
    )
    return out


def _transformer() -> list[Check]:
    """Mutual inductance: voltage on one coil, a resistance at the other."""
    N1, N2, R1, R2, main, leak1, leak2 = 50.0, 20.0, 0.8, 0.3, 40e-9, 6e-9, 4e-9
    network = _network(
        {
            "coil": {"kind": "coil", "between": ["a", "b"], "turns": N1},
            "leak1": {"kind": "leakage", "between": ["b", "a"], "permeance": leak1},
            "ring": {"kind": "shorted-coil", "between": ["c", "b"], "turns": N2, "resistance": R2},
            "leak2": {"kind": "leakage", "between": ["c", "b"], "permeance": leak2},
            "main": {"kind": "leakage", "between": ["c", "a"], "permeance": main},
            "gap": {"kind": "face", "between": ["c", "a"], "area": 1e-7, "residual_gap": 1e-3},
        }
    )
    both = main + _MU0 * 1e-7 / (1e-3 + _GAP)  # passes both windings, each leakage its own only
    L1, M, L2 = N1**2 * (leak1 + both), N1 * N2 * both, N2**2 * (leak2 + both)
    A = -np.linalg.solve(np.array([[L1, M], [M, L2]]), np.diag([R1, R2]))
    t = 300e-6
    final = np.array([12.0 / R1, 0.0])
    current = final - expm(A * t) @ final
    run = run_coil(
        network.circuit(),
        VoltageStep(voltage=12.0).program(),
        resistance=R1,
        gap=_GAP,
        step=0.5e-6,
        lift=np.zeros(601),
    )
    return [
        check(
            "two coupled windings, 12 V on one, the other closed: current after 300 us [A]",
            expected=float(current[0]),
            computed=float(run.current[-1]),
            tolerance=2e-6,
            source="L di/dt + R i = u with self and mutual inductances; matrix exponential",
        ),
        check(
            "two coupled windings: heat in the closed one after 300 us [mJ]",
            expected=1e3 * _secondary_heat(A, final, R2, t),
            computed=1e3 * run.eddy,
            tolerance=2e-6,
            source="the integral of R2 i2^2 of that solution",
        ),
    ]


def _secondary_heat(A: np.ndarray, final: np.ndarray, resistance: float, t: float) -> float:
    nodes, weights = np.polynomial.legendre.leggauss(40)
    times = 0.5 * t * (nodes + 1.0)
    second = np.array([(final - expm(A * s) @ final)[1] for s in times])
    return float(0.5 * t * resistance * weights @ second**2)


def _polarised() -> list[Check]:
    """Two opposite gaps with a magnet between: linear, in closed form."""
    area, turns, half, residual = 20e-6, 60.0, 100e-6, 50e-6
    length, remanence = 2e-3, 1.2
    network = _network(
        {
            "upper": {"kind": "face", "between": ["arm", "up"], "area": area,
                      "residual_gap": residual},
            "lower": {"kind": "face", "between": ["arm", "down"], "area": area,
                      "residual_gap": residual, "opens_from": half},
            "coil_up": {"kind": "coil", "between": ["up", "yoke"], "turns": 0.5 * turns},
            "coil_down": {"kind": "coil", "between": ["yoke", "down"], "turns": 0.5 * turns},
            "magnet": {"kind": "magnet", "between": ["yoke", "arm"], "remanence": remanence,
                       "recoil_permeability": 1.0, "length": length, "area": area},
        },
        gap=half,
    )  # fmt: skip
    out, current = [], 2.0
    reluctance = 1.0 / (_MU0 * area)
    for x in (100e-6, 60e-6):
        upper, lower = (x + residual) * reluctance, (2.0 * half - x + residual) * reluctance
        inner, mmf = length * reluctance, remanence * length / _MU0
        # two loops: magnet - upper - coil up, magnet - lower - coil down
        R = np.array([[upper + inner, inner], [inner, lower + inner]])
        up, down = np.linalg.solve(R, [mmf + 0.5 * turns * current, mmf - 0.5 * turns * current])
        state = static_state(network.circuit(), current=current, gap=x)
        out.append(
            check(
                f"polarised magnet with two gaps, 2 A, {1e6 * x:.0f} um: force [N]",
                expected=float(-0.5 * reluctance * (up**2 - down**2)),
                computed=state.force,
                tolerance=1e-13,
                source="two linear loops by hand, pull phi^2/(2 mu0 A) at each gap",
            )
        )
    return out


def _voltage_step() -> list[Check]:
    """Iron, a gap moving on a given course, and a damping ring in time."""
    turns, R, S, leak, area, length = 80.0, 0.8, 4e3, 25e-9, 30e-6, 60e-3
    network = _network(
        {
            "iron": {"kind": "iron", "between": ["a", "b"], "material": _IRON, "length": length,
                     "area": area},
            "ring": {"kind": "shorted-coil", "between": ["b", "c"], "turns": 1,
                     "resistance": 1.0 / S},
            "gap": {"kind": "face", "between": ["c", "d"], "area": area, "residual_gap": _RESIDUAL},
            "coil": {"kind": "coil", "between": ["d", "a"], "turns": turns},
            "leakage": {"kind": "leakage", "between": ["a", "d"], "permeance": leak},
        }
    )  # fmt: skip
    end, steps, speed = 400e-6, 4000, 0.15

    def mmf_of_iron(flux: float) -> float:
        return brentq(lambda drop: _iron_flux(drop, length, area) - flux, -1e5, 1e5, xtol=1e-12)

    def rates(t: float, y: np.ndarray) -> list[float]:
        current = y[1] / (leak * turns)
        reluctance = (_GAP - speed * t + _RESIDUAL) / (_MU0 * area)
        main = (turns * current - reluctance * y[0] - mmf_of_iron(y[0])) / S
        return [main, (24.0 - R * current) / turns - main]

    exact = solve_ivp(rates, (0.0, end), [0.0, 0.0], rtol=1e-9, atol=1e-14, method="LSODA")
    current = float(exact.y[1, -1]) / (leak * turns)
    run = run_coil(
        network.circuit(),
        VoltageStep(voltage=24.0).program(),
        resistance=R,
        gap=_GAP,
        step=end / steps,
        lift=speed * np.linspace(0.0, end, steps + 1),
    )
    source = "two equations of flux, SciPy LSODA, coded independently"
    return [
        check(
            "24 V on iron with a damping ring and a moving gap: current after 400 us [A]",
            expected=current,
            computed=float(run.current[-1]),
            tolerance=2e-7,
            source=source,
        ),
        check(
            "24 V on iron with a damping ring and a moving gap: force after 400 us [N]",
            expected=0.5 * float(exact.y[0, -1]) ** 2 / (_MU0 * area),
            computed=float(run.force[-1]),
            tolerance=1e-3,
            source=source,
            reason="the mean of the last step of 0.1 us",
        ),
        check(
            "24 V on iron with a damping ring and a moving gap: energy balance [-]",
            expected=0.0,
            computed=run.residual,
            tolerance=1e-13,
            source="supply = heat + heat of the ring + stored energy + work",
        ),
    ]


def networks_of_tubes() -> list[Check]:
    """Return the checks."""
    return [*_at_rest(), *_transformer(), *_polarised(), *_voltage_step()]


_C, _X0, _IS, _L0 = 3e-8, 60e-6, 8.0, 5e-6  # [Wb m], [m], [A], [H]
_CURRENT = np.linspace(0.0, 12.0, 25)
_GAP_FILE = np.linspace(20e-6, 160e-6, 15)
_AT = 7.3, 87e-6  # [A], [m] between the points
_SOURCE = "slope of the co-energy c i_s/(x + x_0) ln cosh(i/i_s)"

Rows = Iterable[tuple[float, float, float, float]]


def linkage_of(i: np.ndarray | float, x: np.ndarray | float) -> np.ndarray:
    r"""Linkage of the coil [Wb].

    :math:`\psi = L_0 i + \frac{c}{x + x_0}\tanh\frac{i}{i_s}` is a slope of the co-energy
    :math:`\tfrac12L_0i^2 + \frac{c\,i_s}{x + x_0}\ln\cosh\frac{i}{i_s}`; the other one is the
    force.
    """
    return np.asarray(_L0 * i + _C / (x + _X0) * np.tanh(i / _IS))


def force_of(i: np.ndarray | float, x: np.ndarray | float) -> np.ndarray:
    """Force of the coil along the gap [N]."""
    return np.asarray(-_C * _IS / (x + _X0) ** 2 * np.log(np.cosh(i / _IS)))


def _points() -> Rows:
    for x in _GAP_FILE:
        for i in _CURRENT:
            yield i, x, float(linkage_of(i, x)), float(force_of(i, x))


def _maxwell(rows: Rows) -> str:
    head = '"Current [A]","gap [mm]","FluxLinkage(Coil) [mWb]","Force1.Force_z [newton]"'
    return "\n".join(
        [head, *(f"{i:.17g},{1e3 * x:.17g},{1e3 * p:.17g},{F:.17g}" for i, x, p, F in rows)]
    )


def _femm(rows: Rows) -> str:
    return "\n".join(f"{1e3 * x:.15g} {i:.15g} {F:.15g} {p:.15g}" for i, x, p, F in rows)


def _jmag(rows: Rows) -> str:
    lines = ["Parametric study;;;", "Current (A);Gap (mm);Force (N);Flux linkage (Wb)"]
    lines += [f"{i:.15g};{1e3 * x:.15g};{-0.5 * F:.15g};{0.5 * p:.15g}" for i, x, p, F in rows]
    return "\n".join(lines).replace(".", ",")


def _families(rows: Rows) -> str:
    del rows
    head = ['"Current [A]"']
    for x in _GAP_FILE:
        head += [f"\"FluxLinkage(Coil) [mWb] - gap='{1e3 * x:.12g}mm'\""]
        head += [f"\"Force1.Force_z [newton] - gap='{1e3 * x:.12g}mm'\""]
    lines = [",".join(head)]
    for i in _CURRENT:
        cells = [repr(float(i))]
        for x in _GAP_FILE:
            cells += [repr(float(1e3 * linkage_of(i, x))), repr(float(force_of(i, x)))]
        lines.append(",".join(cells))
    return "\n".join(lines)


def _matrix(value: Callable[..., np.ndarray], head: str) -> str:
    lines = [";".join([head, *(f"{i:.15g}" for i in _CURRENT)])]
    lines += [
        ";".join([f"{1e3 * x:.15g}", *(f"{value(i, x):.15g}" for i in _CURRENT)])
        for x in _GAP_FILE[::-1]
    ]
    return "\n".join(lines)


def written(folder: Path) -> dict[str, MapFile]:
    """Write the coil in each layout and read it again."""
    layouts = {
        "Ansys Maxwell, one row per point": (_maxwell(_points()), {}),
        "FEMM, no head": (
            _femm(_points()),
            {
                "columns": {"gap": 1, "current": 2, "force": 3, "linkage": 4},
                "units": {"gap": "mm", "current": "A", "force": "N", "linkage": "Wb"},
            },
        ),
        "JMAG, half a model, decimal comma": (
            _jmag(_points()),
            {"linkage_factor": 2.0, "force_factor": 2.0, "force_closing": "positive"},
        ),
        "Ansys Maxwell, a column per gap": (_families(_points()), {}),
    }
    out = {}
    for k, (name, (text, keys)) in enumerate(layouts.items()):
        file = folder / f"map{k}.csv"
        file.write_text(text, encoding="utf-8")
        out[name] = MapFile.model_validate({"file": file.name, **keys}, context={"folder": folder})
    matrices = {
        "psi.csv": _matrix(linkage_of, "gap [mm] / current [A] / linkage [Wb]"),
        "force.csv": _matrix(force_of, "gap [mm] / current [A] / force [N]"),
    }
    for name, text in matrices.items():
        (folder / name).write_text(text, encoding="utf-8")
    keys = {"file": "psi.csv", "force_file": "force.csv", "layout": "matrix"}
    out["two matrices"] = MapFile.model_validate(keys, context={"folder": folder})
    return out


def _layouts() -> Iterator[Check]:
    with TemporaryDirectory() as folder:
        for name, choice in written(Path(folder)).items():
            table = choice.table()
            yield check(
                f"map from a file ({name}): force between the points [N]",
                expected=float(force_of(*_AT)),
                computed=FluxMap.of(
                    current=table.current, gap=table.gap, linkage=table.linkage, force=None
                ).force_at(float(linkage_of(*_AT)), _AT[1]),
                tolerance=1e-4,
                source=_SOURCE,
            )
            assert table.force is not None
            yield check(
                f"map from a file ({name}): force of the file at 12 A, 20 um [N]",
                expected=float(force_of(12.0, 20e-6)),
                computed=float(table.force[-1, 0]),
                tolerance=1e-13,
                source=_SOURCE,
            )


def _virtual_work() -> list[Check]:
    gap = np.linspace(20e-6, 160e-6, 29)
    i, x = _CURRENT[:, None], gap[None, :]
    psi, force = linkage_of(i, x), force_of(i, x)
    made = FluxMap.of(current=_CURRENT, gap=gap, linkage=psi, force=None)
    wrong = force.copy()
    wrong[14, 8] *= 1.6  # 7 A, 60 um
    planted = made.compare_force(_CURRENT, psi, wrong)
    half = made.compare_force(_CURRENT, psi, 0.5 * force)
    words = "dF/di = dpsi/dx at constant current; a wrong point planted in the exact table"
    return [
        check(
            "virtual work: exact force against exact linkage, share of the peak [-]",
            expected=0.0,
            computed=made.compare_force(_CURRENT, psi, force).share,
            tolerance=1e-2,
            source=_SOURCE,
            reason="at the narrowest gap and largest current, whose linkage no wider gap reaches",
        ),
        check(
            "virtual work: one force 60 % too large, share of the peak [-]",
            expected=0.6 * float(-force[14, 8]) / float(np.max(np.abs(force))),
            computed=planted.share,
            tolerance=1e-4,
            source=words,
        ),
        check(
            "virtual work: current of that point [A]",
            expected=7.0,
            computed=planted.current,
            tolerance=1e-13,
            source=words,
        ),
        check(
            "virtual work: gap of that point [um]",
            expected=60.0,
            computed=1e6 * planted.gap,
            tolerance=1e-13,
            source=words,
        ),
        check(
            "virtual work: ratio of the force of half a model [-]",
            expected=0.5,
            computed=half.ratio,
            tolerance=5e-4,
            source="least squares over the table",
        ),
    ]


def _lifting_magnet() -> Iterator[Check]:
    """Published finite-element linkages and forces, at one current and wide gaps."""
    made = FluxMap.of(
        current=[0.0, published.CURRENT],
        gap=published.GAP,
        linkage=[0.0 * published.GAP, published.CURRENT * published.INDUCTANCE],
        force=None,
    )
    source = "finite elements; Modelica Standard Library, ComparisonQuasiStatic"
    for first, last in ((7, 13), (13, 19)):
        part = slice(first, last + 1)
        x = published.GAP[part]
        psi = published.CURRENT * published.INDUCTANCE[part]
        derived = [made.force_at(float(p), float(g)) for p, g in zip(psi, x, strict=True)]
        yield check(
            f"lifting magnet as a map: work from {1e3 * x[0]:.1f} to {1e3 * x[-1]:.1f} mm at "
            "1.2 A, from its inductances [mJ]",
            expected=1e3 * float(simpson(published.FORCE[part], x=x)),
            computed=1e3 * float(simpson(derived, x=x)),
            tolerance=0.05,
            source=source,
            reason="linear between 0 and 1.2 A, though the iron saturates a little",
        )


def maps_from_files() -> list[Check]:
    """Return the checks."""
    return [*_layouts(), *_virtual_work(), *_lifting_magnet()]
