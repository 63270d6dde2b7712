"""Sums of products of textures: matrices over direction maps, their decompositions, non-negative factors."""
