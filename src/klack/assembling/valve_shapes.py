"""Full shapes of the modes of a valve, to see the motion that its coordinates describe."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from klack.assembling.spatial import modes_in_network
from klack.assembling.valve import build_valve_bodies, valve_parts
from klack.case.valve import ValveCase
from klack.elasticity.body import ElasticBody
from klack.progress import Progress, silent

__all__ = ["BodyShapes", "valve_shapes"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BodyShapes:
    """A body and the shapes of its coordinates.

    Parameters
    ----------
    body : ElasticBody
    shapes : array, shape (n_dof, m) [1/sqrt(kg)]
        Rigid ones first.
    omega : array, shape (m,) [rad/s]
    above : mapping of str to float [m]
        By stop: how far the upper body stands above its drawing where the network has its
        displacements 0, the lower one as it is drawn; of the stops of this body.
    is_upper : mapping of str to bool
        By stop.
    """

    body: ElasticBody
    shapes: NDArray[np.float64]
    omega: NDArray[np.float64]
    above: Mapping[str, float]
    is_upper: Mapping[str, bool]


def valve_shapes(
    case: ValveCase, progress: Progress = silent, *, threads: int | None = None
) -> dict[str, BodyShapes]:
    """Mesh the bodies of a valve, and compute the modes that its network keeps.

    Meshes, factors and modes are those that a run has cached.

    Parameters
    ----------
    case : ValveCase
    progress : callable
    threads : int, optional

    Raises
    ------
    InputError
        For a case that no valve can be built from.
    """
    with threadpool_limits(limits=threads or 1, user_api="blas"):
        parts = valve_parts(case, build_valve_bodies(case, progress), progress, threads or 1)
        for flexibility in parts.flexibilities.values():
            flexibility.close()
    found = {}
    for name, body in parts.bodies.items():
        kept = modes_in_network(case, name, parts.pools, parts.ports)
        rigid = body.rigid_modes
        touching = [
            c for c in parts.contacts.values() if name in (c.pair.upper.name, c.pair.lower.name)
        ]
        found[name] = BodyShapes(
            body=body,
            shapes=np.hstack([rigid, kept.shapes]),
            omega=np.append(np.zeros(rigid.shape[1]), kept.omega),
            above={
                c.name: c.pair.shift + float(getattr(case.network.components[c.name], "gap", 0.0))
                for c in touching
            },
            is_upper={c.name: c.pair.upper.name == name for c in touching},
        )
    return found
