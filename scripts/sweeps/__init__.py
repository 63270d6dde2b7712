"""These programs measure the cost and robustness of sweeps, and run sweeps over whole databases."""
