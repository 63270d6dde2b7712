"""Searches over projections, one method a file, all with best-so-far, trace and report."""
