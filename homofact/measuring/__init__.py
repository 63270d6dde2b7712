"""Where to measure next: a prior of materials, what samples tell, and the directions that lower the error most."""
