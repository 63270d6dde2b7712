"""The ways to fit: one file a method, and what they search by and are judged by."""
