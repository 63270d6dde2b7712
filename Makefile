# make demo: the environment, two fits and their pictures. make test: the environment, linters and fast tests.
# make slow: the other tests. make docs: the site.
# Another interpreter: make PYTHON=python3.12 demo. The environment is .venv in this folder.

PYTHON ?= python3
BIN := .venv/bin
READY := .venv/.ready
# What a fit and its pictures need: no Mitsuba, no test tools.
FIT := .venv/.fit
# The type checker's wrapper would otherwise ask the network for a newer version on every run.
export PYRIGHT_PYTHON_IGNORE_WARNINGS := 1

.PHONY: demo test slow nightly stability wheel gallery docs install format constraints clean

demo: $(FIT)
	$(BIN)/homofact factorize --config configs/plastic.toml --force
	$(BIN)/homofact factorize --config configs/blue_paint.toml --force
	@echo
	@echo "The pictures: out/plastic/compare.png (the lit sphere: source, fit, McCool's projections, differences)"
	@echo "and out/plastic/*.png (the textures). The figures: out/plastic/report.json. Likewise in out/blue_paint."

# One thread a worker: two processes that both take every core wait for each other several times over.
test: $(READY)
	.ci/packages
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/pyright
	OMP_NUM_THREADS=1 NUMBA_NUM_THREADS=1 $(BIN)/pytest -n 2 --dist worksteal

# The tests that `make test` leaves out: before a release, and after changes to pages, engines or pictures.
slow: $(READY)
	.ci/packages
	OMP_NUM_THREADS=1 NUMBA_NUM_THREADS=1 $(BIN)/pytest -n 2 --dist worksteal -m slow

# Slow tests; properties on 2000 random problems each instead of 100; 20,000 damaged files of every kind that is read; a
# kill at every system call of a write (Debian's strace); everything 200 times in one process, whose memory stays flat;
# small faults that the tests have to notice.
nightly: slow
	HYPOTHESIS_PROFILE=nightly OMP_NUM_THREADS=1 NUMBA_NUM_THREADS=1 $(BIN)/pytest -n 2 -m '' tests/factor/test_properties.py
	OMP_NUM_THREADS=1 NUMBA_NUM_THREADS=1 $(BIN)/python scripts/checks/fuzz_readers.py
	OMP_NUM_THREADS=1 NUMBA_NUM_THREADS=1 $(BIN)/python scripts/checks/fuzz_results.py
	OMP_NUM_THREADS=1 NUMBA_NUM_THREADS=1 $(BIN)/python scripts/checks/fuzz_scenes.py
	$(BIN)/python scripts/checks/kill_writes.py
	OMP_NUM_THREADS=1 NUMBA_NUM_THREADS=1 $(BIN)/python scripts/checks/soak.py
	$(BIN)/python scripts/checks/planted_faults.py

# The atlas of failures, remade with its document: minutes. Real measurements are looked for in HOMOFACT_DATA.
stability: $(READY)
	OMP_NUM_THREADS=1 NUMBA_NUM_THREADS=1 $(BIN)/homofact research stability --out docs/pictures/stability --document docs/stability.md

# Wheel and sdist in dist/. What they take when installed: python scripts/checks/clean_install.py.
wheel: $(READY)
	$(BIN)/python scripts/checks/clean_install.py --build dist

# The documentation site in build/site, without a network; warnings and broken links are errors.
docs: $(READY)
	$(BIN)/python docs/make_site.py --out build/site

# The fits of the site's gallery with their viewers in build/gallery; measurements are looked for in HOMOFACT_DATA. Minutes.
gallery: $(READY)
	$(BIN)/python scripts/pictures/site_gallery.py --out build/gallery

install: $(READY)

# torch first and alone: it is by far the largest, and the rest then resolves against it.
$(FIT): pyproject.toml setup.py constraints.txt
	@$(PYTHON) -c 'import sys; sys.exit(None if sys.version_info >= (3, 11) else \
	  f"homofact needs Python 3.11 or newer, found {sys.version.split()[0]}: make PYTHON=... {sys.argv[1]}")' "$(MAKECMDGOALS)"
	$(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet -c constraints.txt torch==2.13.0
	$(BIN)/python -m pip install --quiet -c constraints.txt -e '.[pictures,containers]'
	@touch $@

$(READY): $(FIT)
	$(BIN)/python -m pip install --quiet -c constraints.txt -e '.[all,dev,nmf,docs,materialx]'
	@touch $@

format: $(READY)
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

# Local version tags ("+cpu") and the project itself stay out; setuptools is a dependency that freeze hides.
constraints: $(READY)
	@{ sed -n '/^#/p' constraints.txt; \
	  { $(BIN)/python -m pip freeze --exclude-editable; $(BIN)/python -m pip freeze --all | grep '^setuptools=='; } \
	  | sed -e '/^#/d' -e '/^homofact/d' -e '/ @ /d' -e 's/+[^ ]*$$//' | sort -f -u; } > .constraints.partial
	@mv .constraints.partial constraints.txt
	@echo "constraints.txt: $$(grep -c == constraints.txt) versions"

clean:
	rm -rf .venv out build dist *.egg-info .pytest_cache .ruff_cache .hypothesis
