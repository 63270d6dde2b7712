"""Error bars of a fit, whose success rate was measured on simulated cases, and the score that triggers the warning."""
