"""Searches over projections, one method per file. All keep the best result so far, a trace and a report."""
