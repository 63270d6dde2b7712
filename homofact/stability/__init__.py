"""Where methods fail: fits and linear solvers under stressors of growing strength, and what the program says of it."""
