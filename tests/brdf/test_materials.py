"""The catalogue of named materials."""

import pytest
from refusals import refused

from homofact.brdf.analytic import AshikhminShirley, BlinnPhong, CookTorrance, Phong, Ward
from homofact.brdf.materials import MATERIALS, material
from homofact.errors import BadInput


def test_the_promised_names_are_there() -> None:
    promised = {
        "lafortune-blue-paint",
        "lafortune-clay",
        "lafortune-skin",
        "cook-torrance-plastic",
        "ashikhmin-shirley-wang",
        "phong-10",
        "phong-30",
        "blinn-phong-50",
        "ward-brushed",
    }
    assert promised <= set(MATERIALS)
    assert all(name == item.name and len(item.source) > 20 for name, item in MATERIALS.items())


def test_parameters_are_the_published_ones() -> None:
    wang = material("ashikhmin-shirley-wang").model
    assert isinstance(wang, AshikhminShirley)
    assert (wang.diffuse[0], wang.specular[0], wang.nu, wang.nv) == (0.5, 0.75, 10, 100)
    plastic = material("cook-torrance-plastic").model
    assert isinstance(plastic, CookTorrance)
    assert (plastic.roughness, plastic.reflectance) == (0.15, 0.1)
    ten, thirty, blinn = (material(name).model for name in ("phong-10", "phong-30", "blinn-phong-50"))
    assert isinstance(ten, Phong)
    assert isinstance(thirty, Phong)
    assert isinstance(blinn, BlinnPhong)
    assert (ten.exponent, thirty.exponent, blinn.exponent) == (10, 30, 50)
    ward = material("ward-brushed").model
    assert isinstance(ward, Ward)
    assert (ward.alpha_x, ward.alpha_y) == (0.088, 0.13)


def test_unknown_name_names_the_nearest_and_lists_all() -> None:
    with pytest.raises(BadInput) as caught:
        material("lafortune-bluepaint")
    message = str(caught.value)
    assert "nearest: lafortune-blue-paint" in message
    assert all(name in message for name in MATERIALS)
    assert "\n" not in message


def test_a_name_like_none_still_lists_all() -> None:
    with refused(where="material", found="'zzz'"):
        material("zzz")
