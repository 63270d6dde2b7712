"""Compute the rows of a rotation from its quaternions, and the derivative, in plain NumPy.

Row k of a projection is R eₖ. A product of quaternions is linear in each factor: ab = L(a) b = M(b) a with 4 × 4
matrices L and M. Let gₖ be the derivative of the objective by row k. Then

    R eₖ = l eₖ r:      ∂/∂l = Σk M(eₖ r)ᵀ gₖ,      ∂/∂r = Σk L(l eₖ)ᵀ gₖ,

and for a single quaternion, r is its conjugate. The given quaternions may have any length. They are normalised, which
removes the component of the derivative along the quaternion. The search needs this derivative after every solve;
automatic differentiation of a few dozen numbers took longer than the solve itself.
"""

from collections.abc import Callable

import numpy as np

_CONJUGATE = np.array([1.0, -1.0, -1.0, -1.0])
_BASIS = np.eye(4)


def rows_with_slope(numbers: np.ndarray) -> tuple[np.ndarray, Callable[[np.ndarray], np.ndarray]]:
    """Return (the first two rows (2, k) of the rotation of 8 or 4 numbers, the function that maps derivatives)."""
    quaternions = numbers.reshape(-1, 4)
    lengths = np.sqrt((quaternions**2).sum(1, keepdims=True))
    unit = quaternions / lengths
    pair = len(unit) == 2
    left, right = unit[0], unit[1] if pair else unit[0] * _CONJUGATE
    first = 0 if pair else 1
    turned = [_left(left) @ _BASIS[first + k] for k in range(2)]
    rows = np.stack([_left(one) @ right for one in turned])

    def pulled_back(slopes: np.ndarray) -> np.ndarray:
        whole = slopes if pair else np.concatenate((np.zeros((2, 1)), slopes), 1)
        by_left = sum(_right(_left(_BASIS[first + k]) @ right).T @ whole[k] for k in range(2))
        by_right = sum(_left(turned[k]).T @ whole[k] for k in range(2))
        by_unit = np.stack((by_left, by_right)) if pair else (by_left + by_right * _CONJUGATE)[None]
        along = (by_unit * unit).sum(1, keepdims=True)
        return ((by_unit - along * unit) / lengths).reshape(-1)

    return rows[:, first:], pulled_back


def _left(a: np.ndarray) -> np.ndarray:
    """L(a): the matrix of b ↦ ab."""
    w, x, y, z = a
    return np.array([[w, -x, -y, -z], [x, w, -z, y], [y, z, w, -x], [z, -y, x, w]])


def _right(b: np.ndarray) -> np.ndarray:
    """M(b): the matrix of a ↦ ab."""
    w, x, y, z = b
    return np.array([[w, -x, -y, -z], [x, w, z, -y], [y, -z, w, x], [z, y, -x, w]])
