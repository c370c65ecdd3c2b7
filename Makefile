# planish - one line per errand.
#
#   make demo    build the program and run everything on a synthetic part: products in out/demo
#   make test    all tests: the library, the program, files read back by other programs' libraries
#   make studio  the page of the studio, which the program has inside
#   make site    the documentation as a site: out/site
#   make wheel   the Python package with the program inside: out/wheels
#   make fuzz    damaged files for ten minutes a format, 300 killed sessions, 3 000 hostile inputs through every command
#   make lint    formatting and clippy, warnings are errors
#   make guard   headline figures of scanned parts against their floors, all rows: `make test` leaves two long ones out
#   make test-checked  tests of the library with debug assertions and checks of overflow
#   make bench   time every stage: bench/runs/<date>-<machine>.json
#   make bench-studio  figures of the studio: opening, dragging, fitting, memory
#   make figures headline figures of parts and measured meshes: bench/runs/<date>-<machine>-figures.json
#   make docs    reference of the libraries, and the pictures of the guide from the demo
#
# One cargo profile (release) for everything: a second one would build every dependency twice.

SHELL   := /bin/bash
CARGO   ?= cargo
PLANISH := target/release/planish
PYTHON  := .venv/bin/python
DATA    := $(or $(PLANISH_DATA),../shared/data)

.NOTPARALLEL:
.PHONY: build demo studio site wheel fuzz deny test test-rust guard test-checked test-readers test-studio test-python lint bench bench-studio figures docs clean
.DELETE_ON_ERROR:

build: .stamp/packages .stamp/page
	$(CARGO) build --release --locked --workspace

demo: build
	$(PLANISH) demo -o out/demo
	@echo "open out/demo/report.html"

test: test-rust test-readers test-studio test-python site

studio: .stamp/page

# PLANISH_PYTHON: tests of the file formats read their files back with other libraries, too.
test-rust: .stamp/packages .stamp/readers .stamp/page
	@test -d "$(DATA)" || echo "skipped: the tests on measured meshes; there is no $(DATA), and PLANISH_DATA names none"
	PLANISH_PYTHON=$(abspath $(PYTHON)) $(CARGO) test --release --locked --workspace --no-fail-fast

guard: .stamp/packages
	$(CARGO) test --release --locked --workspace --test regress -- --include-ignored

# The library alone is compiled again, and what builds on it; with the whole workspace named its dependencies stay as they are.
CHECKED := $(foreach check,debug-assertions overflow-checks,--config 'profile.release.package.planish.$(check)=true')
test-checked:
	$(CARGO) test --release --locked --workspace --lib $(CHECKED)

# The program as the tests above have built it; `build` would compile what depends on test-only features again.
test-readers: .stamp/packages .stamp/readers .stamp/page
	$(CARGO) test --release --locked --workspace --no-run --quiet
	$(PYTHON) -m pytest -q -rs tests/readers

# The page by itself, then with the program in a browser; without a browser the second half is skipped.
test-studio: .stamp/packages .stamp/page .stamp/browser
	cd studio && ../.ci/node npm test --silent
	$(CARGO) test --release --locked --workspace --no-run --quiet
	cd studio && ../.ci/node npm run --silent e2e

# Figures of the studio in a browser that draws with the processor; nothing else should run beside them.
bench-studio: build .stamp/browser
	cd studio && ../.ci/node npm run --silent bench

wheel: .stamp/packages .stamp/python .stamp/page
	rm -rf out/wheels
	.venv/bin/maturin build --locked --quiet --out out/wheels

# On the wheel as users install it. It shares what the tests above have compiled; PyO3 alone is compiled for it.
test-python: wheel
	$(PYTHON) -m pip install --quiet --disable-pip-version-check --no-deps --force-reinstall out/wheels/*.whl
	$(PYTHON) -m pytest crates/planish-py/tests

# The reference of the package comes from the wheel that is installed: after `test-python`, or `make wheel` and pip.
site: .stamp/site
	@$(PYTHON) -c 'import planish' 2>/dev/null || $(MAKE) --no-print-directory test-python
	NO_MKDOCS_2_WARNING=1 $(PYTHON) -m mkdocs build --strict --quiet
	@echo "open out/site/index.html"

# PLANISH_FUZZ_SECONDS: for each of the seventeen formats. Another PLANISH_FUZZ_SEED makes other files.
fuzz: export PLANISH_FUZZ_SECONDS ?= 600
fuzz: export PLANISH_KILLS ?= 300
fuzz: export PLANISH_HOSTILE ?= all
fuzz: .stamp/packages
	$(CARGO) test --release --locked --workspace --test fuzz --test kills --test hostile -- --nocapture

# Licences and sources of everything that is linked: deny.toml.
deny:
	@if $(CARGO) deny --version >/dev/null 2>&1; then $(CARGO) deny --locked check licenses sources bans; \
	else echo "skipped: licences and sources; cargo-deny is not installed"; fi

lint: .stamp/packages .stamp/node deny
	cd studio && ../.ci/node npm run --silent check
	$(CARGO) fmt --all --check
	$(CARGO) clippy --release --locked --workspace --all-targets -- -D warnings

bench: .stamp/packages
	$(CARGO) bench --profile release --locked --workspace --bench pipeline

# FIGURES: shapes, noises in percent and seeds, such as "fandisk.ply,casting 0.1,0.25 1,2,3"; all of them take half an hour.
figures: .stamp/packages
	@test -d "$(DATA)" || echo "skipped: the measured meshes; there is no $(DATA), and PLANISH_DATA names none"
	$(CARGO) bench --profile release --locked --workspace --bench figures -- $(FIGURES)

docs: build
	$(CARGO) doc --release --locked --no-deps -p planish -p planish-io
	$(PLANISH) demo -q -o out/docs
	python3 docs/pictures.py out/docs/report.html docs/pictures
	python3 examples/edit/head.py out/docs/head.nrrd
	$(PLANISH) mesh -q out/docs/head.nrrd --plain -o out/docs/head.ply
	$(PLANISH) edit -q out/docs/head.ply examples/edit/head.toml -o out/docs/head.planish --pictures out/docs/head
	for p in 03-paint 04-relax 10-spline 11-complete 13-mirror 14-feature; do \
	  cp out/docs/head/$$p.png docs/pictures/head-$$p.png; done

clean:
	rm -rf out .stamp .venv studio/dist studio/node_modules

# System packages, only those that are missing.
.stamp/packages: .ci/packages
	@mkdir -p .stamp
	.ci/packages build
	@touch $@

# What builds the page and tests it. `npm ci` refuses registries that lack the builds of a package for other systems.
.stamp/node: studio/package-lock.json .ci/node
	@mkdir -p .stamp
	cd studio && ../.ci/node npm install --no-save --no-audit --no-fund --silent
	@touch $@

.stamp/page: .stamp/node studio/index.html studio/vite.config.ts $(shell find studio/src -type f)
	cd studio && ../.ci/node npm run --silent build
	@touch $@

.stamp/browser: .ci/packages
	@mkdir -p .stamp
	.ci/packages browser || echo "skipped: the tests in a browser; there is no chromium, and none can be installed"
	@touch $@

# The libraries that read the products back.
.stamp/readers: tests/readers/requirements.txt .ci/packages
	@mkdir -p .stamp
	.ci/packages readers
	test -x $(PYTHON) || python3 -m venv .venv
	$(PYTHON) -m pip install --quiet --disable-pip-version-check -r $<
	@touch $@

# What builds the site.
.stamp/site: docs/requirements.txt .stamp/python
	$(PYTHON) -m pip install --quiet --disable-pip-version-check -r $<
	@touch $@

# What builds the wheel and tests it.
.stamp/python: crates/planish-py/tests/requirements.txt .ci/packages
	@mkdir -p .stamp
	.ci/packages python
	test -x $(PYTHON) || python3 -m venv .venv
	$(PYTHON) -m pip install --quiet --disable-pip-version-check -r $<
	@touch $@
