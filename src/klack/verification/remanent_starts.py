"""Checks of starts at remanence: load lines by hand, the remanence itself, a run back to it."""

from functools import partial

import numpy as np
from scipy.optimize import brentq

from klack.magnetics.circuit import MagneticBranch, MagneticCircuit
from klack.magnetics.reluctance import LinearReluctance
from klack.magnetics.remanent_start import remanent_state
from klack.magnetics.solenoid import Solenoid
from klack.magnetics.solenoid_parts import IronPart
from klack.magnetics.voltage_step import VoltageStep
from klack.verification.check import Check, compare
from klack.verification.single_coil import run_coil

__all__ = ["remanent_starts"]

_check = partial(compare, "magnetic-parts")
_MU0 = 4e-7 * np.pi
_B, _MU, _HC = 1.6, 2000.0, 300.0  # saturation [T], relative, [A/m]
_LENGTH, _AREA, _RESIDUAL, _GAP = 60e-3, 30e-6, 20e-6, 30e-6
_MATERIAL = {"froehlich": {"saturation": _B, "permeability": _MU}}


def _density(field: float) -> float:
    a, b = 1.0 / (_MU0 * (_MU - 1.0)), 1.0 / _B
    return float(_MU0 * field + field / (a + b * abs(field)))


def _solenoid() -> Solenoid:
    hysteresis = {"coercivity": _HC, "initial_permeability": 500.0}
    iron = {"material": _MATERIAL, "length": _LENGTH, "area": _AREA, "hysteresis": hysteresis}
    pole = {"outer_radius": float(np.sqrt(_AREA / np.pi)), "fringing": "none"}
    return Solenoid.model_validate(
        {"turns": 60, "resistance": 0.8, "gap": 1e-4, "residual_gap": _RESIDUAL, "poles": [pole],
         "leakage": 2e-8, "iron": [iron]}
    )  # fmt: skip


def _load_line() -> list[Check]:
    """Falling branch of constant width against the gap, with and without a current."""
    out = []
    for current in (0.0, 0.3):

        def lacking(field: float, mmf: float = 60.0 * current) -> float:
            gap = _density(field) * (_GAP + _RESIDUAL) / _MU0
            return (field - _HC) * _LENGTH + gap - mmf

        flux = _AREA * _density(brentq(lacking, 0.0, 1e4, xtol=1e-12))
        found, _ = remanent_state(_solenoid().circuit(), current=current, gap=_GAP)
        out.append(
            _check(
                f"start at remanence, gap of 30 um, {current:g} A: flux [uWb]",
                expected=1e6 * flux,
                computed=1e6 * float(found[0]),
                tolerance=2e-8,
                source="Froehlich's curve less H_c meets the load line of the gap; brentq",
            )
        )
    return out


def _closed_ring() -> list[Check]:
    hysteresis = {"coercivity": 400.0, "remanence": 0.5, "initial_permeability": 500.0}
    part = IronPart.model_validate(
        {"material": _MATERIAL, "length": _LENGTH, "area": _AREA, "hysteresis": hysteresis}
    )
    circuit = MagneticCircuit(
        branches=(
            MagneticBranch(
                name="iron", law=part.material.curve().law(_LENGTH, _AREA), turns=60.0,
                stops=part.stops(),
            ),
            MagneticBranch(name="leakage", law=LinearReluctance(1e8), turns=60.0),
        ),
        loops=np.eye(2, dtype=np.int64),
        main="iron",
    )  # fmt: skip
    fluxes, _ = remanent_state(circuit, current=0.0, gap=0.0)
    return [
        _check(
            "start at remanence, closed ring: flux density [T]",
            expected=0.5,
            computed=float(fluxes[0]) / _AREA,
            tolerance=5e-10,
            source="its remanence as given",
        )
    ]


def _after_saturation() -> list[Check]:
    """40 A and back to none in a run, against the start."""
    circuit = _solenoid().circuit()
    run = run_coil(
        circuit,
        VoltageStep(voltage=32.0, end=6e-3, decay=20.0).program(),
        resistance=0.8,
        gap=_GAP,
        step=2e-6,
        lift=np.zeros(5001),
    )
    found, _ = remanent_state(circuit, current=0.0, gap=_GAP)
    return [
        _check(
            "start at remanence against a run to 40 A and back: flux [uWb]",
            expected=1e6 * float(run.flux[-1]),
            computed=1e6 * float(found[0]),
            tolerance=1e-13,
            source="the run, whose iron starts demagnetised",
        )
    ]


def remanent_starts() -> list[Check]:
    """Return the checks."""
    return [*_load_line(), *_closed_ring(), *_after_saturation()]
