"""An elastic body reduced to modal form: the object that every simulation works with."""

import zipfile
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from klack.errors import InputError, refuse_if
from klack.files.whole import whole_file
from klack.mesh.mesh import Mesh, simplices

__all__ = [
    "HANGS",
    "Recovery",
    "ReducedBody",
    "StateSpace",
    "elastic_count",
    "port_among",
    "read_arrays",
    "surface_faces",
]


Arrays = dict[str, NDArray[Any]]

# a count that cannot be held, a password, an unknown packing
_OTHERS = (MemoryError, RuntimeError, NotImplementedError, KeyError, SyntaxError)


def write_arrays(path: Path, kind: str, version: int, arrays: Mapping[str, NDArray[Any]]) -> None:
    """Write numbers or text, all or nothing; ``kind`` as ``"klack.reduced_body"``."""
    contents: Arrays = {"format": np.array(kind), "version": np.array(version), **arrays}
    with whole_file(path) as new, new.open("wb") as stream:
        np.savez(stream, **contents)  # type: ignore[arg-type]


def read_arrays(path: Path, kind: str, version: int, required: Sequence[str]) -> Arrays:
    """Read arrays; rejects a file that is truncated, of another kind or newer than klack."""
    where = f"file '{path}'"
    try:
        with path.open("rb") as stream:
            if not zipfile.is_zipfile(stream):  # numpy would also take a bare .npy
                raise zipfile.BadZipFile
        with np.load(path, allow_pickle=False) as stored:
            arrays: Arrays = {key: stored[key] for key in stored.files}
    except FileNotFoundError as error:
        raise InputError(
            where, got="no such file", expected=f"a {kind} file", hint="check the path."
        ) from error
    except (OSError, ValueError, EOFError, zipfile.BadZipFile, zlib.error, *_OTHERS) as error:
        raise InputError(
            where,
            got=f"unreadable contents ({type(error).__name__})",
            expected=f"a complete {kind} file",
            hint="the file is damaged or not written by klack; write it again.",
        ) from error
    _check_kind(where, arrays, kind, version)
    missing = [key for key in required if key not in arrays]
    refuse_if(
        missing,
        where,
        got=f"a file without {', '.join(missing)}",
        expected=f"a complete {kind} file of version {version}",
        hint="the file is damaged or was edited; write it again.",
    )
    return arrays


def _check_kind(where: str, arrays: Arrays, kind: str, version: int) -> None:
    found = str(arrays["format"]) if "format" in arrays else "nothing known"
    refuse_if(
        found != kind or "version" not in arrays,
        where,
        got=f"a file that holds {found}",
        expected=kind,
        hint="choose a file written by klack for this purpose.",
    )
    refuse_if(
        int(arrays["version"]) > version,
        where,
        got=f"version {int(arrays['version'])}",
        expected=f"version {version} or older",
        hint="the file was written by a newer version of klack; update klack.",
    )


def port_among(known: Sequence[str], name: str, where: str, what: str, hint: str) -> int:
    """Place of a port among those of a body."""
    if name not in known:
        raise InputError(
            f"{where}: port '{name}'",
            got=f"a name unknown to {what}",
            expected=f"one of: {', '.join(known)}",
            hint=hint,
        )
    return known.index(name)


@dataclass(frozen=True, kw_only=True, eq=False)
class Recovery:
    """Displacement field of part of the surface, for pictures and radiated sound.

    Parameters
    ----------
    nodes (n,)
        Of the full mesh.
    points (n, dimension) [m]
    shapes (n * dimension, m) [1/sqrt(kg)]
        ``u = shapes @ q``, node by node.
    faces (f, 3) or (f, 2)
        Triangles or (axisymmetric) line segments in local numbers, through all nodes, oriented
        outwards; none when nodes were given instead of surfaces.
    """

    nodes: NDArray[np.int64]
    points: NDArray[np.float64]
    shapes: NDArray[np.float64]
    faces: NDArray[np.int64]


def surface_faces(mesh: Mesh, surfaces: Sequence[str]) -> NDArray[np.int64]:
    """Simplices of surfaces by nodes of the mesh, shape (f, dimension)."""
    blocks = [block for name in surfaces for block in mesh.surface(name).blocks]
    pieces = [simplices(block) for block in blocks]
    empty = np.empty((0, mesh.dimension), dtype=np.int64)
    return np.concatenate([empty, *pieces])


HANGS = 2.0 * np.pi * 0.1
"""Frequency [rad/s] at which a whole hangs that nothing holds: forces at rest do not move it."""

FORMAT = "klack.reduced_body"
VERSION = 1


@dataclass(frozen=True, kw_only=True, eq=False)
class StateSpace:
    r"""First-order form ``x' = A x + B F``, ``y = C x + feedthrough F`` with ``x = (q, q')``.

    Parameters
    ----------
    A (2 m, 2 m)
    B (2 m, n_ports)
    C (n_ports + n_observers, 2 m)
    feedthrough (n_ports + n_observers, n_ports) [m/N]
    """

    A: NDArray[np.float64]
    B: NDArray[np.float64]
    C: NDArray[np.float64]
    feedthrough: NDArray[np.float64]
    input_names: tuple[str, ...]
    output_names: tuple[str, ...]


@dataclass(frozen=True, kw_only=True, eq=False)
class ReducedBody:
    r"""Modes of a body at its ports.

    .. math:: \ddot q_i + 2 \zeta_i \omega_i \dot q_i + \omega_i^2 q_i = \sum_p \varphi_{ip} F_p,
              \qquad y_p = \sum_i \varphi_{ip} q_i

    Rigid modes come first, with ``omega = 0``. Input and output share ``port_shapes``: the body is
    reciprocal and, with damping ratios of zero or more, passive.

    Parameters
    ----------
    mass [kg]
    omega (m,) [rad/s]
    damping (m,) [-]
        ``zeta``.
    port_shapes (m, n_ports) [1/sqrt(kg)]
        ``phi = V^T b``.
    observer_shapes (m, n_observers) [1/sqrt(kg)]
    static_compliance (n_ports, n_ports) [m/N]
        Of the *full* body; of a free body the elastic part only (inertia relief).
    rigid_axial (rigid_count,) [sqrt(kg)]
        Modal velocities of a unit axial velocity, ``R^T M e_z``. The centre of mass moves at
        ``rigid_axial . q'_rigid / mass``; ``rigid_axial . rigid_axial = mass`` for a free body.
    dof_count
        Of the full body.
    correction
        See :mod:`klack.bodies.reduction.reduce`.
    attachment_count
        Attachment modes among the modes.
    momentum (m,) [sqrt(kg)]
        Axial momentum per modal velocity of what moves as a whole without rigid modes, such as a
        valve on its machine; not stored.
    """

    name: str
    mass: float
    omega: NDArray[np.float64]
    damping: NDArray[np.float64]
    port_names: tuple[str, ...]
    port_shapes: NDArray[np.float64]
    observer_names: tuple[str, ...]
    observer_shapes: NDArray[np.float64]
    static_compliance: NDArray[np.float64]
    rigid_count: int
    rigid_axial: NDArray[np.float64]
    dof_count: int
    correction: str = "consistent"
    attachment_count: int = 0
    recovery: Recovery | None = None
    momentum: NDArray[np.float64] | None = None

    def __post_init__(self) -> None:
        modes, ports, observers = len(self.omega), len(self.port_names), len(self.observer_names)
        expected = {
            "damping": (modes,),
            "port_shapes": (modes, ports),
            "observer_shapes": (modes, observers),
            "static_compliance": (ports, ports),
            "rigid_axial": (self.rigid_count,),
        }
        for key, shape in expected.items():
            actual = np.shape(getattr(self, key))
            if actual != shape:
                raise InputError(
                    f"reduced body '{self.name}': {key}",
                    got=f"shape {actual}",
                    expected=f"shape {shape}",
                    hint="modes are rows, ports and observers are columns.",
                )
        rigid = np.asarray(self.omega) == 0
        refuse_if(
            not (np.all(rigid[: self.rigid_count]) and not np.any(rigid[self.rigid_count :])),
            f"reduced body '{self.name}': omega",
            got=f"{int(rigid.sum())} zero frequencies",
            expected=f"exactly the first {self.rigid_count} (rigid_count)",
            hint="rigid modes come first, elastic modes above 0 rad/s follow.",
        )

    @property
    def moves(self) -> bool:
        """Whether its centre of mass moves other than by waves within."""
        return self.rigid_count > 0 or self.momentum is not None

    @property
    def mode_count(self) -> int:
        """Number of modes, rigid ones included."""
        return len(self.omega)

    @property
    def frequencies(self) -> NDArray[np.float64]:
        """Eigenfrequencies [Hz], shape (m,); rigid ones are 0."""
        return self.omega / (2.0 * np.pi)

    @property
    def resting_omega(self) -> NDArray[np.float64]:
        """Of the elastic modes [rad/s], for forces at rest; infinite for those that hang."""
        elastic = self.omega[self.rigid_count :]
        return np.where(elastic > HANGS, elastic, np.inf)

    @property
    def modal_compliance(self) -> NDArray[np.float64]:
        """Static compliance [m/N] of the elastic modes, shape (n_ports, n_ports)."""
        scaled = self.port_shapes[self.rigid_count :] / self.omega[self.rigid_count :, None]
        return scaled.T @ scaled

    @property
    def residual_compliance(self) -> NDArray[np.float64]:
        """Static minus modal compliance [m/N], shape (n_ports, n_ports)."""
        return self.static_compliance - self.modal_compliance

    @property
    def compliance_share(self) -> NDArray[np.float64]:
        """Share of the static compliance that the modes carry, shape (n_ports,)."""
        return np.diag(self.modal_compliance) / np.diag(self.static_compliance)

    def along_axis(self) -> Self:
        """The body with no rigid motion but the shift along its axis, as in a guide.

        A held body stays as it is.
        """
        r, size = self.rigid_count, float(np.linalg.norm(self.rigid_axial))
        if r < 2 or size == 0.0:
            return self
        shift = self.rigid_axial / size

        def kept(shapes: NDArray[np.float64]) -> NDArray[np.float64]:
            return np.vstack([shift @ shapes[:r], shapes[r:]])

        recovery = self.recovery
        if recovery is not None:
            recovery = replace(recovery, shapes=kept(recovery.shapes.T).T)
        return replace(
            self,
            omega=self.omega[r - 1 :],
            damping=self.damping[r - 1 :],
            port_shapes=kept(self.port_shapes),
            observer_shapes=kept(self.observer_shapes),
            rigid_count=1,
            rigid_axial=np.array([size]),
            recovery=recovery,
        )

    def port_index(self, name: str) -> int:
        """Column of a port."""
        hint = "ports are named when the body is reduced."
        return port_among(self.port_names, name, f"reduced body '{self.name}'", "the body", hint)

    def state_space(self, *, with_residual: bool) -> StateSpace:
        """First-order form for control and system tools.

        Parameters
        ----------
        with_residual
            Put :attr:`residual_compliance` into the feedthrough between the ports; the share of
            observers is not known.
        """
        m, ports, observers = self.mode_count, len(self.port_names), len(self.observer_names)
        A = np.zeros((2 * m, 2 * m))
        A[:m, m:] = np.eye(m)
        A[m:, :m] = -np.diag(self.omega**2)
        A[m:, m:] = -np.diag(2.0 * self.damping * self.omega)
        B = np.vstack([np.zeros((m, ports)), self.port_shapes])
        outputs = np.vstack([self.port_shapes.T, self.observer_shapes.T])
        feedthrough = np.zeros((ports + observers, ports))
        if with_residual:
            feedthrough[:ports] = self.residual_compliance
        return StateSpace(
            A=A,
            B=B,
            C=np.hstack([outputs, np.zeros((ports + observers, m))]),
            feedthrough=feedthrough,
            input_names=self.port_names,
            output_names=(*self.port_names, *self.observer_names),
        )

    def save(self, path: str | Path) -> None:
        """Write to a ``.npz`` file (no pickle), completely or not at all."""
        arrays = {key: np.asarray(getattr(self, key)) for key in (*_ARRAYS, *_NAMES, *_SCALARS)}
        for key in _NAMES:
            arrays[key] = np.array(getattr(self, key), dtype=np.str_)
        if self.recovery is not None:
            for key in _RECOVERY:
                arrays[f"recovery_{key}"] = getattr(self.recovery, key)
        write_arrays(Path(path), FORMAT, VERSION, arrays)

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """Read back what :meth:`save` wrote."""
        required = (*_ARRAYS, *_NAMES, *_SCALARS)
        arrays = read_arrays(Path(path), FORMAT, VERSION, required)
        recovery = None
        if all(f"recovery_{key}" in arrays for key in _RECOVERY):
            recovery = Recovery(**{key: arrays[f"recovery_{key}"] for key in _RECOVERY})
        values: dict[str, Any] = {key: arrays[key] for key in _ARRAYS}
        values |= {key: tuple(str(name) for name in arrays[key]) for key in _NAMES}
        values |= {key: arrays[key].item() for key in _SCALARS}
        return cls(**values, recovery=recovery)


_ARRAYS = (
    *("omega", "damping", "port_shapes", "observer_shapes"),
    *("static_compliance", "rigid_axial"),
)
_NAMES = ("port_names", "observer_names")
_SCALARS = ("name", "mass", "rigid_count", "dof_count", "correction", "attachment_count")
_RECOVERY = ("nodes", "points", "shapes", "faces")


def elastic_count(body: ReducedBody) -> int:
    """Number of elastic modes without attachment modes."""
    return body.mode_count - body.rigid_count - body.attachment_count
