"""A held body as a source of sound: modes, ports, and the normal motion of its surface."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from klack.errors import InputError

__all__ = ["STRUCTURE_UNITS", "Structure"]

STRUCTURE_UNITS: Mapping[str, str] = {
    "omega": "rad/s",
    "damping": "1",
    "port_signs": "1",
    "port_shapes": "kg^-0.5",
    "static_compliance": "m/N",
    "participation": "kg^0.5",
    "group_area": "m^2",
    "face_area": "m^2",
    "face_shapes": "kg^-0.5",
    "face_residual": "m/N",
    "axial_normals": "1",
}
"""Units of the arrays of a stored :class:`Structure`."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Structure:
    r"""Modes of a supported body at its ports, its support and its surface.

    .. math:: \ddot q_i + 2 \zeta_i \omega_i \dot q_i + \omega_i^2 q_i = \sum_p \varphi_{ip} F_p,
              \qquad u_n(x) = \sum_i n \cdot \phi_i(x)\, q_i + \sum_p r_p(x) F_p

    ``m`` modes, ``p`` ports, ``g`` groups of the surface, ``f`` faces, ``k`` points.  Surface
    integrals know ``b = m + p + 1`` fields in this order: the modes, the static rests ``r_p`` of
    the ports, and a unit axial motion of the whole body.

    Parameters
    ----------
    name : str
        Of the body.
    mass : float [kg]
    dimension : int
        2: axisymmetric, in the meridian plane; areas are those of the full rings.
    omega : array, shape (m,) [rad/s]
    damping : array, shape (m,) [-]
    port_names : tuple of str
    port_stops : tuple of str
        Stop whose force acts at each port; empty for ports of other components.
    port_signs : array, shape (p,) [-]
        Force at the port, along +z, for a force above zero of its stop: +1 on the upper body of
        the stop, -1 on the lower one.
    port_shapes : array, shape (m, p) [1/sqrt(kg)]
    static_compliance : array, shape (p, p) [m/N]
        Of the full body.
    participation : array, shape (m,) [sqrt(kg)]
        ``R_z^T M phi``: axial momentum per modal velocity.
    group_names : tuple of str
        Named surfaces that meet the air.
    group_area : array, shape (g,) [m^2]
    group_gram : array, shape (g, b, b) [m^2/kg for two modes]
        ``int (n . u_i)(n . u_j) dA`` of two fields over each group, by the quadrature of the
        elements; symmetric.
    group_volume : array, shape (g, b) [m^2/sqrt(kg) for a mode]
        ``int n . u_i dA``: volume displaced per displacement of a field.
    points : array, shape (k, dimension) [m]
        Corners of the faces; (r, z) or (x, y, z).
    faces : int array, shape (f, 2), (f, 3) or (f, 4)
        Element faces by their corners; a triangle repeats its last corner among quadrangles.
    face_group : int array, shape (f,)
    face_area : array, shape (f,) [m^2]
    face_shapes : float32 array, shape (f, m) [1/sqrt(kg)]
        Mean of ``n . phi_i`` over each face, n outwards.
    face_residual : float32 array, shape (f, p) [m/N]
        Static normal displacement of each face per force at each port, less the share of the modes.
    axial_normals : array, shape (f,) [-]
        Mean axial component of the outward normal: what the face sees of a rigid axial motion.
    """

    name: str
    mass: float
    dimension: int
    omega: NDArray[np.float64]
    damping: NDArray[np.float64]
    port_names: tuple[str, ...]
    port_stops: tuple[str, ...]
    port_signs: NDArray[np.float64]
    port_shapes: NDArray[np.float64]
    static_compliance: NDArray[np.float64]
    participation: NDArray[np.float64]
    group_names: tuple[str, ...]
    group_area: NDArray[np.float64]
    group_gram: NDArray[np.float64]
    group_volume: NDArray[np.float64]
    points: NDArray[np.float64]
    faces: NDArray[np.int64]
    face_group: NDArray[np.int64]
    face_area: NDArray[np.float64]
    face_shapes: NDArray[np.float32]
    face_residual: NDArray[np.float32]
    axial_normals: NDArray[np.float64]

    @property
    def highest_frequency(self) -> float:
        """Highest kept mode [Hz]: above it the response is that of the static rest alone."""
        return float(self.omega.max() / (2.0 * np.pi)) if self.omega.size else 0.0

    @property
    def residual_compliance(self) -> NDArray[np.float64]:
        """Residual compliance of the modes [m/N], shape (p, p)."""
        scaled = self.port_shapes / self.omega[:, None]
        return self.static_compliance - scaled.T @ scaled

    def port_index(self, name: str) -> int:
        """Column of a port.

        Raises
        ------
        InputError
            If there is none of that name.
        """
        if name not in self.port_names:
            raise InputError(
                f"body '{self.name}': port '{name}'",
                got="a name that the body does not have",
                expected=f"one of: {', '.join(self.port_names)}",
                hint="a contact port is named like its surface; of klack impact 'contact'.",
            )
        return self.port_names.index(name)

    @property
    def area(self) -> float:
        """Radiating area [m^2]."""
        return float(self.group_area.sum())
