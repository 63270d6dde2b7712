"""The names of the linear solvers, apart from the solvers, so that checks and help need not load them."""

SOLVER_NAMES = ("cholesky", "qr", "lsmr", "cg", "qmr")
