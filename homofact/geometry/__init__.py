"""Floor 1: directions, maps of the hemisphere, named coordinates and 4D rotations."""
