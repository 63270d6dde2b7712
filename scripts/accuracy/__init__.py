"""These programs measure the errors of fits. They compare the search with McCool's projections and other methods,
and compare seeds, sizes and numbers of textures."""
