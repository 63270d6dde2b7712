"""Fits that are no textures: models of a few parameters, tables and small networks, to be held against ours."""
