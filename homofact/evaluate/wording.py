"""How numbers are written for people, in tables, captions and pages alike."""


def figure(value: float | None) -> str:
    """Three significant digits in at most eight characters."""
    if value is None:
        return "–"
    return f"{value:.3g}" if value == 0 or 1e-4 <= abs(value) < 1e5 else f"{value:.1e}"
