"""Generate shader source from a fit: one program of expressions, printed in four languages, with operation counts."""
