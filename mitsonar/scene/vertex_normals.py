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
    corners = vertices.astype(float)[faces]                                                     # (F, 3, 3)
    ahead, back = (np.roll(corners, turn, axis=1) - corners for turn in (-1, 1))
    across = np.cross(ahead, back)
    twice_area = np.linalg.norm(across, axis=-1)
    angle = np.arctan2(twice_area, np.einsum("fck,fck->fc", ahead, back))
    share = across * (angle / np.where(twice_area > 0, twice_area, np.inf))[..., None]
    total = np.stack([np.bincount(faces.ravel(), share[..., axis].ravel(), len(vertices)) for axis in range(3)], -1)
    length = np.linalg.norm(total, axis=-1, keepdims=True)
    return (total / np.where(length > 0, length, 1)).astype(np.float32)
