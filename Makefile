# One command each; `make help` lists them. Every one brings uv and the locked packages by itself.

UV := .ci/uv
RUN := $(UV) run --no-sync
export UV_PYTHON_DOWNLOADS := never
unexport PYTHONDONTWRITEBYTECODE # containers often set it; each of the many processes would compile its imports anew
export PYRIGHT_PYTHON_IGNORE_WARNINGS := 1 # does not ask the network for a newer version

# Two processes, since most machines of CI have two cores; the one that has no tests left takes over from the other.
PYTEST := $(RUN) pytest -q -n $(or $(WORKERS),2) --dist worksteal --durations 20 --durations-min 0.5
# zenoh gives up a connection attempt when the other side does not answer in time, which happens when other programs
# use both cores. Such a test runs once more, and pytest prints "rerun". A wrong value is never tried again.
RERUNS := --reruns 1 --only-rerun ZError

.PHONY: help
help: ## list the commands
	@sed -n 's/^\([a-z-]*\):.*## /\1\t/p' $(MAKEFILE_LIST) | while IFS="$$(printf '\t')" read -r name text; do \
		printf '  make %-10s %s\n' "$$name" "$$text"; done

.PHONY: demo
demo: ## fly a flock that a rock splits, a process per robot, and draw the moment of the split under runs/
	@echo "installing into .venv/, then a run of a minute; the first one compiles for half a minute before ..."
	@.ci/sync --extra view
	@run=runs/demo-$$(date -u +%Y%m%dT%H%M%SZ) && set -x && \
		$(RUN) swarmwire run scenarios/split.toml --set duration_s=70 --runners per-robot --packets all --out $$run && \
		$(RUN) swarmwire export $$run --at 35 && { set +x; } 2>/dev/null && \
		echo "see the picture: file://$$PWD/$$run/picture.png" && \
		echo "put swarmwire on your PATH: make install; then: swarmwire view $$run"

.PHONY: install
install: ## put `swarmwire` and `swarmwire-agent` on your PATH; EXTRAS=tune,ui adds what needs more packages
	@.ci/install "$(EXTRAS)"

.PHONY: wheels
wheels: ## build the wheels of all parts into wheels/, for projects and machines without this clone
	@rm -rf wheels
	@$(UV) build --quiet --all-packages --wheel --out-dir wheels
	@ls wheels/*.whl

.PHONY: test
test: ## lint, all unit tests, and the main uses from end to end: what to run first
	@.ci/sync --group test
	$(RUN) ruff check --quiet
	$(PYTEST) tests/unit tests/integration/test_smoke.py

.PHONY: test-all
test-all: sync ## every test: processes, robots, statistics, docs, installed packages; SLOW=no leaves out the longest, UNIT=no the unit tests
	HYPOTHESIS_PROFILE=full $(PYTEST) $(RERUNS) $(if $(SLOW),-m "not slow") $(if $(UNIT),tests --ignore tests/unit)

.PHONY: check
check: sync ## lint, format, types, imports between parts, and names
	$(RUN) ruff check
	$(RUN) ruff format --check
	$(RUN) pyright
	$(RUN) lint-imports
	$(RUN) python -m tests.tools.names

.PHONY: docs-check
docs-check: sync ## links, generated tables and measured figures of the docs
	$(RUN) python -m docs.checks

.PHONY: coverage
coverage: sync ## how much of comms, world and agent the tests run, with and without the compiler
	$(RUN) python -m tests.tools.coverage

.PHONY: docs
docs: sync ## build these pages and the reference as a site, docs/_build/html/index.html
	$(RUN) python -m sphinx -W --keep-going -n -q docs docs/_build/html

.PHONY: pictures
pictures: sync ## draw the pictures under docs/ anew; needs a Vulkan driver
	@docs/pictures/draw.sh

.PHONY: bench
bench: sync ## measure; ONLY=name for one of them, ENGINE=pymunk for the figures of that engine
	$(RUN) python -m benchmarks $(if $(ENGINE),--engine $(ENGINE)) $(ONLY)

.PHONY: validation
validation: ## compare the radio with ns-3, whose wheel this installs, and write docs/dev/validation.md
	@.ci/sync --group dev --group validation
	$(RUN) python -m benchmarks.ns3 --page docs/dev/validation.md

.PHONY: soak
soak: sync ## fuzz every input, then random faults, then an hour of a hundred processes: an hour and a half
	HYPOTHESIS_PROFILE=soak $(RUN) pytest -q -s tests/integration/test_fuzz.py tests/integration/test_soak.py
	$(RUN) python -m tests.tools.soak

.PHONY: mutants
mutants: ## change the code in small ways, one by one: does a test notice? ONLY=codec, draws or fates; COUNT=all
	@.ci/sync --group dev --group mutants
	@for group in $(or $(ONLY),codec draws fates); do $(RUN) tests/tools/mutants/try.sh $$group || exit 1; done

.PHONY: sync
sync: # the locked packages, those of the other commands among them
	@.ci/sync --group dev
