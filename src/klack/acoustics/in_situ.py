r"""Blocked forces from a running assembly, as a bench finds them (ISO 20270:2019).

Velocities :math:`v` of indicators on the receiver are measured while the source runs, and the
mobilities :math:`Y_C` from the interface of the assembly to them while it does not.  Then

.. math:: Y_C F_{bl} = v

gives the blocked force of the source, whatever the receiver is (Moorhouse, Elliott & Evans 2009);
indicators on the source itself would also see its internal forces.  The virtual test makes both
from models and inverts them in the same way, without noise.  With the noise of a measurement
single components are off by tens of per cent where the prediction at another place is right within
some: on-board validation shows that the prediction works, not that a component is right.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from klack.acoustics.coupling import Junction
from klack.acoustics.interface import Complexes, Freedom
from klack.arrays import Vector
from klack.errors import refuse_if

__all__ = ["VirtualTest", "blocked_force_in_situ", "virtual_test"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class VirtualTest:
    """What a bench would measure, and what it would find.

    Parameters
    ----------
    indicators
        m freedoms of the receiver.
    freedoms
        n of the interface in which the assembly moves; where the receiver is blocked no indicator
        tells of a force.
    velocity (k, m) [m/s/Hz]
        Of the indicators in operation.
    assembly (k, m, n) [m/(N s), 1/(N s) per moment]
        From the interface of the assembly, on the side of the source, to the indicators.
    blocked_force (k, n) [N/Hz, N m/Hz]
        Found.
    exact (k, n)
        ``Y_S^-1 v_f`` of the free source.
    deviation (k,) [-]
        Norm of their difference over that of ``exact``, moments scaled.
    condition (k,)
        Of the scaled assembly.
    """

    indicators: tuple[Freedom, ...]
    freedoms: tuple[Freedom, ...]
    velocity: Complexes
    assembly: Complexes
    blocked_force: Complexes
    exact: Complexes
    deviation: Vector
    condition: Vector


def virtual_test(
    joint: Junction, *, length: float, indicators: Sequence[str] | None = None
) -> VirtualTest:
    """Measure and invert the assembly of a model.

    Parameters
    ----------
    joint
        Source and receiver, from :func:`klack.acoustics.coupling.junction`.
    length [m]
        By which moments are scaled: the distance of the feet, or the radius of gyration.
    indicators
        Freedoms of the receiver (``a.z``), on points where no mount stands or at the interface;
        all of them without.
    """
    names = [str(freedom) for freedom in joint.places]
    chosen = list(range(len(names)))
    if indicators is not None:
        for name in indicators:
            refuse_if(
                name not in names,
                "indicators",
                got=f"'{name}'",
                expected=f"some of: {', '.join(names)}",
                hint="indicators are freedoms of the receiver.",
            )
        chosen = [names.index(name) for name in indicators]
    _, running = joint.forces(joint.free_velocity[..., None])
    _, driven = joint.forces(joint.mobility)  # by a unit force at each freedom of the interface
    spread = joint.spread[:, chosen]
    velocity, assembly = (spread @ running)[..., 0], spread @ driven
    moved_at = np.any(joint.receiver.mobility != 0.0, axis=(0, 1))
    known = tuple(f for f, moved in zip(joint.freedoms, moved_at, strict=True) if moved)
    assembly, scale = assembly[:, :, moved_at], _scale(known, length)
    found = blocked_force_in_situ(assembly, velocity, known, length=length)
    exact = blocked_force_in_situ(
        joint.mobility, joint.free_velocity, joint.freedoms, length=length
    )[:, moved_at]
    apart, size = (np.linalg.norm(force / scale, axis=1) for force in (found - exact, exact))
    return VirtualTest(
        indicators=tuple(joint.places[i] for i in chosen),
        freedoms=known,
        velocity=velocity,
        assembly=assembly,
        blocked_force=found,
        exact=exact,
        deviation=apart / np.maximum(size, np.finfo(float).tiny),
        condition=np.linalg.cond(assembly * scale),
    )


def blocked_force_in_situ(
    assembly: Complexes, velocity: Complexes, freedoms: tuple[Freedom, ...], *, length: float
) -> Complexes:
    """Blocked force of a source by least squares [N/Hz, N m/Hz], shape (k, n).

    Parameters
    ----------
    assembly (k, m, n)
        Mobilities of the assembly from its interface to m indicators; m >= n.
    velocity (k, m) [m/s/Hz]
        Of the indicators in operation.
    freedoms
        n of them.
    length [m]
        By which moments are scaled.
    """
    m, n = assembly.shape[1:]
    refuse_if(
        m < n,
        "in-situ blocked force",
        got=f"{m} indicators for {n} unknown forces",
        expected=f"at least {n}, better {2 * n}",
        hint="add indicators, or leave out degrees of freedom of the mounts.",
    )
    scale = _scale(freedoms, length)
    solved = np.linalg.pinv(assembly * scale, rcond=1e-13) @ velocity[..., None]
    return np.asarray(scale * solved[..., 0])


def _scale(freedoms: tuple[Freedom, ...], length: float) -> Vector:
    """1 for forces, a length for moments, shape (n,)."""
    return np.array([length if freedom.is_rotation else 1.0 for freedom in freedoms])
