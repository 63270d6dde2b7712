"""Floor 4: metrics, methods by name, comparison on one split, charts."""
