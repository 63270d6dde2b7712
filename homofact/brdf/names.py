"""The names of channels and sampling schemes, apart from what they do, so that checks and help load no torch."""

CHANNELS = ("rgb", "spectral", "luminance")
SCHEMES = ("lobe", "discs", "cosine", "grid")
DEFAULT_SCHEME = "lobe"
DEFAULT_COUNT = 45_000
MATERIAL_PREFIX = "material:"
