"""Floor 4: a lit sphere of any reflectance, light, tone and the pictures that compare fits."""
