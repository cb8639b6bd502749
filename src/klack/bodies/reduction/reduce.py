"""From a finite-element body to a reduced one.

Every reduction also computes the static compliance at the ports of the *full* body. What the kept
modes miss of it comes back in one of two ways, never in both:

- ``"consistent"``: the modes stay alone, and the local contact law takes exactly the missing
  compliance; nothing is counted twice, for any number of modes (default).
- ``"attachment"``: one attachment mode per port (and shift) joins the basis, and the contact keeps
  a constant local stiffness; the classical recipe.
- ``"none"``: nothing comes back; to show what is lost.
"""

from collections.abc import Sequence
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from klack.bodies.elasticity.body import ElasticBody
from klack.bodies.elasticity.eigen import Modes, eigenmodes
from klack.bodies.elasticity.factorization import Backend
from klack.bodies.elasticity.statics import Flexibility
from klack.bodies.reduction.attachment import residual_attachment, shifted_attachment
from klack.bodies.reduction.damping import Damping, damping_ratios
from klack.bodies.reduction.ports import Observer, Port
from klack.bodies.reduction.reduced_body import Recovery, ReducedBody, surface_faces
from klack.bodies.reduction.selection import ByCount, ByFrequency, ModeSelection, select
from klack.errors import InputError, refuse_if

__all__ = ["Correction", "at_ports", "kept_modes", "reduce_body"]

Correction = Literal["consistent", "attachment", "none"]


def reduce_body(
    body: ElasticBody,
    ports: Sequence[Port],
    *,
    modes: ModeSelection,
    correction: Correction,
    damping: Damping,
    observers: Sequence[Observer] = (),
    modes_pool: Modes | None = None,
    flexibility: Flexibility | None = None,
    port_compliance: NDArray[np.float64] | None = None,
    shifts: Sequence[float] | None = None,
    recovery_surfaces: Sequence[str] = (),
    recovery_nodes: NDArray[np.int64] | None = None,
    backend: Backend = "auto",
    threads: int | None = None,
) -> ReducedBody:
    """Reduce a body to rigid, elastic and (if requested) attachment modes.

    Parameters
    ----------
    damping
        Rigid modes stay undamped.
    modes_pool
        Known elastic modes, lowest first without gaps; saves the eigenvalue solution. With
        :class:`ByFrequency` it must reach that frequency.
    flexibility
        Of this body; saves the factorisation.
    port_compliance (n_ports, n_ports) [m/N]
        Known static compliance; saves the static solutions, unless attachment modes need them.
    shifts [(rad/s)^2]
        With ``correction="attachment"``: shifted instead of residual attachment modes, for example
        ``(default_shift(pool.omega),)`` or ``shift_at`` of frequencies.
    recovery_surfaces
        Whose displacement can be recovered from the modes.
    recovery_nodes
        Further ones to recover.
    """
    patterns = _patterns(body, ports)
    flexibility = flexibility or Flexibility(body, backend=backend, threads=threads)
    pool = modes_pool if modes_pool is not None else _compute_pool(body, modes, flexibility)
    kept = kept_modes(modes, pool, patterns)
    extra = _no_modes(body)
    static = port_compliance
    if static is None:
        static = patterns.T @ flexibility.deflections(patterns)
    if correction == "attachment" and shifts is None:
        extra = residual_attachment(body, kept, flexibility.deflections(patterns))
    elif correction == "attachment" and shifts is not None:
        extra = shifted_attachment(body, kept, patterns, shifts, flexibility)
    elif shifts is not None:
        raise InputError(
            f"reduction of body '{body.name}': shifts",
            got=f'shifts with correction="{correction}"',
            expected='correction="attachment"',
            hint="leave the shifts out, or use attachment modes.",
        )
    rigid = body.rigid_modes
    shapes = (rigid, kept.shapes, extra.shapes)
    omega = np.concatenate([np.zeros(rigid.shape[1]), kept.omega, extra.omega])
    return ReducedBody(
        name=body.name,
        mass=float(body.mass),
        omega=omega,
        damping=damping_ratios(damping, body, omega, *shapes),
        port_names=tuple(port.name for port in ports),
        port_shapes=np.vstack([at_ports(part, patterns) for part in shapes]),
        observer_names=tuple(observer.name for observer in observers),
        observer_shapes=_observed(body, shapes, observers),
        static_compliance=(static + static.T) / 2.0,
        rigid_count=rigid.shape[1],
        rigid_axial=rigid.T @ body.axial_momentum,
        dof_count=body.dof_count,
        correction=correction,
        attachment_count=len(extra.omega),
        recovery=_recovery(body, shapes, recovery_surfaces, recovery_nodes),
    )


def kept_modes(selection: ModeSelection, pool: Modes, patterns: NDArray[np.float64]) -> Modes:
    """Elastic modes of a pool that a reduction keeps, with their full shapes.

    Parameters
    ----------
    patterns (n_dof, n_ports) [-]
    """
    return pool.kept(select(selection, pool.omega, at_ports(pool.shapes, patterns)))


def at_ports(shapes: NDArray[np.float64], patterns: NDArray[np.float64]) -> NDArray[np.float64]:
    """Displacement of modes at ports, shape (modes, ports); most nodes have no part in any."""
    rows = np.flatnonzero(patterns.any(axis=1))
    return np.asarray(shapes[rows].T @ patterns[rows])


def _compute_pool(body: ElasticBody, modes: ModeSelection, flexibility: Flexibility) -> Modes:
    if isinstance(modes, ByFrequency):
        return eigenmodes(body, max_frequency=modes.maximum, flexibility=flexibility)
    count = modes.count if isinstance(modes, ByCount) else modes.pool
    if count == 0:
        return _no_modes(body)
    return eigenmodes(body, count=count, flexibility=flexibility)


def _no_modes(body: ElasticBody) -> Modes:
    return Modes(omega=np.empty(0), shapes=np.empty((body.dof_count, 0)))


def _patterns(body: ElasticBody, ports: Sequence[Port]) -> NDArray[np.float64]:
    where = f"reduction of body '{body.name}': ports"
    names = [port.name for port in ports]
    refuse_if(
        not names or len(set(names)) < len(names),
        where,
        got=f"the names {names}",
        expected="at least one port, each with its own name",
        hint="name one port for each contact.",
    )
    for port in ports:
        _require_length(f"{where}: '{port.name}'", port.pattern, body.dof_count)
    return np.column_stack([port.pattern for port in ports])


def _observed(
    body: ElasticBody, shapes: Sequence[NDArray[np.float64]], observers: Sequence[Observer]
) -> NDArray[np.float64]:
    for observer in observers:
        _require_length(f"observer '{observer.name}'", observer.weights, body.dof_count)
    weights = np.zeros((body.dof_count, len(observers)))
    for column, observer in enumerate(observers):
        weights[:, column] = observer.weights
    return np.vstack([at_ports(part, weights) for part in shapes])


def _require_length(where: str, values: NDArray[np.float64], length: int) -> None:
    refuse_if(
        values.shape != (length,),
        where,
        got=f"{len(values)} weights",
        expected=f"{length}, one for each degree of freedom of the body",
        hint="define the port with the mesh of this body.",
    )


def _recovery(
    body: ElasticBody,
    shapes: Sequence[NDArray[np.float64]],
    surfaces: Sequence[str],
    nodes: NDArray[np.int64] | None,
) -> Recovery | None:
    faces = surface_faces(body.mesh, surfaces)
    extra = np.empty(0, dtype=np.int64) if nodes is None else np.asarray(nodes, dtype=np.int64)
    wanted = np.unique(np.concatenate([faces.ravel(), extra]))
    if not wanted.size:
        return None
    components = np.arange(body.dimension)
    rows = (wanted[:, None] * body.dimension + components).ravel()
    return Recovery(
        nodes=wanted,
        points=body.mesh.points[wanted],
        shapes=np.hstack([part[rows] for part in shapes]),
        faces=np.searchsorted(wanted, faces),
    )
