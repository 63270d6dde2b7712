"""The names of the texture formats, apart from their writers, so that checks and help load no numpy."""

FORMAT_NAMES = ("exr", "exr16", "png8", "png16", "ktx2", "dds", "bc6h")
