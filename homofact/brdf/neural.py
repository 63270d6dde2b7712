"""A small network as a BRDF (Sztrajman, Rainer, Ritschel and Weyrich 2021, section 3): 6 → 21 → 21 → 3.

f = max(0, exp(W2 relu(W1 relu(W0 x + b0) + b1) + b2) − 1), one value per colour channel, in sr⁻¹. The input x is (h, d)
after both directions are rotated about the normal until h lies in the xz-plane: h = (sin θh, 0, cos θh), and d is ωi in
the frame of h, (e·ωi, s·ωi, h·ωi), where e is the direction in which θh grows and s = n × e. Swapping ωi and ωo changes
(dx, dy) to (−dx, −dy). φd is therefore taken modulo π, as in the MERL tables on which the networks were trained, so the
value is exactly reciprocal. At h = n the azimuth is undefined, and φd is set to 0.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from homofact.brdf.analytic.common import AnalyticModel
from homofact.errors import BadInput
from homofact.geometry.namespace import like, namespace, normalized

if TYPE_CHECKING:
    from torch import Tensor

LAYERS = ((6, 21), (21, 21), (21, 3))
# Rounding leaves dy of either sign for configurations in one plane, and φd = 0 and π would be told apart by it. By the
# bytes of a number.
_IN_PLANE = {8: 1e-12, 4: 1e-6}


@dataclass(frozen=True)
class NeuralBrdf(AnalyticModel):
    """The network that the module describes, isotropic and reciprocal, evaluated in the dtype of the directions.

    `weights` are three matrices (inputs, outputs) and `biases` three vectors, of the sizes of `LAYERS`. Raises BadInput
    for other sizes and for numbers that are not finite.
    """

    weights: "tuple[Tensor | np.ndarray, ...]"
    biases: "tuple[Tensor | np.ndarray, ...]"

    def __post_init__(self) -> None:
        """Refuse other sizes and numbers that are not finite."""
        for k, (weight, bias, shape) in enumerate(zip(self.weights, self.biases, LAYERS, strict=True)):
            for name, tensor, expected in ((f"w{k}", weight, shape), (f"b{k}", bias, shape[1:])):
                if tuple(tensor.shape) != expected:
                    raise BadInput(f"{name} has shape {tuple(tensor.shape)}", where="network", expected=expected)
                if not bool(namespace(tensor).isfinite(tensor).all()):
                    raise BadInput(f"{name} is not finite", where="network", expected="finite numbers")

    @property
    def nbytes(self) -> int:
        """2700: 675 numbers as float32."""
        return 4 * sum(int(np.prod(tensor.shape)) for tensor in (*self.weights, *self.biases))

    def formula(self, wi: "Tensor", wo: "Tensor") -> "Tensor":
        """Return the network at the pair's (h, d)."""
        layers = [(like(w, wi), like(b, wi)) for w, b in zip(self.weights, self.biases, strict=True)]
        x, library = network_input(wi, wo), namespace(wi)
        for weight, bias in layers[:-1]:
            x = library.clip(x @ weight + bias, 0, None)
        weight, bias = layers[-1]
        return library.clip(library.expm1(x @ weight + bias), 0, None)


def network_input(wi: "Tensor", wo: "Tensor") -> "Tensor":
    """Return (hx, 0, hz, dx, dy, dz) of the module's head, (N, 6), φd in [0, π)."""
    library, h = namespace(wi), normalized(wi + wo)
    tolerance = _IN_PLANE.get(wi.dtype.itemsize, 1e-3)
    sin_h = library.hypot(h[:, 0], h[:, 1])
    on_axis = sin_h <= tolerance
    safe = library.where(on_axis, like(1.0, sin_h), sin_h)
    cos_phi, sin_phi = h[:, 0] / safe, h[:, 1] / safe
    across = wi[:, 1] * cos_phi - wi[:, 0] * sin_phi
    along = (wi[:, 0] * cos_phi + wi[:, 1] * sin_phi) * h[:, 2] - wi[:, 2] * sin_h
    turned = (across < -tolerance) | ((abs(across) <= tolerance) & (along < 0))
    sign = library.where(turned, like(-1.0, wi), like(1.0, wi))
    along, across = sign * along, sign * across
    along = library.where(on_axis, library.hypot(wi[:, 0], wi[:, 1]), along)
    across = library.where(on_axis, like(0.0, wi), across)
    return library.stack((sin_h, library.zeros_like(sin_h), h[:, 2], along, across, (wi * h).sum(-1)), -1)
