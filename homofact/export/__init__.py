"""Floor 4: what leaves the house: texture images, the manifest, the folder of a result."""
