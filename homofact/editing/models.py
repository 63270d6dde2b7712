"""Analytic models as editable materials, and any reflectance with curves that start at 1.

The models are those of Ben-Artzi et al. 2006, table 1, and those of `brdf.analytic`. HF and HD, whose curves are first
fitted to the material, are in `factored`.

| model | curves | quotient |
|---|---|---|
| Cook-Torrance (CT) | D over θh, F over θd (eq. 10) | ks G/(π cosθi cosθo) |
| Ashikhmin-Shirley (AS) | α over γα, β over γβ (eq. 15, 16) | F/(8π cosθd max(cosθi, cosθo)) |
| Phong | the lobe over θr | ks |
| Blinn-Phong, Torrance-Sparrow | the lobe over θh | ks |
| Ward | a Gaussian over θh; anisotropic, one over θx and one over θy | ks/√(cosθi cosθo) |
| Lafortune | for each lobe a curve over θr, or θd where it throws light back, starting at 1 | the lobe itself |
| glTF | of terms "base" and "gloss" each over θh and θd, starting at 1 | what the base colour brings, the rest |
| Lambert (LV) | over θi, and over θo as one number per pixel | kd/π |
| any | over any one or two angles, starting at 1 | the reflectance itself |

Each model also has a term LV for its diffuse part.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import torch
from torch import Tensor

from homofact.brdf.analytic.ashikhmin_shirley import AshikhminShirley
from homofact.brdf.analytic.common import Colour, grazing, half_vector, schlick, v_grooves
from homofact.brdf.analytic.cook_torrance import CookTorrance
from homofact.brdf.analytic.lafortune import Lafortune, Lobe
from homofact.brdf.analytic.lambert import Lambert
from homofact.brdf.analytic.metallic_roughness import MetallicRoughness
from homofact.brdf.analytic.phong import BlinnPhong, Phong
from homofact.brdf.analytic.torrance_sparrow import TorranceSparrow
from homofact.brdf.analytic.ward import Ward
from homofact.brdf.reflectance import Reflectance
from homofact.editing import starts
from homofact.editing.curves import flat
from homofact.editing.material import Editable, EditableTerm, Quotient, Sliders, Slot
from homofact.errors import BadInput
from homofact.factor.edited import LETTERS

DIFFUSE, SPECULAR, WHOLE = "diffuse", "specular", "whole"


def cook_torrance(model: CookTorrance, name: str = "Cook-Torrance", bands: tuple[int, int] = (256, 64)) -> Editable:
    """Return CT with the sliders sigma of D, and n and k (one number per channel) of F; the diffuse term is LV."""
    count = len(model.channels)

    def quotient(wi: Tensor, wo: Tensor) -> Tensor:
        ni, no = grazing(wi[..., 2]), grazing(wo[..., 2])
        return (v_grooves(wi, wo) / (math.pi * (ni * no)))[..., None] * model.colour(model.specular, wi)

    index = (model.index,) * count
    width = Sliders({"sigma": model.roughness}, lambda sigma: starts.beckmann(sigma, count), "beckmann")
    indices = Sliders(
        {"n": index, "k": (0.0,) * count},
        lambda n, k: starts.fresnel(_colour(n, count), _colour(k, count)),
        "fresnel",
    )
    slots = (
        Slot("distribution", "theta_h", width.curve(), bands[0], sliders=width),
        Slot("fresnel", "theta_d", indices.curve(), bands[1], sliders=indices),
    )
    return _with_diffuse(model, name, EditableTerm(SPECULAR, quotient, slots))


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

    along = Sliders({"nu": model.nu}, lambda nu: starts.cosine_power(nu, count), "cosine_power_u")
    across = Sliders({"nv": model.nv}, lambda nv: starts.cosine_power(nv, count), "cosine_power_v")
    fade = starts.matte_fade(count)
    diffuse = (Slot("incident", "theta_i", fade), Slot("outgoing", "theta_o", fade))
    specular = (
        Slot("alpha", "gamma_alpha", along.curve(), bands[0], sliders=along),
        Slot("beta", "gamma_beta", across.curve(), bands[1], sliders=across),
    )
    terms = (EditableTerm(DIFFUSE, matte, diffuse), EditableTerm(SPECULAR, quotient, specular))
    return Editable(name, model.channels, terms)


def phong(model: Phong, name: str = "Phong", bands: tuple[int] = (256,)) -> Editable:
    """Phong's lobe over θr, with a slider for its exponent."""
    count = len(model.channels)
    width = Sliders({"exponent": model.exponent}, lambda exponent: starts.phong_lobe(exponent, count), "phong")
    return _one_lobe(model, name, "theta_r", width, bands[0])


def blinn_phong(model: BlinnPhong, name: str = "Blinn-Phong", bands: tuple[int] = (256,)) -> Editable:
    """Blinn's lobe over θh, with a slider for its exponent."""
    count = len(model.channels)
    width = Sliders({"exponent": model.exponent}, lambda exponent: starts.blinn_lobe(exponent, count), "blinn")
    return _one_lobe(model, name, "theta_h", width, bands[0])


def torrance_sparrow(model: TorranceSparrow, name: str = "Torrance-Sparrow", bands: tuple[int] = (256,)) -> Editable:
    """Return the Gaussian over θh, with a slider for its width sigma in radians."""
    count = len(model.channels)
    width = Sliders({"sigma": model.sigma}, lambda sigma: starts.facet_gaussian(sigma, count), "facet_gaussian")
    return _one_lobe(model, name, "theta_h", width, bands[0])


def ward(model: Ward, name: str = "Ward", bands: tuple[int, ...] | None = None) -> Editable:
    """Ward's Gaussian of slopes: over θh with a slider alpha, or, anisotropic, over θx and θy with alpha_x and alpha_y.

    `bands` are one number for an isotropic material, two for another.
    """
    count = len(model.channels)

    def quotient(wi: Tensor, wo: Tensor) -> Tensor:
        cosines = torch.sqrt(grazing(wi[..., 2]) * grazing(wo[..., 2]))
        return model.colour(model.specular, wi) / cosines[..., None]

    if model.isotropic:
        width = Sliders({"alpha": model.alpha_x}, lambda alpha: starts.slope_gaussian(alpha, count), "ward")
        return _one_lobe(model, name, "theta_h", width, bands[0] if bands else 256, quotient)
    along = Sliders({"alpha_x": model.alpha_x}, lambda alpha_x: starts.slope_gaussian(alpha_x, count, 1), "ward_x")
    across = Sliders({"alpha_y": model.alpha_y}, lambda alpha_y: starts.slope_gaussian(alpha_y, count, 1), "ward_y")
    first, second = bands or (128, 128)
    slots = (
        Slot("along", "theta_x", along.curve(), first, sliders=along),
        Slot("across", "theta_y", across.curve(), second, sliders=across),
    )
    return _with_diffuse(model, name, EditableTerm(SPECULAR, quotient, slots))


def lafortune(model: Lafortune, name: str = "Lafortune", bands: tuple[int] = (256,)) -> Editable:
    """Return one term per lobe, "lobe 1" and so on, whose curve starts at 1 and has a slider for narrowing.

    Lobes with Cxy < 0 lie about the mirror direction and have the curve over θr; the others throw light back, and have
    it over θd.
    """
    count = len(model.channels)
    narrowing = Sliders({"sharpening": 0.0}, lambda sharpening: starts.sharpened(sharpening, count), "sharpened")

    def term(number: int, lobe: Lobe) -> EditableTerm:
        alone = Lafortune((0.0,) * count, (lobe,), channels=model.channels)
        over = "theta_r" if sum(lobe.cxy) < 0 else "theta_d"
        slot = Slot("narrowing", over, narrowing.curve(), bands[0], sliders=narrowing)
        return EditableTerm(f"lobe {number}", alone.formula, (slot,))

    return _with_diffuse(model, name, *(term(number, lobe) for number, lobe in enumerate(model.lobes, 1)))


def metallic_roughness(
    model: MetallicRoughness, name: str = "metallic-roughness", bands: tuple[int, int] = (256, 64)
) -> Editable:
    """Return two terms with curves that start at 1: "base", which the base colour multiplies, and "gloss"."""
    count = len(model.channels)
    black = replace(model, base_colour=(0.0,) * count)

    def gloss(wi: Tensor, wo: Tensor) -> Tensor:
        return black.formula(wi, wo)

    def base(wi: Tensor, wo: Tensor) -> Tensor:
        # Linear in the base colour, so that this is what the colour brings; it may round below 0.
        return (model.formula(wi, wo) - gloss(wi, wo)).clamp_min(0)

    slots = (Slot("half", "theta_h", flat(count), bands[0]), Slot("difference", "theta_d", flat(count), bands[1]))
    return Editable(name, model.channels, (EditableTerm("base", base, slots), EditableTerm("gloss", gloss, slots)))


def light_view(model: Lambert, name: str = "Lambert") -> Editable:
    """LV of a diffuse material: curves over θi and θo that start at 1."""
    return _with_diffuse(model, name)


class OwnCurves(NamedTuple):
    """How a model gets its curves: `make` builds them, from `bands` numbers of bands."""

    make: Callable[..., Editable]
    bands: int


_OWN: dict[type, OwnCurves] = {
    CookTorrance: OwnCurves(cook_torrance, 2),
    AshikhminShirley: OwnCurves(ashikhmin_shirley, 2),
    Phong: OwnCurves(phong, 1),
    BlinnPhong: OwnCurves(blinn_phong, 1),
    TorranceSparrow: OwnCurves(torrance_sparrow, 1),
    Lafortune: OwnCurves(lafortune, 1),
    Lambert: OwnCurves(light_view, 0),
    MetallicRoughness: OwnCurves(metallic_roughness, 2),
}


def own_curves(reflectance: Reflectance) -> OwnCurves | None:
    """Return how a reflectance gets the curves of its own model; None where it is none of these models."""
    if isinstance(reflectance, Ward):
        return OwnCurves(ward, 1 if reflectance.isotropic else 2)
    return _OWN.get(type(reflectance))


def from_reflectance(
    reflectance: Reflectance,
    angles: Sequence[str] = ("theta_h", "theta_d"),
    name: str = "material",
    bands: Sequence[int] = (256, 64),
) -> Editable:
    """Make any reflectance editable, as its own quotient with curves over `angles` and θo that start at 1.

    Every fit of homofact can be edited in this way. Raises BadInput for unknown angles and for more than two.
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


def _with_diffuse(model: Any, name: str, *terms: EditableTerm) -> Editable:
    """Return a material of a diffuse term LV, kd/π times curves over θi and θo from 1, and the given terms."""
    diffuse: Colour = model.diffuse
    count = len(diffuse)
    slots = (Slot("incident", "theta_i", flat(count)), Slot("outgoing", "theta_o", flat(count)))
    return Editable(name, model.channels, (EditableTerm(DIFFUSE, _constant(diffuse, 1 / math.pi), slots), *terms))


def _one_lobe(
    model: Any, name: str, over: str, width: Sliders, bands: int, quotient: Quotient | None = None
) -> Editable:
    """Return a material whose lobe is one curve times ks, or times another `quotient`."""
    slot = Slot("lobe", over, width.curve(), bands, sliders=width)
    return _with_diffuse(model, name, EditableTerm(SPECULAR, quotient or _constant(model.specular), (slot,)))


def _constant(colour: Colour, scale: float = 1.0) -> Quotient:
    def quotient(wi: Tensor, wo: Tensor) -> Tensor:
        return (scale * torch.tensor(colour, dtype=wi.dtype)).expand(len(wi), len(colour))

    return quotient


def _colour(value: float | tuple[float, ...], count: int) -> tuple[float, ...]:
    """Return one number per channel; a single number is repeated for all channels."""
    numbers = value if isinstance(value, tuple) else (float(value),) * count
    if len(numbers) != count:
        raise BadInput(where="slider", found=f"{len(numbers)} numbers", expected=f"1 or {count}, one a channel")
    return numbers
