"""Normals at the nodes of a mesh: those of the faces there, each by its angle at the node.

    n_v = Σ_f α_fv n_f / |Σ_f α_fv n_f|                             (Thürmer and Wüthrich 1998, J. Graphics Tools 3, 43)

Mitsuba computes the same, but sums on all cores in any order, so that the last bits differ from run to run.
"""
import numpy as np

__all__ = ["vertex_normals"]


def vertex_normals(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Compute the normals at vertices.

    Parameters
    ----------
    vertices : (V, 3) [m]
    faces : (F, 3) int

    Returns
    -------
    (V, 3) float32 [-]
        Unit vectors; 0 where no face with an area is.
    """
    corners = np.ascontiguousarray(vertices.astype(float).T[:, faces.T])                  # axis, corner, face
    share = np.empty((3, len(faces), 3))                                                  # axis, face, corner
    for corner in range(3):
        ahead, back = corners[:, (corner + 1) % 3] - corners[:, corner], corners[:, corner - 1] - corners[:, corner]
        across = [ahead[one] * back[other] - ahead[other] * back[one] for one, other in ((1, 2), (2, 0), (0, 1))]
        twice_area = np.sqrt(across[0] ** 2 + across[1] ** 2 + across[2] ** 2)
        angle = np.arctan2(twice_area, ahead[0] * back[0] + ahead[1] * back[1] + ahead[2] * back[2])
        weight = angle / np.where(twice_area > 0, twice_area, np.inf)
        for axis in range(3):
            share[axis, :, corner] = across[axis] * weight
    total = np.stack([np.bincount(faces.ravel(), one.ravel(), len(vertices)) for one in share], -1)
    length = np.linalg.norm(total, axis=-1, keepdims=True)
    return (total / np.where(length > 0, length, 1)).astype(np.float32)
