"""Outlines of pictures: vertices that are turned away send nothing, and may not darken what is seen beside them."""

import numpy as np
import pytest

import homofact
from homofact.brdf.analytic import Lambert
from homofact.meshes.shapes import sphere
from homofact.relighting.lobe import facing_shares
from homofact.relighting.picture import picture
from homofact.relighting.relit_mesh import RelitMesh
from homofact.rendering.light import EnvironmentMap
from homofact.scene.cameras import Camera
from homofact.scene.meshes import MeshGroup

EYE = (0.0, 0.8, 3.2)


def test_a_matt_ball_under_a_uniform_sky_has_one_radiance_up_to_its_outline() -> None:
    ball, sky = sphere(16), EnvironmentMap.constant()
    made = homofact.relight(ball, Lambert((0.5, 0.4, 0.3)), light=sky, cube=8, kept=64)
    assert isinstance(made, RelitMesh)
    made.relight(sky)
    colours = made.shade(EYE)
    # Those turned away are black.
    assert (colours == 0).all(1).sum() > 50
    shown, cover = picture([ball], [colours], MeshGroup([ball]).occluder, Camera(EYE, pixels=(96, 72)), sky)
    inside = shown[cover == 1]
    assert len(inside) > 500
    # A ball of few triangles is not quite convex: a vertex sees some of its own faces.
    assert inside.min(0) == pytest.approx(np.median(inside, 0), rel=0.1)
    assert np.median(inside, 0) == pytest.approx([0.5, 0.4, 0.3], rel=0.05)


def test_shares_are_of_the_corners_that_face_the_viewer() -> None:
    shares = np.array([[0.5, 0.3, 0.2], [0.5, 0.5, 0.0], [0.2, 0.2, 0.6]])
    facing = np.array([[True, True, False], [False, False, True], [True, True, True]])
    expected = [[0.625, 0.375, 0.0], [0.5, 0.5, 0.0], [0.2, 0.2, 0.6]]
    assert facing_shares(shares, facing) == pytest.approx(np.array(expected))
