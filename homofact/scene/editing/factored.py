"""HF and HD: a measured material's own curves, found from it, with the rest in the quotient (eq. 17 and 18).

HF, ρ = ρ_q P(θi) Q(θh) P(θo): P and Q are one-dimensional textures of logarithms, solved like all others
(`factor.textures`), P read at both θi and θo.

HD, ρ = ρ_q (G_d(θi) H_d(θo) + G_s(θd) H_s(θh)): four non-negative curves of straight lines between knots, by
multiplicative updates (Lee and Seung 2001) of Σ w (f − m)², each of which lowers it; w = 1/(f + mean f)², so that the
dark parts of a glossy material count too. Both terms have the same quotient f/m.

The quotient makes up for what the curves cannot say, so that unedited either form is the material itself. Curves are
kept above `EPSILON` of their largest value, so that nothing is divided by zero; where the material itself is zero, so is
its quotient, and no edit lights it.
"""

import numpy as np
import torch
from scipy.sparse import csr_matrix
from torch import Tensor

from homofact.brdf.log_transform import LogTransform
from homofact.brdf.reflectance import Reflectance
from homofact.errors import BadInput
from homofact.factor.projection import fixed_projection
from homofact.factor.textures import LogSamples, solve_terms
from homofact.geometry.directions import draw_in_discs, from_half_difference, from_spherical
from homofact.scene.editing.angles import RIGHT_ANGLE, angle
from homofact.scene.editing.curves import Knots, hat
from homofact.scene.editing.material import Editable, Slot, Term
from homofact.scene.editing.models import DIFFUSE, SPECULAR, WHOLE, quotient_of

EPSILON = 1e-6
PAIRS, SEED = 16_000, 0
_KNOTS, _UPDATES = 91, 400
_SMOOTHING, _LOG_EPSILON = 1e-3, 1e-4


def homomorphic(reflectance: Reflectance, name: str = "material", bands: tuple[int, int] = (128, 128)) -> Editable:
    """HF of any reflectance: Q over θh ("half"), P over θi and θo at once ("directions").

    Raises BadInput for a channel that is zero everywhere.
    """
    wi, wo = _pairs()
    values = _values(reflectance, wi, wo)
    transform = LogTransform.of_values(values, _LOG_EPSILON)
    ones = torch.ones(len(wi), dtype=torch.float64)
    samples = LogSamples(wi, wo, transform.forward(values), ones)
    projections = (fixed_projection("theta_h", True), fixed_projection("theta_i", True))
    solved = solve_terms(samples, projections, ((1, _KNOTS),) * 2, _SMOOTHING, "cholesky")
    half, directions = (Knots(term.texture[0], logs=True) for term in solved.terms)
    half = Knots(half.values + torch.log(transform.mean), logs=True)
    whole = quotient_of(reflectance)

    def quotient(wi: Tensor, wo: Tensor) -> Tensor:
        ends = directions.at(angle("theta_i", wi, wo)) * directions.at(angle("theta_o", wi, wo))
        return whole(wi, wo) / (half.at(angle("theta_h", wi, wo)) * ends)

    slots = (
        Slot("half", "theta_h", half, bands[0]),
        Slot("directions", "theta_i", directions, bands[1], also_outgoing=True),
    )
    return Editable(name, reflectance.channels, (Term(WHOLE, quotient, slots),), _zeros(values))


def half_and_diffuse(reflectance: Reflectance, name: str = "material", bands: tuple[int, int] = (256, 32)) -> Editable:
    """HD of any reflectance: a diffuse-like term over θi and θo, a specular-like one over θh and θd.

    Raises BadInput for a channel that is zero everywhere.
    """
    wi, wo = _pairs()
    values = _values(reflectance, wi, wo)
    names = ("theta_i", "theta_o", "theta_d", "theta_h")
    rows = [_hats(angle(each, wi, wo)) for each in names]
    found = np.stack([_factored(values[:, c].numpy(), rows) for c in range(values.shape[1])], -1)
    curves = [Knots(torch.from_numpy(each)) for each in found]

    def model(wi: Tensor, wo: Tensor) -> Tensor:
        at = [curve.at(angle(each, wi, wo)) for curve, each in zip(curves, names, strict=True)]
        return at[0] * at[1] + at[2] * at[3]

    whole = quotient_of(reflectance)

    def quotient(wi: Tensor, wo: Tensor) -> Tensor:
        return whole(wi, wo) / model(wi, wo)

    diffuse = (Slot("incident", "theta_i", curves[0], bands[0]), Slot("outgoing", "theta_o", curves[1], bands[0]))
    specular = (Slot("half", "theta_h", curves[3], bands[0]), Slot("difference", "theta_d", curves[2], bands[1]))
    terms = (Term(DIFFUSE, quotient, diffuse), Term(SPECULAR, quotient, specular))
    return Editable(name, reflectance.channels, terms, _zeros(values))


def _factored(values: np.ndarray, rows: list[csr_matrix]) -> np.ndarray:
    """The knots (4, M) of G_d, H_d, G_s, H_s for values (N,), each above `EPSILON` of its largest."""
    mean = float(values.mean())
    weights = 1 / (values + mean) ** 2
    knots = np.ones((4, _KNOTS)) * np.sqrt(mean / 2)
    # A first guess that falls, so that the specular-like term takes the highlight.
    knots[3] *= np.exp(-np.linspace(0, 4, _KNOTS))
    partner = (1, 0, 3, 2)
    at = [row @ knot for row, knot in zip(rows, knots, strict=True)]
    for _ in range(_UPDATES):
        for k in range(4):
            model = at[0] * at[1] + at[2] * at[3]
            other = weights * at[partner[k]]
            wanted, have = rows[k].T @ (other * values), rows[k].T @ (other * model)
            # A knot that no pair reads has nothing on either side.
            knots[k] *= np.where(have > 0, wanted / np.maximum(have, 1e-300), 1.0)
            at[k] = rows[k] @ knots[k]
    return np.maximum(knots, EPSILON * knots.max(1, keepdims=True))


def _hats(gamma: Tensor) -> csr_matrix:
    """Weights (N, M) of the knots at angles (N,)."""
    number, share = hat(gamma, _KNOTS)
    rows = np.arange(len(gamma)).repeat(2)
    columns = torch.stack((number, number + 1), 1).reshape(-1).numpy()
    values = torch.stack((1 - share, share), 1).reshape(-1).numpy()
    return csr_matrix((values, (rows, columns)), shape=(len(gamma), _KNOTS))


def _pairs() -> tuple[Tensor, Tensor]:
    """Pairs to find curves from: half over the discs, half towards small θh, where highlights are."""
    generator = torch.Generator().manual_seed(SEED)
    everywhere = draw_in_discs(PAIRS // 2, generator)
    u = torch.rand(PAIRS, 4, dtype=torch.float64, generator=generator)
    h = from_spherical(RIGHT_ANGLE * u[:, 0] ** 3, 4 * RIGHT_ANGLE * u[:, 1])
    d = from_spherical(RIGHT_ANGLE * u[:, 2], 4 * RIGHT_ANGLE * u[:, 3])
    wi, wo = from_half_difference(h, d)
    above = ((wi[:, 2] > 0) & (wo[:, 2] > 0)).nonzero()[: PAIRS // 2, 0]
    return torch.cat((everywhere[0], wi[above])), torch.cat((everywhere[1], wo[above]))


def _values(reflectance: Reflectance, wi: Tensor, wo: Tensor) -> Tensor:
    values = torch.as_tensor(reflectance.evaluate(wi, wo)).to(torch.float64)
    for channel, name in enumerate(reflectance.channels):
        if not bool((values[:, channel] > 0).any()):
            raise BadInput(f"reflectance: channel {name} is zero everywhere, expected some reflectance")
    return values


def _zeros(values: Tensor) -> tuple[str, ...]:
    """A note where the material is zero: nothing times anything stays nothing."""
    share = float((values <= 0).to(torch.float64).mean())
    if share == 0:
        return ()
    return (f"the material is zero at {share:.1%} of the directions looked at: no curve lights it there",)
