r"""Checks of solid iron in shells, against diffusion solved by finite volumes, and its series.

In a sheet the field obeys :math:`\sigma\,\partial B/\partial t = \partial^2H/\partial y^2`; here
with Froehlich's curve, in 400 volumes from the surface to the middle, by SciPy.  The shells stand
in a circuit whose coil keeps its current.
"""

from functools import cache, partial

import numpy as np
from scipy.integrate import solve_ivp

from klack.magnetics.circuit import MagneticBranch, MagneticCircuit
from klack.magnetics.eddy import sheet_ladder
from klack.magnetics.reluctance import LinearReluctance
from klack.magnetics.solenoid_parts import IronPart
from klack.magnetics.voltage_step import VoltageStep
from klack.verification.check import Check, compare
from klack.verification.single_coil import run_coil

__all__ = ["solid_iron"]

_check = partial(compare, "magnetic-parts")
_MU0 = 4e-7 * np.pi
_B, _MU = 1.5, 1500.0  # saturation [T], initial relative permeability
_SIGMA, _THICK, _LENGTH, _AREA = 1.6e6, 4e-3, 20e-3, 40e-6
_TIMES = np.array([0.2e-3, 1e-3])


def _density(field: np.ndarray | float) -> np.ndarray:
    a, b = 1.0 / (_MU0 * (_MU - 1.0)), 1.0 / _B
    return np.asarray(_MU0 * field + field / (a + b * np.abs(field)))


def _slope(field: np.ndarray) -> np.ndarray:
    a, b = 1.0 / (_MU0 * (_MU - 1.0)), 1.0 / _B
    return np.asarray(_MU0 + a / (a + b * np.abs(field)) ** 2)


@cache
def _diffusion(field: float) -> tuple[float, ...]:
    """Mean flux density [T] at the times, after a step of the surface field [A/m]."""
    cells = 400
    edges = 0.5 * _THICK * np.linspace(0.0, 1.0, cells + 1) ** 2  # finest at the surface
    size, middle = np.diff(edges), 0.5 * (edges[1:] + edges[:-1])

    def rate(_: float, H: np.ndarray) -> np.ndarray:
        flow = np.zeros(cells + 1)
        flow[0] = (field - H[0]) / middle[0]
        flow[1:-1] = -np.diff(H) / np.diff(middle)
        return np.asarray((flow[:-1] - flow[1:]) / (_SIGMA * size * _slope(H)))

    band = np.eye(cells, k=1) + np.eye(cells) + np.eye(cells, k=-1)
    found = solve_ivp(
        rate, (0.0, _TIMES[-1]), np.zeros(cells), method="BDF", t_eval=_TIMES, rtol=1e-7,
        atol=1e-6 * field, jac_sparsity=band,
    )  # fmt: skip
    return tuple(float(size @ _density(H) / (0.5 * _THICK)) for H in found.y.T)


def _part(shape: str, terms: int) -> IronPart:
    material = {"froehlich": {"saturation": _B, "permeability": _MU}}
    eddy = {"shape": shape, "conductivity": _SIGMA, "terms": terms}
    if shape == "sheet":
        eddy["thickness"] = _THICK
    return IronPart.model_validate(
        {"material": material, "length": _LENGTH, "area": _AREA, "eddy": eddy}
    )


def _circuit(part: IronPart, *, ladder: bool = False) -> MagneticCircuit:
    """Iron in one loop with the coil: in shells, or one part with the ladder beside it."""
    terms = len(part.shells())
    branches = [
        MagneticBranch(name="coil", law=LinearReluctance(0.0), turns=1.0),
        MagneticBranch(name="leakage", law=LinearReluctance(1e12), turns=1.0),
    ]
    rows: list[dict[int, int]] = [{0: 1}, {1: 1}]
    if ladder:
        law = part.material.curve().law(_LENGTH, _AREA)
        branches.append(MagneticBranch(name="iron", law=law))
        rows.append({0: 1})
        given = sheet_ladder(
            conductivity=_SIGMA, length=_LENGTH, thickness=_THICK, width=_AREA / _THICK,
            permeability=_MU, terms=terms,
        )  # fmt: skip
        for k, turn in enumerate(given.conductances):
            outer = 0 if k == 0 else k + 1
            shorted = MagneticBranch(name=f"turn {k}", law=LinearReluctance(0.0), eddy=turn)
            branches.append(shorted)
            rows.append({outer: 1, k + 2: -1} if k < terms - 1 else {outer: 1})
            if k < terms - 1:
                core = LinearReluctance(given.reluctances[k])
                branches.append(MagneticBranch(name=f"core {k}", law=core))
                rows.append({k + 2: 1})
    else:
        for k, shell in enumerate(part.shells()):
            outer = 0 if k == 0 else k + 1
            around = MagneticBranch(name=f"turn {k}", law=LinearReluctance(0.0), eddy=shell.turn)
            branches += [around, MagneticBranch(name=f"shell {k}", law=shell.law)]
            rows += [{outer: 1}, {outer: 1, k + 2: -1} if k < terms - 1 else {outer: 1}]
    loops = np.zeros((len(rows), terms + 1), dtype=np.int64)
    for k, row in enumerate(rows):
        for j, sign in row.items():
            loops[k, j] = sign
    return MagneticCircuit(branches=tuple(branches), loops=loops, main="coil")


def _flux_density(
    circuit: MagneticCircuit, field: float, times: np.ndarray, step: float
) -> np.ndarray:
    """Mean flux density [T] at the times, the coil fed through 1 Mohm."""
    run = run_coil(
        circuit,
        VoltageStep(voltage=1e6 * field * _LENGTH).program(),
        resistance=1e6,
        gap=0.0,
        step=step,
        lift=np.zeros(round(times[-1] / step) + 1),
    )
    return np.asarray(run.flux[np.round(times / step).astype(int)] / _AREA)


def _nonlinear() -> list[Check]:
    source = "nonlinear diffusion in 400 finite volumes, SciPy BDF, written apart"
    out = []
    for field, words in ((20.0, "weak"), (600.0, "medium"), (8000.0, "saturating")):
        known = _diffusion(field)
        found = _flux_density(_circuit(_part("sheet", 4)), field, _TIMES, 0.5e-6)
        for t, expected, computed, most in zip(_TIMES, known, found, (0.01, 3e-3), strict=True):
            out.append(
                _check(
                    f"solid sheet of 4 mm in 4 shells, {words} field: mean B after "
                    f"{1e3 * t:g} ms [T]",
                    expected=expected,
                    computed=float(computed),
                    tolerance=most,
                    source=source,
                    reason="four shells; the ladder with the initial permeability is 64 % too high",
                )
            )
    return out


def _linear() -> list[Check]:
    """Weak field, where the permeability is the initial one: the known series."""
    out, share = [], np.array([0.05, 0.1, 0.2])
    series = {
        "sheet": ((0.5040878, 5e-6), (0.6978819, 5e-6), (0.8874029, 5e-6)),
        "cylinder": ((0.4521210, 5e-4), (0.6058242, 5e-5), (0.7821476, 5e-6)),
    }
    for shape, values in series.items():
        across = _THICK**2 if shape == "sheet" else _AREA / np.pi
        tau = _MU0 * _MU * _SIGMA * across
        circuit = _circuit(_part(shape, 4))
        found = _flux_density(circuit, 1e-3, share * tau, tau / 4000.0) / float(_density(1e-3))
        for part, (expected, most), computed in zip(share, values, found, strict=True):
            out.append(
                _check(
                    f"solid {shape} in 4 shells, weak field: flux after {part:g} tau, of the last "
                    "[-]",
                    expected=expected,
                    computed=float(computed),
                    tolerance=most,
                    source="1 - (8/pi^2) sum exp(-n^2 pi^2 t/tau)/n^2, n odd"
                    if shape == "sheet"
                    else "1 - 4 sum exp(-b^2 t/tau)/b^2, J0(b) = 0",
                )
            )
    return out


def solid_iron() -> list[Check]:
    """Return the checks."""
    return [*_nonlinear(), *_linear()]
