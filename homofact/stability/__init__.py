"""Test where methods fail: fits and linear solvers under stressors of increasing strength, and their warnings."""
