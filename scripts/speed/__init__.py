"""Seconds and memory of fits, commands and evaluations."""
