"""The log-domain problem: projections, objective, searches over them, textures, and the factorization they give."""
