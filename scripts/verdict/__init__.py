"""These programs count how often the verdict is right, how often suspected data faults are real, and how often the
remedies work."""
