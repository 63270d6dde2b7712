"""When a relit picture is noted as visibly wrong."""

import pytest

from homofact.relighting.error_notes import error_notes
from homofact.relighting.errors import RelightErrors


def found(psnr: float | None, rim: float | None) -> RelightErrors:
    errors = {"picture": 0.03} if rim is None else {"picture": 0.03, "rim": rim}
    return RelightErrors(errors, 0.0, 64, psnr)


@pytest.mark.parametrize(
    ("psnr", "rim", "noted"),
    [(29.9, 0.1, True), (40, 0.21, True), (46, 0.5, False), (30.1, 0.19, False), (None, None, False)],
)
def test_a_picture_is_noted_by_its_psnr_and_its_rim(psnr: float | None, rim: float | None, noted: bool) -> None:
    assert bool(error_notes("ball", found(psnr, rim), False)) is noted


def test_a_note_has_the_figures_that_are_poor_and_the_lobe_where_it_is_not_separate() -> None:
    (line,) = error_notes("ball", found(19.7, 0.1), False)
    assert line.startswith("ball: ")
    assert "19.7" in line
    assert "rim" not in line
    assert 'lobe = "separate"' in line
    (line,) = error_notes("ball", found(19.7, 0.5), True)
    assert "50%" in line
    assert "separate" not in line


@pytest.mark.parametrize(("bounce", "most"), [(0.029, True), (0.01, False)])
def test_a_note_does_not_advise_coefficients_against_the_error_of_a_bounce(bounce: float, most: bool) -> None:
    poor = RelightErrors({"picture": 0.03, "rim": 0.5, "bounce": bounce}, 0.0, 64, 28.0)
    for separate in (False, True):
        (line,) = error_notes("ball", poor, separate)
        assert ("light between surfaces" in line) is most


def test_an_object_without_a_pixel_is_noted_by_its_vertices() -> None:
    (line,) = error_notes("wire", RelightErrors({"bounce": 0.3, "together": 0.4, "rim": 0.5}, 0.0, 3), True)
    assert "light between surfaces" in line
    assert error_notes("wire", RelightErrors({"rim": 0.5}, 0.0, 3), True)


def test_an_object_that_is_not_seen_has_no_note() -> None:
    assert error_notes("ball", None, False) == ()
