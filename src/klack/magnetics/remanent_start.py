r"""State of a magnet after saturation: iron on the falling branch of its loop.

After a strong positive current every stop rests at its yield on the other side, :math:`s_k =
-\rho_k w(B)`, so that iron follows :math:`H = H_\text{an}(B) - w(B)`.  At the gap and the current
of the start:

.. math:: C^T\bigl[\Theta_b(\varphi_b, x) - \Theta_{0,b} - w_b(\varphi_b) - N_b i\bigr] = 0 .

Limits: iron that came back from its tip by less than twice the flux density of a reversal is
slightly off that branch.  The strong current is that of the terminals alone: iron that another
circuit magnetises the other way, or that the terminals do not reach, depends on which acted last
(:func:`magnetised_otherwise`).
"""

from collections.abc import Iterable, Mapping
from dataclasses import replace

import numpy as np

from klack.arrays import Vector
from klack.errors import ConvergenceError
from klack.magnetics.circuit import MagneticCircuit
from klack.magnetics.flux_table import tubes_of
from klack.magnetics.hysteresis import IronStops
from klack.magnetics.static import StaticState, static_state

__all__ = ["magnetised_otherwise", "remanent_state"]


_STRONG = 1e6  # [A] magnetomotive force that saturates any iron
_MOST = 200
_SETTLED = 1e-13


def remanent_state(
    circuit: MagneticCircuit,
    *,
    current: float,
    gap: float,
    others: Mapping[str, float] | None = None,
) -> tuple[Vector, Vector]:
    """Loop fluxes [Wb] and stops [A], in the order of the compiled step, after saturation.

    Parameters
    ----------
    current [A]
        That remains.
    gap [m]
    others [A]
        Currents of further electric circuits that remain.

    Raises
    ------
    ConvergenceError
    """
    strong = _saturated(circuit, "", gap)
    signs = np.sign(strong.branch_fluxes)
    widths = np.zeros(len(circuit.branches))
    found = static_state(circuit, current=current, gap=gap, others=others)
    scale = float(np.max(np.abs(strong.branch_fluxes)))
    for turn in range(_MOST):
        branches = tuple(
            replace(branch, remanence=branch.remanence + sign * width)
            for branch, sign, width in zip(circuit.branches, signs, widths, strict=True)
        )
        before = found.branch_fluxes
        found = static_state(
            replace(circuit, branches=branches),
            current=current,
            gap=gap,
            start=found.loop_fluxes,
            others=others,
        )
        now = np.array(
            [
                0.0 if branch.stops is None else width_of(branch.stops, flux)
                for branch, flux in zip(circuit.branches, found.branch_fluxes, strict=True)
            ]
        )
        if turn > 1 and np.max(np.abs(found.branch_fluxes - before)) <= _SETTLED * scale:
            break
        widths = now if turn == 0 else 0.5 * (widths + now)  # a falling width could overshoot
    else:
        raise ConvergenceError(
            f"remanent start: the fluxes do not converge at {current:g} A and a gap of {gap:g} "
            "m.\n"
            "Try: a loop that falls less steeply, or start: demagnetised."
        )
    stops = []
    for tube in tubes_of(circuit)[0]:
        flux = float(tube.row @ found.loop_fluxes)
        sign = float(np.sign(tube.row @ strong.loop_fluxes))
        stops += [-sign * part.share * width_of(part, flux) for part in tube.stops]
    return found.loop_fluxes, np.concatenate([np.zeros(0), *stops])


def magnetised_otherwise(
    circuit: MagneticCircuit, others: Iterable[str], *, gap: float
) -> dict[str, tuple[str, ...]]:
    """Hysteretic parts that a strong current of each other circuit leaves otherwise, by circuit.

    That is with a flux against the one that a strong current of the terminals leaves, or with one
    where the terminals drive none.  Circuits without such parts are left out.
    """
    main = _saturated(circuit, "", gap).branch_fluxes
    least = 1e-9 * float(np.max(np.abs(main)))
    found = dict[str, tuple[str, ...]]()
    for name in others:
        own = _saturated(circuit, name, gap).branch_fluxes
        parts = tuple(
            branch.name
            for branch, here, there in zip(circuit.branches, main, own, strict=True)
            if branch.stops is not None
            and abs(there) > least
            and (abs(here) <= least or here * there < 0.0)
        )
        if parts:
            found[name] = parts
    return found


def _saturated(circuit: MagneticCircuit, name: str, gap: float) -> StaticState:
    """Fields at a strong current of one electric circuit; an empty name is the terminals."""
    turns = [abs(branch.turns) for branch in circuit.branches if branch.circuit == name]
    strong = _STRONG / max(turns)
    if not name:
        return static_state(circuit, current=strong, gap=gap)
    return static_state(circuit, current=0.0, gap=gap, others={name: strong})


def width_of(stops: IronStops, flux: float) -> float:
    """Yield of all stops of a part [A] at a flux [Wb]."""
    table, place = stops.width, abs(flux) * float(stops.width[1])
    intervals = int(table[0])
    if not place < intervals:
        return float(table[2 + 4 * intervals])
    i = int(place)
    return float(table[2 + 4 * i : 6 + 4 * i] @ (place - i) ** np.arange(4.0))
