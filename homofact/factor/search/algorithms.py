"""The names of the searches, in a module that checks them without importing torch."""

_SHORT_NAMES = {
    "PRAXIS": "LN_PRAXIS",
    "SBPLX": "LN_SBPLX",
    "BOBYQA": "LN_BOBYQA",
    "COBYLA": "LN_COBYLA",
    "NELDERMEAD": "LN_NELDERMEAD",
    "MLSL": "GD_MLSL_LDS",
}
_EXPECTED = "gradient, powell, or nlopt-NAME such as nlopt-PRAXIS"
EXPECTED_OF_NLOPT = f"{', '.join([*_SHORT_NAMES, 'LD_LBFGS', 'LD_SLSQP'])} or another of nlopt's"


def in_full(algorithm: str) -> str:
    """Return the full name of an nlopt algorithm, such as LN_PRAXIS for PRAXIS."""
    return _SHORT_NAMES.get(algorithm, algorithm)


def has_algorithm(algorithm: str) -> bool:
    """Return whether nlopt has an algorithm of this name, and it needs no further settings (LN_, LD_, GN_ or GD_)."""
    import nlopt

    full = in_full(algorithm)
    return hasattr(nlopt, full) and full[:3] in ("LN_", "LD_", "GN_", "GD_")


def expected_search(name: str) -> str | None:
    """Return the expected names, for an error message, if `name` is not a search; None if it is."""
    if name.startswith("nlopt-"):
        return None if has_algorithm(name.removeprefix("nlopt-")) else f"behind nlopt- {EXPECTED_OF_NLOPT}"
    return None if name in ("gradient", "powell") else _EXPECTED
