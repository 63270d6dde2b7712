"""Choose the directions to measure next, from a prior over materials and the samples so far."""
