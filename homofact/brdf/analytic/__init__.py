"""Analytic BRDF models: one published family per file, each a `Reflectance` with the parameters of its paper.

A model is imported at its first use, because most models need torch and `homofact.runtime` works without it.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
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
_HOMES = {
    "AnalyticModel": "common",
    "AshikhminShirley": "ashikhmin_shirley",
    "BlinnPhong": "phong",
    "CookTorrance": "cook_torrance",
    "Lafortune": "lafortune",
    "Lambert": "lambert",
    "Lobe": "lafortune",
    "Phong": "phong",
    "TorranceSparrow": "torrance_sparrow",
    "Ward": "ward",
}


def __getattr__(name: str) -> Any:
    if name in _HOMES:
        return getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
