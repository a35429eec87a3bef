# One command each; `make help` lists them. Every one brings uv and the locked packages by itself.

UV := .ci/uv
RUN := $(UV) run --no-sync
export UV_PYTHON_DOWNLOADS := never
export PYRIGHT_PYTHON_IGNORE_WARNINGS := 1 # does not ask the network for a newer version

# Three processes on two cores, since many tests wait for others; who is done first takes over from those that are not. What
# a busy machine's network did not do in time is tried once more, and told as "rerun"; a wrong value never is.
TEST_RUN := -n 3 --dist worksteal --reruns 1 --only-rerun ZError --only-rerun "it did not come to hold"

.PHONY: help
help: ## list the commands
	@sed -n 's/^\([a-z]*\):.*## /\1\t/p' $(MAKEFILE_LIST) | while IFS="$$(printf '\t')" read -r name text; do \
		printf '  make %-8s %s\n' "$$name" "$$text"; done

.PHONY: demo
demo: sync ## fly a flock over a lossy radio, a process per robot, and record it under runs/
	$(RUN) swarmwire run scenarios/flocking-lossy.toml --runners per-robot

.PHONY: test
test: check ## check, then the quick tests, in three processes
	$(RUN) pytest -m "not slow" $(TEST_RUN)

.PHONY: check
check: sync ## lint, format, types, and who may import whom
	$(RUN) ruff check
	$(RUN) ruff format --check
	$(RUN) pyright
	$(RUN) lint-imports

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

.PHONY: soak
soak: sync ## fuzz every door at length, then random faults, then an hour of a hundred processes
	$(RUN) python -m tests.tools.fuzz
	$(RUN) python -m tests.tools.soak

.PHONY: mutants
mutants: ## change the code in small ways, one by one: do tests notice? ONLY=module for one
	@.ci/sync --group mutants
	$(RUN) python -m tests.tools.mutants $(ONLY)

.PHONY: sync
sync: # the locked packages, exactly
	@.ci/sync
