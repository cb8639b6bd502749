r"""Elastic mount: the held surfaces move along the axis on a spring.

One rigid boundary mode ``s`` joins the modes of the held body (Craig & Bampton 1968):

.. math:: \begin{pmatrix} 1 & p \\ p^T & M \end{pmatrix}
          \begin{pmatrix} \ddot q \\ \ddot s \end{pmatrix} +
          \begin{pmatrix} \omega^2 & 0 \\ 0 & k (1 + i\eta) \end{pmatrix}
          \begin{pmatrix} q \\ s \end{pmatrix} =
          \begin{pmatrix} \varphi^T F \\ \sum F \end{pmatrix}

with the participations ``p = R_z^T M phi``. Mass that the kept modes miss moves with the mount.
Impact forces stay those of the rigidly held body.
"""

from dataclasses import dataclass, replace

import numpy as np
import scipy
from numpy.typing import NDArray

from klack.acoustics.plate import Plate
from klack.bodies.reduction.craig_bampton import CraigBampton
from klack.bodies.reduction.structure import Structure
from klack.errors import refuse_if, require_nonnegative, require_positive

__all__ = ["Mount", "axial_freedom", "mounted", "moved_mass", "support_mobility"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Mount:
    """Spring below the held surfaces.

    Parameters
    ----------
    stiffness [N/m]
        Axial.
    loss_factor [-]
    mass [kg]
        That moves on it; default: of the structure.
    """

    stiffness: float
    loss_factor: float = 0.05
    mass: float | None = None

    def __post_init__(self) -> None:
        require_positive("Mount.stiffness", self.stiffness, "N/m")
        require_nonnegative("Mount.loss_factor", self.loss_factor, "-")


def moved_mass(structure: Structure, mount: Mount | None) -> float:
    """Mass on the support [kg], at least that in the modes."""
    mass = structure.mass if mount is None or mount.mass is None else mount.mass
    carried = float(structure.participation @ structure.participation)
    refuse_if(
        not mass > carried,
        f"mount of '{structure.name}': mass",
        got=f"{mass:g} kg",
        expected=f"more than {carried:g} kg, the mass that the modes of the body move",
        hint=f"the body alone has {structure.mass:g} kg; leave the mass out to use that.",
    )
    return mass


def axial_freedom(structure: Structure, mass: float) -> CraigBampton:
    """All held surfaces as one mount that moves along the axis, with a mass [kg] on it."""
    none = np.zeros((1, 1))
    return CraigBampton(
        omega=structure.omega,
        damping=structure.damping,
        mounts=("support",),
        directions=(3,),
        references=np.zeros((1, 3)),
        participation=structure.participation[:, None],
        mass=np.full((1, 1), mass),
        stiffness=none,
        loss=none,
        port_names=structure.port_names,
        port_shapes=structure.port_shapes,
        port_motion=np.ones((1, len(structure.port_names))),
    )


def support_mobility(
    frequency: NDArray[np.float64], mount: Mount | None, plate: Plate | None
) -> NDArray[np.complex128]:
    r"""Velocity of the held surfaces per force below [m/(N s)], shape (k,).

    .. math:: Y_s = \frac{i \omega}{k (1 + i \eta)} + \frac{1}{8 \sqrt{D m''}}

    Spring and plate in series; zero for a rigid hold.
    """
    omega = 2.0 * np.pi * np.asarray(frequency, dtype=float)
    total = np.zeros(omega.shape, dtype=complex)
    if mount is not None:
        total += 1j * omega / (mount.stiffness * (1.0 + 1j * mount.loss_factor))
    if plate is not None:
        total += plate.mobility
    return total


def mounted(structure: Structure, mount: Mount) -> Structure:
    """The same structure, rigidly held before, on an elastic mount, in its new modes.

    Its modes are the eigenmodes of the module's equations, nothing neglected. Their damping ratios
    share the losses of the old modes and the mount by the energy in each (modal strain energy,
    Johnson & Kienholz 1982), as long as damped modes do not overlap.
    """
    mass, m = moved_mass(structure, mount), len(structure.omega)
    M, K = axial_freedom(structure, mass).matrices()
    K[m, m] = mount.stiffness
    squares, psi = scipy.linalg.eigh(K, M)
    omega = np.sqrt(squares)
    fixed, motion = psi[:m], psi[m]
    lost = fixed.T**2 @ (structure.damping * structure.omega) / omega
    lost = lost + mount.loss_factor * mount.stiffness * motion**2 / (2.0 * squares)
    carried = _carried_fields(structure, psi)
    shapes = fixed.T @ structure.port_shapes + motion[:, None]
    # the rest that the modes miss stays; in this form it survives a very soft mount
    static = structure.residual_compliance + (shapes.T / squares) @ shapes
    return replace(
        structure,
        mass=mass,
        omega=omega,
        damping=lost,
        port_shapes=shapes,
        static_compliance=static,
        participation=fixed.T @ structure.participation + mass * motion,
        group_gram=carried.T @ structure.group_gram @ carried,
        group_volume=structure.group_volume @ carried,
        face_shapes=(
            structure.face_shapes @ fixed + structure.axial_normals[:, None] * motion
        ).astype(np.float32),
    )


def _carried_fields(structure: Structure, psi: NDArray[np.float64]) -> NDArray[np.float64]:
    """Old surface fields by the new ones, shape (b, b + 1)."""
    m, b = len(structure.omega), structure.group_gram.shape[1]
    carried = np.zeros((b, b + 1))
    carried[:m, : m + 1] = psi[:m]
    carried[-1, : m + 1] = psi[m]
    carried[m:, m + 1 :] = np.eye(b - m)
    return carried
