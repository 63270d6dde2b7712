"""Analytic BRDF models, one published family a file; each is a `Reflectance` with its paper's parameters."""

from homofact.brdf.analytic.ashikhmin_shirley import AshikhminShirley
from homofact.brdf.analytic.common import AnalyticModel
from homofact.brdf.analytic.cook_torrance import CookTorrance
from homofact.brdf.analytic.lafortune import Lafortune, Lobe
from homofact.brdf.analytic.lambert import Lambert
from homofact.brdf.analytic.phong import BlinnPhong, Phong
from homofact.brdf.analytic.torrance_sparrow import TorranceSparrow
from homofact.brdf.analytic.ward import Ward

__all__ = [
    "AnalyticModel",
    "AshikhminShirley",
    "BlinnPhong",
    "CookTorrance",
    "Lafortune",
    "Lambert",
    "Lobe",
    "Phong",
    "TorranceSparrow",
    "Ward",
]
