"""The table by which a person checks a shader: what it holds, and that it is of the stored texels."""

import ctypes
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from shading_cases import CASES, factorization

from homofact.brdf.materials import MATERIALS
from homofact.containers.formats import format_named
from homofact.exporting.check_table import CHECK, check_pairs, check_table
from homofact.exporting.exported import exported, write_exported
from homofact.exporting.exported_reader import open_exported
from homofact.factor.projection import fixed_projection


def rows_of(text: str) -> tuple[list[str], np.ndarray]:
    head, *lines = text.splitlines()
    return head.split(","), np.array([[float(word) for word in line.split(",")] for line in lines])


@pytest.mark.parametrize("name", ["exr", "png8"])
def test_the_values_are_those_of_the_stored_texels(name: str, tmp_path: Path) -> None:
    fitted = factorization(fixed_projection("theta_h-theta_d", True))
    made = exported(fitted, format_named(name))
    write_exported(tmp_path / "out", made, {})
    names, rows = rows_of((tmp_path / "out" / CHECK).read_text())
    assert names == ["wi_x", "wi_y", "wi_z", "wo_x", "wo_y", "wo_z", *(f"f_{c}" for c in fitted.channels)]
    wi, wo = (torch.from_numpy(w / np.linalg.norm(w, axis=1, keepdims=True)) for w in (rows[:, :3], rows[:, 3:6]))
    assert np.allclose(rows[:, 6:], open_exported(tmp_path / "out").evaluate(wi, wo).double(), rtol=1e-7)
    # Rounded texels are not those of the fit: the table is of what is stored.
    exact = fitted.evaluate(wi, wo).double().numpy()
    assert (np.abs(rows[:, 6:] / exact - 1).max() > 1e-3) == (name == "png8")


def test_the_pairs_cover_random_mirrored_and_grazing_directions() -> None:
    wi, wo = check_pairs()
    assert wi.shape == wo.shape == (72, 3)
    for w in (wi, wo):
        assert w.norm(dim=1) == pytest.approx(torch.ones(72), abs=2e-6)
        assert (w[:, 2] > 0).all()
    half = (wi + wo) / (wi + wo).norm(dim=1, keepdim=True)
    theta_h = torch.rad2deg(torch.acos(half[:, 2].clamp(-1, 1)))
    assert theta_h[24:48].max() < 4.1
    assert theta_h[:24].median() > 10
    theta_i = torch.rad2deg(torch.acos(wi[48:, 2]))
    assert theta_i.min() > 74.9
    assert theta_i.max() < 85.1
    assert all(torch.equal(one, other) for one, other in zip(check_pairs(), (wi, wo), strict=True))


def test_another_texture_changes_the_table() -> None:
    fitted = factorization(fixed_projection("theta_h-theta_d", True))
    other = replace(fitted, terms=tuple(replace(t, texture=t.texture + 0.01) for t in fitted.terms))
    assert check_table(fitted) != check_table(other)


def test_a_model_has_a_table_too() -> None:
    names, rows = rows_of(check_table(MATERIALS["phong-10"].model))
    assert len(rows) == 72
    assert names[6] == f"f_{MATERIALS['phong-10'].model.channels[0]}"
    assert (rows[:, 6:] >= 0).all()


def test_the_c_code_of_an_export_gives_the_values_of_its_table(tmp_path: Path) -> None:
    compiler = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
    if compiler is None:
        pytest.skip("no C compiler (cc, gcc or clang) on the PATH")
    for number, fitted in enumerate(
        (factorization(fixed_projection("theta_h-theta_d", True)), CASES["five of all kinds"])
    ):
        write_exported(tmp_path / str(number), exported(fitted, format_named("exr")), {})
        names, rows = rows_of((tmp_path / str(number) / CHECK).read_text())
        source = tmp_path / f"{number}.c"
        source.write_text(
            f'#include "{number}/brdf.c"\nvoid every(int n, const float *wi, const float *wo, float *f) {{\n'
            f"for (int k = 0; k < n; ++k) homofact_evaluate(wi + 3 * k, wo + 3 * k, f + {len(names) - 6} * k);\n}}\n"
        )
        library = tmp_path / f"{number}.so"
        subprocess.run([compiler, "-O2", "-shared", "-fPIC", str(source), "-o", str(library), "-lm"], check=True)
        given = [
            np.ascontiguousarray(w / np.linalg.norm(w, axis=1, keepdims=True), np.float32)
            for w in (rows[:, :3], rows[:, 3:6])
        ]
        found = np.zeros((len(rows), len(names) - 6), np.float32)
        pointers = [each.ctypes.data_as(ctypes.c_void_p) for each in (*given, found)]
        ctypes.CDLL(str(library)).every(len(rows), *pointers)
        assert np.abs(found / rows[:, 6:] - 1).max() < 1e-4
