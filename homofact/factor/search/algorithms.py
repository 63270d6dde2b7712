"""The searches' names, apart from the searches: how they are checked without loading torch."""

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
    """Return an algorithm of nlopt as nlopt spells it."""
    return _SHORT_NAMES.get(algorithm, algorithm)


def has_algorithm(algorithm: str) -> bool:
    """Return whether nlopt has an algorithm of this name, that needs no more than it is given here."""
    import nlopt

    full = in_full(algorithm)
    return hasattr(nlopt, full) and full[:3] in ("LN_", "LD_", "GN_", "GD_")


def expected_search(name: str) -> str | None:
    """Return what is expected instead where `name` is no search; None where it is one."""
    if name.startswith("nlopt-"):
        return None if has_algorithm(name.removeprefix("nlopt-")) else f"behind nlopt- {EXPECTED_OF_NLOPT}"
    return None if name in ("gradient", "powell") else _EXPECTED
