"""The Haar transform of a cube map's faces, orthonormal, and back.

Each step takes squares of 2 × 2 values a b / c d to (a+b+c+d)/2, (a−b+c−d)/2, (a+b−c−d)/2 and (a−b−c+d)/2; the sums
form the next level's picture. A face of n × n becomes its mean times n at (0, 0) and, of level s = 1, 2, 4 … n/2, the
three blocks of s × s details to the right, below, and both. The scalar product of two maps is that of their transforms:
∫ T L = Σ_j T_j L_j becomes Σ over the few coefficients that are kept (Ng, Ramamoorthi and Hanrahan 2003).
"""

import numpy as np

from homofact.linear.kernels import kernel


def transformed(maps: np.ndarray) -> np.ndarray:
    """Coefficients, as `maps` (..., n, n), n a power of two."""
    found = np.array(maps, np.float64)
    size = found.shape[-1]
    while size > 1:
        part = found[..., :size, :size]
        a, b = part[..., ::2, ::2].copy(), part[..., ::2, 1::2].copy()
        c, d = part[..., 1::2, ::2].copy(), part[..., 1::2, 1::2].copy()
        half = size // 2
        part[..., :half, :half], part[..., :half, half:] = (a + b + c + d) / 2, (a - b + c - d) / 2
        part[..., half:, :half], part[..., half:, half:] = (a + b - c - d) / 2, (a - b - c + d) / 2
        size = half
    return found


@kernel(nogil=True, fastmath=True)
def transform_faces(faces: np.ndarray, scratch: np.ndarray) -> None:
    """`transformed` of float32 faces (F, n, n) in place; `scratch` (n, n) float32. Faces of zeros are passed over."""
    count, size = faces.shape[0], faces.shape[1]
    for f in range(count):
        lit = False
        for i in range(size):
            for j in range(size):
                if faces[f, i, j] != 0:
                    lit = True
                    break
            if lit:
                break
        if not lit:
            continue
        face = faces[f]
        n = size
        while n > 1:
            half = n // 2
            for i in range(half):
                for j in range(half):
                    a, b = face[2 * i, 2 * j], face[2 * i, 2 * j + 1]
                    c, d = face[2 * i + 1, 2 * j], face[2 * i + 1, 2 * j + 1]
                    p, q, r, s = a + b, a - b, c + d, c - d
                    scratch[i, j] = (p + r) * np.float32(0.5)
                    scratch[i, half + j] = (q + s) * np.float32(0.5)
                    scratch[half + i, j] = (p - r) * np.float32(0.5)
                    scratch[half + i, half + j] = (q - s) * np.float32(0.5)
            for i in range(n):
                for j in range(n):
                    face[i, j] = scratch[i, j]
            n = half
