"""Whole databases: every source with every method, survived and remembered."""
