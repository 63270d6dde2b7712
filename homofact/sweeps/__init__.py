"""Fit whole databases: every source by every method, with results that survive crashes."""
