"""Charts, plots and comparison pictures."""
