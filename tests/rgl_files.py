"""Tensor files for tests: a writer of our own, and small tables whose values are known."""

import struct
from pathlib import Path
from typing import Any

import numpy as np

MAGIC = b"tensor_file\0\1\0"
CODES = dict(u1=1, i1=2, u2=3, i2=4, u4=5, i4=6, u8=7, i8=8, f2=9, f4=10, f8=11)
# Degrees of the slices; as in the published files they end at the horizon.
THETA = np.radians([0, 30, 60, 90]).astype("f4")


def write_tensors(path: Path, fields: dict[str, Any]) -> Path:
    """A tensor file of arrays, each at a multiple of 8 bytes."""
    arrays = {name: np.asarray(array) for name, array in fields.items()}
    header = sum(2 + len(name.encode()) + 11 + 8 * array.ndim for name, array in arrays.items())
    place = len(MAGIC) + 4 + header
    head, body = struct.pack("<I", len(arrays)), b""
    for name, array in arrays.items():
        pad = -(place + len(body)) % 8
        body += bytes(pad)
        head += struct.pack("<H", len(name.encode())) + name.encode()
        head += struct.pack("<HBQ", array.ndim, CODES[array.dtype.str[1:]], place + len(body))
        head += struct.pack(f"<{array.ndim}Q", *array.shape)
        body += array.tobytes()
    path.write_bytes(MAGIC + head + body)
    return path


def constant(value: float = 0.25, size: int = 5, **fields: Any) -> dict[str, np.ndarray]:
    """M = value throughout, D = 2, σ = 1, visible normals uniform in the square: f = value/(2 cosθo)."""
    return {
        "theta_i": THETA,
        "phi_i": np.zeros(1, "f4"),
        "ndf": np.full((2, 4), 2, "f4"),
        "sigma": np.ones((2, 4), "f4"),
        "vndf": np.ones((1, 4, size, size), "f4"),
        "luminance": np.ones((1, 4, size, size), "f4"),
        "rgb": np.full((1, 4, 3, size, size), value, "f4"),
        "jacobian": np.ones(1, "u1"),
        "description": np.frombuffer(b"a made-up surface", "u1"),
    } | fields


def rough(phi_degrees: tuple[float, ...], seed: int = 0, wavelengths: int = 0) -> dict[str, np.ndarray]:
    """Random positive tables of several sizes with slices at `phi_degrees`, spectral where `wavelengths` > 0."""
    generator = np.random.default_rng(seed)
    turns = len(phi_degrees)

    def numbers(*shape: int) -> np.ndarray:
        return generator.uniform(0.5, 1.5, shape).astype("f4")

    fields = {
        "theta_i": THETA,
        "phi_i": np.radians(phi_degrees).astype("f4"),
        "ndf": numbers(6, 5),
        "sigma": numbers(3, 7),
        "vndf": numbers(turns, 4, 9, 8),
        "luminance": numbers(turns, 4, 6, 6),
        "jacobian": np.ones(1, "u1"),
        "description": np.frombuffer(b"noise", "u1"),
    }
    if turns == 1:
        # σ of an isotropic material knows no azimuth.
        fields["sigma"][:] = fields["sigma"][0]
    if wavelengths:
        fields["wavelengths"] = np.linspace(360, 1000, wavelengths).astype("f4")
        fields["spectra"] = numbers(turns, 4, wavelengths, 6, 6)
    else:
        fields["rgb"] = numbers(turns, 4, 3, 6, 6)
    return fields
