"""These programs show how other renderers and engines draw exported fits."""
