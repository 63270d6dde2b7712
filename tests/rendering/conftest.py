"""Materials of Mitsuba that tests load again and again: the mixture of each fit is found once."""

import pickle

import pytest

from homofact.brdf.reflectance import Reflectance
from homofact.shading import mixture_fit
from homofact.shading.lobe_mixture import LobeMixture

_FOUND: dict[tuple[object, ...], LobeMixture] = {}


def found_once(reflectance: Reflectance) -> LobeMixture:
    """`fitted_mixture` of the same fit, as it was found before."""
    key = (pickle.dumps(reflectance), mixture_fit._SCALES, mixture_fit._STEPS)
    if key not in _FOUND:
        _FOUND[key] = mixture_fit.fitted_mixture(reflectance)
    return _FOUND[key]


@pytest.fixture(autouse=True)
def _mixtures(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    if "mitsuba" in request.module.__name__:
        monkeypatch.setattr("homofact.rendering.mitsuba_bsdf.fitted_mixture", found_once)
