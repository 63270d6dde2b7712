"""The numbers, tables and figures of studies that are written up in docs/papers."""
