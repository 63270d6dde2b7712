"""Relighting with all-frequency shadows: in-out factors, precomputed transport, light and view."""
