"""Area vectors of rings in space, and the volume that they enclose. Compiled.

Faces are flattened: ring r has vertices `index[ring_start[r]:ring_start[r + 1]]`, face f the rings
`face_start[f]:face_start[f + 1]`, the outer one first.
"""

from __future__ import annotations

import numpy as np

from ..compiled import compiled


@compiled
def dot(a, b):
    """Return the inner product of two vectors (3,); `@` would load BLAS for it."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@compiled
def cross(a, b):
    """Return the vector product (3,) of two vectors (3,).

    Numba's own takes a second to compile.
    """
    result = np.empty(3)
    for k in range(3):
        i, j = (k + 1) % 3, (k + 2) % 3
        result[k] = a[i] * b[j] - a[j] * b[i]
    return result


@compiled
def newell(vertices, index, lower, upper):
    """Return the area vector (3,) of the ring index[lower:upper].

    Half its length is the area, and its direction is the normal.
    """
    total = np.zeros(3)
    origin = vertices[index[lower]]
    for k in range(lower, upper):
        p = vertices[index[k]] - origin
        q = vertices[index[k + 1 if k + 1 < upper else lower]] - origin
        total[0] += p[1] * q[2] - p[2] * q[1]
        total[1] += p[2] * q[0] - p[0] * q[2]
        total[2] += p[0] * q[1] - p[1] * q[0]
    return 0.5 * total


@compiled
def enclosed_volume(vertices, index, ring_start, face_start):
    """Return the volume of a shell by the divergence theorem.

    It is positive when the faces point outwards.
    """
    total = 0.0
    for f in range(len(face_start) - 1):
        anchor = vertices[index[ring_start[face_start[f]]]]
        for r in range(face_start[f], face_start[f + 1]):
            total += dot(anchor, newell(vertices, index, ring_start[r], ring_start[r + 1]))
    return total / 3.0
