"""Cost and robustness of sweeps, and sweeps over whole databases."""
