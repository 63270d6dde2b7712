"""Directions, maps of the hemisphere, named coordinates and rotations."""
