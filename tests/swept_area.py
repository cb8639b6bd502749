"""Area that an edge of a profile sweeps."""

import numpy as np

from klack.mesh.profile import Profile

__all__ = ["swept_area"]


def swept_area(profile: Profile, name: str) -> float:
    """Area [m^2] of the surface of revolution of all edges of a name (Pappus)."""
    edges = [curve.quadrature() for curve in profile.curves if curve.name == name]
    assert edges, name
    lengths = ((points, np.linalg.norm(tangent, axis=1)) for points, tangent in edges)
    return float(sum(2.0 * np.pi * points[:, 0] @ length for points, length in lengths))
