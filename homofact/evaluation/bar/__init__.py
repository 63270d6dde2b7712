"""How far a fit may be off: error bars whose rate was counted on simulated cases, and the score that warns."""
