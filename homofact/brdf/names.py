"""The names of channels and sampling schemes, apart from what they do, so that checks and help load no torch."""

CHANNELS = ("rgb", "spectral", "luminance")
SCHEMES = ("lobe", "discs", "cosine", "grid")
DEFAULT_SCHEME = "lobe"
DEFAULT_COUNT = 45_000
MOST_COUNT = 10_000_000  # pairs: a gigabyte of samples
MATERIAL_PREFIX = "material:"
GAINS = ("rings", "rows")  # what `brdf.gains` can divide out
