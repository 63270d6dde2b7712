"""The units of the metrics, apart from their formulas: f is in sr⁻¹, what is not named here has no unit."""

_UNITS = {
    "mse": "sr⁻²", "mae": "sr⁻¹", "max": "sr⁻¹", "cosine_rms": "sr⁻¹", "cube_root_rms": "sr⁻¹ᐟ³", "psnr": "dB",
}  # fmt: skip
# As LaTeX sets them.
LATEX = {
    "sr⁻²": r"$\mathrm{sr}^{-2}$",
    "sr⁻¹": r"$\mathrm{sr}^{-1}$",
    "sr⁻¹ᐟ³": r"$\mathrm{sr}^{-1/3}$",
    "dB": "dB",
}


def unit_of(metric: str) -> str:
    """The unit of a metric's number, "" for one without."""
    return _UNITS.get(metric, "")
