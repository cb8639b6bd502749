"""What statics and vibration ask of a body: matrices, supports, rigid modes."""

from typing import Protocol

from numpy import float64, int64
from numpy.typing import NDArray
from scipy.sparse import csr_array

from klack.mesh.mesh import Mesh

__all__ = ["VibratingBody"]


class VibratingBody(Protocol):
    """A body with every freedom it has, or of revolution in one Fourier order around its axis.

    :class:`~klack.elasticity.body.ElasticBody` and
    :class:`~klack.elasticity.fourier_body.FourierBody`.
    """

    @property
    def name(self) -> str:
        """Name in messages."""

    @property
    def mesh(self) -> Mesh:
        """Nodes and elements."""

    @property
    def dimension(self) -> int:
        """Degrees of freedom of each node."""

    @property
    def K(self) -> csr_array:
        """Stiffness of all degrees of freedom, supports not applied."""

    @property
    def M(self) -> csr_array:
        """Mass of all degrees of freedom."""

    @property
    def fixed(self) -> NDArray[int64]:
        """Sorted degrees of freedom that are held at zero."""

    @property
    def free(self) -> NDArray[int64]:
        """Sorted degrees of freedom that are not fixed."""

    @property
    def dof_count(self) -> int:
        """Number of degrees of freedom, fixed ones included."""

    @property
    def rigid_modes(self) -> NDArray[float64]:
        """Rigid modes, orthonormal in the mass; no columns for a fixed body."""

    @property
    def isostatic_support(self) -> NDArray[int64]:
        """Degrees of freedom, one per rigid mode, that prevent every rigid motion when fixed."""
