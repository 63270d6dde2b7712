"""The manifest is enough: an evaluation written here from it and the EXR files alone gives evaluate()."""

import json
import math
import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import torch

from homofact.brdf.log_transform import LogTransform
from homofact.brdf.wavelengths import spectral_names
from homofact.containers.exr import read_exr
from homofact.errors import BadInput
from homofact.exporting.images import write_textures
from homofact.exporting.manifest import CONVENTIONS, manifest, write_json
from homofact.factor.factorization import Factorization, Term
from homofact.factor.projection import Projection, Warp, fixed_projection
from homofact.factor.spectral_basis import SpectralBasis
from homofact.factor.spectral_fit import SpectralFit
from homofact.geometry.directions import draw_uniform
from homofact.geometry.rotation import Rotation


def terms():
    """Every kind of term: pair with conjugate, single quaternion, fixed, one-dimensional, both warps."""
    generator = torch.Generator().manual_seed(7)
    single = Rotation.random(generator, 3)
    pair = Rotation.random(generator)
    projections = (
        (Projection.from_rotation("in-out", pair, True), (8, 8)),
        (Projection.from_rotation("half-diff", pair.inverse(), True, "cube", Warp(0.1)), (6, 9)),
        (Projection.from_rotation("half-diff", pair, False), (4, 4)),
        (Projection.from_rotation("isotropic-half-diff", single, True, warp=Warp(0.2)), (5, 5)),
        (Projection.from_rotation("isotropic-in-out", single, True), (7, 7)),
        (Projection.from_rotation("isotropic-half-tilt", single, True, warp=Warp(0.2)), (5, 4)),
        (Projection.from_rotation("isotropic-angles", single, True), (6, 5)),
        (fixed_projection("h", True), (8, 8)),
        (fixed_projection("theta_d", True), (1, 8)),
    )
    made = []
    for projection, shape in projections:
        texture = torch.randn(*shape, 3, dtype=torch.float64, generator=generator) * 0.3
        made.append(Term(projection, texture, torch.rand(*shape, generator=generator) < 0.8))
    return tuple(made)


@pytest.fixture
def fitted():
    mean = torch.tensor([0.3, 0.2, 0.1], dtype=torch.float64)
    return Factorization(terms(), LogTransform(0.5, mean), ("R", "G", "B"), {"seed": 11, "method": "by hand"})


def unit(v):
    return v / np.linalg.norm(v)


def value_of(formula, **names):
    """A formula of the manifest, worked out as it is written: a blank between factors multiplies."""
    python = re.sub(r"(?<=[\w)]) (?=[\w(])", "*", formula).replace("w.", "w_")
    space = {"pi": math.pi, "asinh": math.asinh, "exp": np.exp, "max": np.maximum}
    return eval(python, {"__builtins__": {}}, space | names)


def words(pattern, *keys):
    """The formulas that a pattern's groups find in the conventions under `keys`."""
    text: Any = CONVENTIONS
    for key in keys:
        text = text[key]
    found = re.search(pattern, text)
    assert found is not None, text
    return found.groups()


def parabolic(w):
    (formula,) = words(r"^\(u, v\) = (.+)$", "parabolic_map")
    over, under = formula.split(" / ")
    x, y = value_of(over, w_x=w[0], w_y=w[1])
    return np.array([x, y]) / value_of(under, w_z=w[2])


def coordinates(name, wi, wo):
    """The manifest's words for the coordinates, one pair at a time in plain numpy."""
    h = unit(wi + wo)
    if name == "in-out":
        return np.array([*parabolic(wi), *parabolic(wo)])
    if name == "half-diff":
        t = np.array([1.0, 0, 0])
        r = unit(t - (t @ h) * h)
        s = np.cross(h, r)
        d = np.array([r @ wi, s @ wi, h @ wi])
        return np.array([*parabolic(h), *parabolic(d)])
    if name == "isotropic-half-diff":
        across = abs(h[0] * wi[1] - h[1] * wi[0])
        along = abs(wi[2] - (h @ wi) * h[2])
        angles = [math.acos(h[2]), math.acos(min(1.0, h @ wi)), math.atan2(across, along)]
        (formula,) = words(r"^x = (\(.+?\) .+?), in radians", "coordinates", name)
        vector, scale = formula.split(") ")
        found = value_of(vector + ",)", **dict(zip(("theta_h", "theta_d", "phi_d"), angles, strict=True)))
        return value_of("y " + scale, y=np.array(found))
    if name == "isotropic-half-tilt":
        (formula,) = words(r"^x = (\(.+\)), in radians", "coordinates", name)
        lean = "2*" + str(abs(wi[2] - wo[2]))
        angles = {"theta_h": math.acos(h[2]), "theta_d": math.acos(min(1.0, h @ wi))}
        return np.array(value_of(formula.replace("2 |wi.z - wo.z|", lean), **angles))
    if name == "isotropic-angles":
        (formula,) = words(r"^x = (\(.+?\) .+?), in radians", "coordinates", name)
        vector, scale = formula.split(") ")
        angles = {"theta_i": math.acos(wi[2]), "theta_o": math.acos(wo[2]), "theta_d": math.acos(min(1.0, h @ wi))}
        return value_of("y " + scale, y=np.array(value_of(vector + ",)", **angles)))
    assert name == "isotropic-in-out"
    turn = abs(math.atan2(wi[1], wi[0]) - math.atan2(wo[1], wo[0]))
    turn = min(turn, 2 * math.pi - turn)
    first, second, scale = words(r"^x = \((.+?), (.+?), .+\) (.+?), in radians", "coordinates", name)
    angles = {"theta_i": math.acos(wi[2]), "theta_o": math.acos(wo[2])}
    found = np.array([value_of(first, **angles), value_of(second, **angles), turn])
    return value_of("y " + scale, y=found)


def warped(name, width, x):
    (formula,) = words(r"r -> (.+?) before", "warp")
    (angle,) = words(r"or (\S+) \(isotropic-half-diff, isotropic-half-tilt, half-angles\)", "warp")

    def stretch(r):
        return value_of(formula, r=r, w=width)

    if name == "half-diff":
        r = np.hypot(x[0], x[1])
        return np.array([*(x[:2] / r * stretch(r)), x[2], x[3]])
    r = value_of(angle, theta_h=(x[0] + 1) * math.pi / 4)
    return np.array([2 * stretch(r) - 1, x[1], x[2]])


def fetch(log_factor, u, v):
    rows, columns = log_factor.shape[:2]
    across, up = words(r"column = (.+?), row = (.+?), clamped", "texels")
    column = min(max(value_of(across, u=u, columns=columns), 0), columns - 1)
    row = min(max(value_of(up, v=v, rows=rows), 0), rows - 1)
    total = np.zeros(log_factor.shape[2])
    for r in range(rows):
        for c in range(columns):
            total += max(0, 1 - abs(row - r)) * max(0, 1 - abs(column - c)) * log_factor[r, c]
    return total


def from_files(folder, wi, wo):
    """f (C,) from the manifest and its images alone."""
    said = json.loads((folder / "manifest.json").read_text(encoding="utf-8"))
    total = np.zeros(len(said["exr_channels"]))
    for texture in said["textures"]:
        planes = read_exr(folder / texture["files"]["exr"])
        log_factor = np.stack([planes[name] for name in said["exr_channels"]], -1).astype(np.float64)
        assert log_factor.shape[:2] == (texture["rows"], texture["columns"])
        projection = texture["projection"]
        x = coordinates(projection["coordinates"], wi, wo)
        if projection["warp"] is not None:
            x = warped(projection["coordinates"], projection["warp"]["width"], x)
        matrices = [projection["matrix"]]
        if projection["conjugate_matrix"] is not None:
            matrices.append(projection["conjugate_matrix"])
        assert len(matrices) == projection["lookups"]
        for matrix in matrices:
            total += fetch(log_factor, *(np.array(matrix) @ x))
    if "basis" in said:
        assert "sum over v of s[v] vectors[v][k] + offset[k]" in said["conventions"]["basis"]
        total = total @ np.array(said["basis"]["vectors"]) + np.array(said["basis"]["offset"])
    (formula,) = words(r"^f = (.+), p interpolated bilinearly$", "evaluation")
    formula = formula.replace("sum over all lookups of p(u, v)", "total").replace("A max", "A * max")
    return value_of(formula, A=np.array(said["A"]["values"]), total=total, epsilon=said["epsilon"])


def test_files_alone_reproduce_evaluate(tmp_path, fitted):
    write_json(tmp_path / "manifest.json", manifest(fitted, write_textures(tmp_path, fitted)))
    wi, wo = draw_uniform(40, torch.Generator().manual_seed(2))
    expected = fitted.evaluate(wi, wo).numpy()
    ours = np.stack([from_files(tmp_path, a, b) for a, b in zip(wi.numpy(), wo.numpy(), strict=True)])
    # float32 texels: a relative 6e-8 each, ten lookups.
    np.testing.assert_allclose(ours, expected, rtol=3e-6, atol=1e-7)
    assert (expected > 0).mean() > 0.8
    assert (expected == 0).any(), "the cut at zero is not exercised: change epsilon"


def test_files_alone_reproduce_a_fit_with_a_spectral_basis(tmp_path):
    drawn = np.random.default_rng(3)
    names = spectral_names(range(400, 701, 20))
    bands = len(names)
    made = tuple(replace(term, texture=term.texture[..., :2]) for term in terms())
    basis = SpectralBasis(drawn.normal(size=(2, bands)), drawn.normal(size=bands), drawn.normal(size=(bands, 2)))
    fitted = SpectralFit(made, basis, LogTransform(0.5, drawn.uniform(0.1, 0.3, bands)), names, {"seed": 11})
    write_json(tmp_path / "manifest.json", manifest(fitted, write_textures(tmp_path, fitted)))
    wi, wo = draw_uniform(10, torch.Generator().manual_seed(2))
    ours = np.stack([from_files(tmp_path, a, b) for a, b in zip(wi.numpy(), wo.numpy(), strict=True)])
    assert ours.shape == (10, bands)
    np.testing.assert_allclose(ours, fitted.evaluate(wi, wo).numpy(), rtol=1e-5, atol=1e-7)
    said = json.loads((tmp_path / "manifest.json").read_text(encoding="utf-8"))
    assert said["bytes"] == fitted.nbytes
    assert said["exr_channels"] == ["vector 0", "vector 1"]


def test_quaternions_scale_and_mask(tmp_path, fitted):
    files = [{"exr": f"{j}.exr"} for j in range(len(fitted.terms))]
    said = json.loads(json.dumps(manifest(fitted, files), allow_nan=False))
    pair = said["textures"][0]["projection"]["rotation"]
    rebuilt = Projection.from_rotation(
        "in-out", Rotation.pair(torch.tensor(pair["left"]).double(), torch.tensor(pair["right"]).double()), True
    )
    matrix = np.array(said["textures"][0]["projection"]["matrix"])
    np.testing.assert_allclose(matrix, rebuilt.matrix, atol=1e-6)
    assert pair["left"] == fitted.terms[0].projection.rotation.quaternions[0].tolist()
    assert said["textures"][3]["projection"]["rotation"]["kind"] == "single"
    assert said["textures"][7]["projection"]["rotation"] is None
    assert said["textures"][2]["projection"]["conjugate_matrix"] is None
    scale = np.array(said["textures"][0]["projection"]["scale"])
    rows = matrix / scale[:, None]
    np.testing.assert_allclose(rows @ rows.T, np.eye(2), atol=1e-12)
    for texture, term in zip(said["textures"], fitted.terms, strict=True):
        assert [[c == "1" for c in row] for row in texture["mask"]] == term.mask.tolist()
    assert said["seed"] == 11
    assert said["epsilon"] == 0.5
    assert said["A"] == {"values": [0.3, 0.2, 0.1], "unit": "1/sr", "meaning": said["A"]["meaning"]}
    assert said["fetches"] == fitted.fetches
    assert said["provenance"]["method"] == "by hand"


def test_single_channel_is_called_y(tmp_path):
    one = Factorization(
        (Term(fixed_projection("h", True), torch.zeros(4, 4, 1).double(), torch.ones(4, 4, dtype=torch.bool)),),
        LogTransform(1e-5, torch.ones(1).double()),
        ("G",),
    )
    said = manifest(one, [{}])
    assert (said["channels"], said["exr_channels"]) == (["G"], ["Y"])
    assert said["seed"] is None


def test_bad_input(tmp_path, fitted):
    with pytest.raises(BadInput, match="files of 1 textures, expected 9"):
        manifest(fitted, [{}])
    for bad in ({"x": math.nan}, {"x": torch.ones(1)}):
        with pytest.raises(BadInput, match="not JSON"):
            write_json(tmp_path / "x.json", bad)
    with pytest.raises(BadInput, match="cannot be written"):
        write_json(tmp_path / "none" / "x.json", {})
    assert not list(tmp_path.iterdir())
