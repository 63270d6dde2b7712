"""Named materials: the analytic models with the parameters that the literature printed.

If the literature gives one number for a monochrome material, or none, we chose the colour; `source` then notes this.
"""

from dataclasses import dataclass
from difflib import get_close_matches

from homofact.brdf.analytic import (
    AnalyticModel,
    AshikhminShirley,
    BlinnPhong,
    CookTorrance,
    Lafortune,
    Lobe,
    Phong,
    TorranceSparrow,
    Ward,
)
from homofact.brdf.analytic.metallic_roughness import MetallicRoughness
from homofact.errors import BadInput


@dataclass(frozen=True)
class NamedMaterial:
    """A model under a name; `source` says where its numbers are from and which of them we chose."""

    name: str
    model: AnalyticModel
    source: str


def _grey(value: float) -> tuple[float, float, float]:
    return (value, value, value)


_LAFORTUNE = "Lafortune et al. 1997: three lobes fitted to a measurement, coefficients for R, G and B"

_MATERIALS = (
    NamedMaterial(
        "lafortune-blue-paint",
        Lafortune(
            (0.3094, 0.39667, 0.70837),
            (
                Lobe(
                    (0.870567, 0.857255, 0.670982),
                    (0.803624, 0.774290, 0.586674),
                    (21.820103, 18.597755, 7.472717),
                ),
                Lobe(
                    (-0.451218, -0.406681, -0.477976),
                    (0.023123, 0.017625, 0.227295),
                    (2.774499, 2.581499, 3.677653),
                ),
                Lobe(
                    (-1.031545, -1.029426, -1.026588),
                    (0.706734, 0.696530, 0.687715),
                    (66.899060, 63.767912, 57.489181),
                ),
            ),
        ),
        _LAFORTUNE,
    ),
    NamedMaterial(
        "lafortune-clay",
        Lafortune(
            (0.383626, 0.260749, 0.274207),
            (
                Lobe(
                    (-1.089701, -1.102701, -1.107603),
                    (-1.354682, -2.714801, -1.569866),
                    (17.968505, 11.024489, 21.270282),
                ),
                Lobe(
                    (-0.733381, -0.793320, -0.848206),
                    (0.676108, 0.679314, 0.726031),
                    (8.219745, 9.055139, 11.261951),
                ),
                Lobe(
                    (-1.010548, -1.012378, -1.011263),
                    (0.910783, 0.885239, 0.892451),
                    (152.912795, 141.937171, 201.046802),
                ),
            ),
        ),
        _LAFORTUNE,
    ),
    NamedMaterial(
        "lafortune-skin",
        Lafortune(
            (0.428425, 0.301341, 0.331054),
            (
                Lobe(
                    (-1.131747, -1.016939, -0.966018),
                    (-1.209182, -1.462488, -1.222419),
                    (6.421658, 3.699932, 3.524889),
                ),
                Lobe(
                    (-0.546570, -0.643533, -0.638934),
                    (0.380123, 0.410559, 0.437367),
                    (3.685044, 4.266495, 4.539742),
                ),
                Lobe(
                    (-0.998888, -1.020153, -1.027479),
                    (0.857998, 0.703913, 0.573625),
                    (64.208486, 63.919687, 43.809866),
                ),
            ),
        ),
        _LAFORTUNE,
    ),
    NamedMaterial(
        "cook-torrance-plastic",
        CookTorrance(tuple(0.9 * x for x in (0.45, 0.22, 0.13)), _grey(1.0), roughness=0.15, reflectance=0.1),
        "Cook and Torrance 1982, plastic: specular .1, diffuse .9, m .15. The .1 is taken as the Fresnel"
        " reflectance at normal incidence, since times a plastic's own .04 the highlight would vanish; the"
        " diffuse colour (.45, .22, .13), a copper-coloured pigment, is our choice",
    ),
    NamedMaterial(
        "ashikhmin-shirley-wang",
        AshikhminShirley(_grey(0.5), _grey(0.75), nu=10, nv=100),
        "Wang, Tran and Luebke 2004: kd .5, ks .75, nu 10, nv 100; the same in R, G and B",
    ),
    NamedMaterial(
        "phong-10",
        Phong((0.40, 0.20, 0.10), _grey(0.4), exponent=10),
        "Mahajan et al. 2008: exponent 10; the weights and the diffuse colour are our choice",
    ),
    NamedMaterial(
        "phong-30",
        Phong((0.10, 0.20, 0.40), _grey(0.4), exponent=30),
        "Mahajan et al. 2008: exponent 30; the weights and the diffuse colour are our choice",
    ),
    NamedMaterial(
        "blinn-phong-50",
        BlinnPhong((0.15, 0.35, 0.15), _grey(0.4), exponent=50),
        "Blinn 1977 with exponent 50; the weights and the diffuse colour are our choice",
    ),
    NamedMaterial(
        "torrance-sparrow-20",
        TorranceSparrow((0.30, 0.20, 0.10), _grey(0.4), sigma=0.2),
        "Mahajan et al. 2008, eq. 14 with sigma 0.2; the weights and the diffuse colour are our choice",
    ),
    NamedMaterial(
        "ward-brushed",
        Ward(_grey(0.15), _grey(0.19), alpha_x=0.088, alpha_y=0.13),
        "Ward 1992, table 1, lightly brushed aluminum: .15, .19, .088, .13; the same in R, G and B",
    ),
    NamedMaterial(
        "car-paint-red",
        MetallicRoughness((0.5, 0.02, 0.02), metallic=0.3, roughness=0.5, clearcoat=1.0, clearcoat_roughness=0.15),
        "glTF's metallic-roughness model with its clear coat: a red base with some metal in it under a glossy coat;"
        " all numbers are our choice",
    ),
)
MATERIALS = {item.name: item for item in _MATERIALS}


def material(name: str) -> NamedMaterial:
    """Return the material called `name`. Raises BadInput naming the nearest one and listing all."""
    if name not in MATERIALS:
        near = get_close_matches(name, MATERIALS, n=1, cutoff=0.4)
        nearest = f" (nearest: {near[0]})" if near else ""
        raise BadInput(where="material", found=f"{name!r}{nearest}", expected=f"one of {', '.join(MATERIALS)}")
    return MATERIALS[name]
