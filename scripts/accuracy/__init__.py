"""Errors of fits: against McCool's projections and other methods, and by seed, size and number of textures."""
