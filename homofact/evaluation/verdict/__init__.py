"""What is wrong with a fit, what is odd in its data, and what nobody measured: the verdict that every fit ends with."""
