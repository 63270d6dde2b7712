"""Fits without textures, for comparison: models of a few parameters, tables and small networks."""
