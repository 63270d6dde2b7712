"""Fit sums of products of textures: tabulate a BRDF as a matrix over direction maps, and decompose the matrix."""
