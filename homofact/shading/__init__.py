"""Shader source from a fit: one program of expressions, printed in four languages, its operations counted."""
