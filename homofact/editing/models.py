"""The paper's models as editable materials (table 1): CT, AS, LV, and any reflectance with curves that start at 1.

HF and HD, whose curves are found from the material first, are in `factored`.

| model | curves | quotient |
|---|---|---|
| CT | D over θh, F over θd (eq. 10) | ks G/(π cosθi cosθo), and kd/π as a term LV |
| AS | α over γα, β over γβ (eq. 15, 16) | F/(8π cosθd max(cosθi, cosθo)), and the matte term as LV |
| LV | over θi, and over θo as a number a pixel | kd/π |
| any | over any one or two angles, starting at 1 | the reflectance itself |
"""

import math
from collections.abc import Sequence

import torch
from torch import Tensor

from homofact.brdf.analytic.ashikhmin_shirley import AshikhminShirley
from homofact.brdf.analytic.common import Colour, grazing, half_vector, schlick, v_grooves
from homofact.brdf.analytic.cook_torrance import CookTorrance
from homofact.brdf.analytic.lambert import Lambert
from homofact.brdf.reflectance import Reflectance
from homofact.editing.angles import LETTERS
from homofact.editing.curves import flat
from homofact.editing.material import Editable, EditableTerm, Sliders, Slot
from homofact.editing.starts import beckmann, cosine_power, fresnel, matte_fade
from homofact.errors import BadInput

DIFFUSE, SPECULAR, WHOLE = "diffuse", "specular", "whole"


def cook_torrance(model: CookTorrance, name: str = "Cook-Torrance", bands: tuple[int, int] = (256, 64)) -> Editable:
    """CT: sliders sigma of D, n and k (one number a channel) of F; the diffuse term as LV."""
    count = len(model.channels)

    def quotient(wi: Tensor, wo: Tensor) -> Tensor:
        ni, no = grazing(wi[..., 2]), grazing(wo[..., 2])
        return (v_grooves(wi, wo) / (math.pi * (ni * no)))[..., None] * model.colour(model.specular, wi)

    index = (model.index,) * count
    width = Sliders({"sigma": model.roughness}, lambda sigma: beckmann(sigma, count))
    indices = Sliders({"n": index, "k": (0.0,) * count}, lambda n, k: fresnel(_colour(n, count), _colour(k, count)))
    slots = (
        Slot("distribution", "theta_h", width.curve(), bands[0], sliders=width),
        Slot("fresnel", "theta_d", indices.curve(), bands[1], sliders=indices),
    )
    return Editable(name, model.channels, (lambert_term(model.diffuse), EditableTerm(SPECULAR, quotient, slots)))


def ashikhmin_shirley(
    model: AshikhminShirley, name: str = "Ashikhmin-Shirley", bands: tuple[int, int] = (128, 128)
) -> Editable:
    """AS: sliders nu of α and nv of β; the matte term as LV, its two fades the curves."""
    count = len(model.channels)

    def quotient(wi: Tensor, wo: Tensor) -> Tensor:
        _, cosine = half_vector(wi, wo)
        ni, no = grazing(wi[..., 2]), grazing(wo[..., 2])
        scale = 1 / (8 * math.pi * grazing(cosine) * torch.maximum(ni, no))
        return scale[..., None] * schlick(model.colour(model.specular, wi), cosine)

    def matte(wi: Tensor, wo: Tensor) -> Tensor:
        specular = model.colour(model.specular, wi)
        return (28 / (23 * math.pi) * model.colour(model.diffuse, wi) * (1 - specular)).expand(len(wi), -1)

    along = Sliders({"nu": model.nu}, lambda nu: cosine_power(nu, count))
    across = Sliders({"nv": model.nv}, lambda nv: cosine_power(nv, count))
    diffuse = (Slot("incident", "theta_i", matte_fade(count)), Slot("outgoing", "theta_o", matte_fade(count)))
    specular = (
        Slot("alpha", "gamma_alpha", along.curve(), bands[0], sliders=along),
        Slot("beta", "gamma_beta", across.curve(), bands[1], sliders=across),
    )
    terms = (EditableTerm(DIFFUSE, matte, diffuse), EditableTerm(SPECULAR, quotient, specular))
    return Editable(name, model.channels, terms)


def light_view(model: Lambert, name: str = "Lambert") -> Editable:
    """LV of a diffuse material: curves over θi and θo that start at 1."""
    return Editable(name, model.channels, (lambert_term(model.diffuse),))


def lambert_term(diffuse: Colour) -> EditableTerm:
    """kd/π with curves over θi and θo that start at 1."""

    def quotient(wi: Tensor, wo: Tensor) -> Tensor:
        return (torch.tensor(diffuse, dtype=wi.dtype) / math.pi).expand(len(wi), len(diffuse))

    count = len(diffuse)
    slots = (Slot("incident", "theta_i", flat(count)), Slot("outgoing", "theta_o", flat(count)))
    return EditableTerm(DIFFUSE, quotient, slots)


def from_reflectance(
    reflectance: Reflectance,
    angles: Sequence[str] = ("theta_h", "theta_d"),
    name: str = "material",
    bands: Sequence[int] = (256, 64),
) -> Editable:
    """Any reflectance as its own quotient: one or two curves over `angles`, θo beside them, all starting at 1.

    Every fit of homofact can be edited so. Raises BadInput for angles that are none or too many.
    """
    count = len(reflectance.channels)
    if len(bands) < len(angles):
        raise BadInput(where="bands", found=len(bands), expected=f"one number for each of {', '.join(angles)}")
    slots = tuple(Slot(each, each, flat(count), bands[k]) for k, each in enumerate(angles))
    if not slots:
        raise BadInput(where="angles", found="none", expected=f"some of {', '.join(LETTERS)}")
    return Editable(name, reflectance.channels, (EditableTerm(WHOLE, quotient_of(reflectance), slots),))


def quotient_of(reflectance: Reflectance):
    """`evaluate` of a reflectance as float64, whatever its own type."""

    def quotient(wi: Tensor, wo: Tensor) -> Tensor:
        return torch.as_tensor(reflectance.evaluate(wi, wo)).to(wi.dtype)

    return quotient


def _colour(value: float | tuple[float, ...], count: int) -> tuple[float, ...]:
    """One number a channel; a single one stands for all."""
    numbers = value if isinstance(value, tuple) else (float(value),) * count
    if len(numbers) != count:
        raise BadInput(where="slider", found=f"{len(numbers)} numbers", expected=f"1 or {count}, one a channel")
    return numbers
