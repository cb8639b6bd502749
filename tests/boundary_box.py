"""A closed box in triangles."""

import numpy as np

from klack.acoustics.boundary.triangles import Triangles


def box(size: float) -> Triangles:
    """1 m by 1 m by 1.5 m, its faces in squares of two triangles."""
    sides = np.array([1.0, 1.0, 1.5])
    points, corners, first = [], [], 0
    for axis in range(3):
        for end in (0.0, 1.0):
            u, v = [(axis + 1) % 3, (axis + 2) % 3][:: 1 if end else -1]
            nu, nv = (max(1, round(sides[i] / size)) for i in (u, v))
            grid = np.zeros((nu + 1, nv + 1, 3))
            grid[..., axis] = end * sides[axis]
            grid[..., u] = np.linspace(0.0, sides[u], nu + 1)[:, None]
            grid[..., v] = np.linspace(0.0, sides[v], nv + 1)
            number = first + np.arange((nu + 1) * (nv + 1)).reshape(nu + 1, nv + 1)
            a, b, c, d = (
                number[i : nu + i, j : nv + j] for i, j in ((0, 0), (1, 0), (1, 1), (0, 1))
            )
            corners += [np.stack(t, axis=-1).reshape(-1, 3) for t in ((a, b, c), (a, c, d))]
            points.append(grid.reshape(-1, 3) - sides / 2.0)
            first += grid.shape[0] * grid.shape[1]
    all_points, of = np.concatenate(points), np.concatenate(corners)
    _, there, number = np.unique(
        np.round(all_points, 9), axis=0, return_index=True, return_inverse=True
    )
    return Triangles(points=all_points[there], corners=number.ravel()[of])
