"""Data that the project makes, and readers of data that only scripts use."""
