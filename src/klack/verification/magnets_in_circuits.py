"""Checks of a permanent magnet in series with yoke and working gap."""

from functools import partial

import numpy as np

from klack.magnetics.circuit import MagneticBranch, MagneticCircuit
from klack.magnetics.iron import VACUUM_PERMEABILITY
from klack.magnetics.reluctance import GapReluctance, LinearReluctance
from klack.magnetics.solenoid_parts import PermanentMagnet
from klack.magnetics.static import static_state
from klack.magnetics.voltage_table import VoltageTable
from klack.verification.check import Check, compare
from klack.verification.single_coil import run_coil

__all__ = ["magnets_in_circuits"]

_check = partial(compare, "magnetic-parts")
_MU0 = VACUUM_PERMEABILITY
_AREA, _TURNS, _GAP = 20e-6, 100.0, 200e-6
_MAGNET = PermanentMagnet(
    remanence=1.2,
    recoil_permeability=1.05,
    length=2e-3,
    area=25e-6,
    polarity="with-coil",
)


def magnets_in_circuits() -> list[Check]:
    """Return the checks of permanent magnets."""
    circuit = _circuit(_MAGNET)
    gap = _GAP / (_MU0 * _AREA)
    mmf = 1.2 * 2e-3 / (_MU0 * 1.05)
    inner = 2e-3 / (_MU0 * 1.05 * 25e-6)
    flux = mmf / (inner + gap)
    rest = static_state(circuit, current=0.0, gap=_GAP)
    step = 1e-8
    beside = [static_state(circuit, current=0.0, gap=_GAP + s).coenergy for s in (-step, step)]
    cancels = static_state(circuit, current=-mmf / _TURNS, gap=_GAP)
    turned = static_state(
        _circuit(_MAGNET.model_copy(update={"polarity": "against-coil"})), current=0.0, gap=_GAP
    )
    lift = np.minimum(np.arange(4001) * 1e-7, 150e-6)
    driver = VoltageTable(time=(0.0,), voltage=(0.0,)).program()
    closing = run_coil(
        circuit, driver, resistance=1e6, gap=_GAP, step=1e-6, lift=lift, fluxes=rest.loop_fluxes
    )
    narrow = 50e-6 / (_MU0 * _AREA)
    work = 0.5 * mmf**2 * (1.0 / (inner + narrow) - 1.0 / (inner + gap))
    density = flux / 25e-6
    field = (density - 1.2) / (_MU0 * 1.05)
    source = "magnet, yoke and gap in series: B_r l/(mu0 mu_r) over the sum of reluctances"
    return [
        _check(
            "flux of a magnet through a gap of 200 um [Wb]",
            expected=flux,
            computed=float(rest.branch_fluxes[0]),
            tolerance=1e-13,
            source=source,
        ),
        _check(
            "force of the magnet there [N]",
            expected=-(flux**2) / (2.0 * _MU0 * _AREA),
            computed=rest.force,
            tolerance=1e-14,
            source="phi^2/(2 mu0 A), Woodson and Melcher 1968, ch. 3",
        ),
        _check(
            "force of the magnet from the co-energy [N]",
            expected=(beside[1] - beside[0]) / (2.0 * step),
            computed=rest.force,
            tolerance=3e-9,
            source="slope of the co-energy over the gap at no current",
        ),
        _check(
            "magnet on its load line: B over mu0 H, without leakage [-]",
            expected=-(2e-3 * _AREA) / (_GAP * 25e-6),
            computed=density / (_MU0 * field)
            if abs(float(rest.branch_fluxes[0]) / flux - 1.0) < 1e-9
            else float("nan"),
            tolerance=1e-13,
            source="permeance coefficient l_m A_g/(l_g A_m): Furlani 2001, ch. 3",
        ),
        _check(
            "flux at the current that cancels the magnet [Wb]",
            expected=0.0,
            computed=float(cancels.branch_fluxes[0]),
            tolerance=1e-18,
            source="N i = -B_r l/(mu0 mu_r)",
        ),
        _check(
            "flux of the magnet turned round [Wb]",
            expected=-flux,
            computed=float(turned.branch_fluxes[0]),
            tolerance=1e-13,
            source=source,
        ),
        _check(
            "work of the magnet on an armature that closes 150 of 200 um slowly [J]",
            expected=work,
            computed=closing.work,
            tolerance=1e-6,
            source="change of the co-energy mmf^2/2R; closed form",
        ),
        _check(
            "energy balance while it closes [-]",
            expected=0.0,
            computed=closing.residual,
            tolerance=1e-13,
            source="supply = ohmic + work + stored",
        ),
    ]


def _circuit(magnet: PermanentMagnet) -> MagneticCircuit:
    """Magnet and gap in series, and a leakage of the coil."""
    slope = 1.0 / (_MU0 * _AREA)
    law = GapReluctance([0.0, 1e-3], [1e-9, 1e-3 * slope], [slope] * 2)
    return MagneticCircuit(
        branches=(
            MagneticBranch(name="gap", law=law, turns=_TURNS),
            MagneticBranch(
                name="magnet", law=LinearReluctance(magnet.reluctance), remanence=magnet.mmf
            ),
            MagneticBranch(name="leakage", law=LinearReluctance(1.0 / 5e-9), turns=_TURNS),
        ),
        loops=np.array([[1, 0], [1, 0], [0, 1]]),
        main="gap",
    )
