# Every target makes the environment it needs: `make demo` or `make test` works as the first command in a fresh clone.
PYTHON ?= $(shell for p in python3 python3.14 python3.13 python3.12 python3.11; do \
	$$p -c 'import sys; sys.exit(sys.version_info < (3, 11))' >/dev/null 2>&1 && { echo $$p; break; }; done)
BIN := .venv/bin
READY := .venv/.ready

.PHONY: demo test lint bench takeover chaos chaos-short fuzz docs lock clean

demo: $(READY)
	$(BIN)/sightline demo

# In a process per processor; more than a few would wait for one another's teams of processes.
test: $(READY)
	$(BIN)/python -m pytest --numprocesses logical --maxprocesses 4 --dist worksteal

lint: $(READY)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

# The other people's estimators that it compares with are no dependencies: without them it says so and goes on.
bench: $(READY)
	-@$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --require-hashes \
		--requirement tests/benchmarks/references.lock
	$(BIN)/python -m tests.benchmarks

# Real processes lose their leader, a robot, each other: about a quarter of an hour.
takeover: $(READY)
	$(BIN)/python -m tests.campaigns.takeover

# Ten thousand missions in virtual time in which much goes wrong, 300 in which ranges alone tell where the agent is, and
# 200 with the full planner on the packaged maps.
chaos: $(READY)
	$(BIN)/python -m tests.campaigns.chaos --missions 10000 --ranged 300 --real 200

chaos-short: $(READY)
	$(BIN)/python -m tests.campaigns.chaos --missions 300 --ranged 20 --real 10

# A million inputs of our own, then as many of atheris, which is no dependency: without it the second half is left out.
fuzz: $(READY)
	-@$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --require-hashes \
		--requirement tests/campaigns/fuzzer.lock
	$(BIN)/python -m tests.campaigns.fuzz
	@if $(BIN)/python -c 'import atheris' 2>/dev/null; then $(BIN)/python -m tests.campaigns.guided_fuzz; \
		else echo "atheris is not installed: no guided inputs"; fi

docs: $(READY)
	$(BIN)/python -m protocol.schemas docs/messages
	$(BIN)/python -m protocol.state_diagrams

# Needs uv (`pip install uv`); the lock holds hashes for every platform and Python >= 3.11.
lock:
	uv pip compile --universal --python-version 3.11 --generate-hashes --no-header --no-emit-index-url \
		--no-annotate --group test --group lint --group build pyproject.toml -o requirements.lock
	printf 'filterpy\ncodac\n' | uv pip compile --universal --python-version 3.11 --no-deps --generate-hashes --no-header \
		--no-emit-index-url --no-annotate - -o tests/benchmarks/references.lock
	printf 'atheris==3.0.0\n' | uv pip compile --universal --python-version 3.11 --no-deps --generate-hashes --no-header \
		--no-emit-index-url --no-annotate - -o tests/campaigns/fuzzer.lock

$(READY): requirements.lock pyproject.toml
	@test -n "$(PYTHON)" || { echo "Sightline needs Python 3.11 or newer: install it, or say make PYTHON=/path/to/python3"; exit 2; }
	@echo "Setting up .venv with $$($(PYTHON) --version) (once; about a minute) ..."
	@$(PYTHON) -m venv --clear .venv || { echo "Python's venv module is missing: on Debian, apt-get install python3-venv"; rm -rf .venv; exit 2; }
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --require-hashes --requirement requirements.lock
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation --editable .
	@touch $(READY)

clean:
	rm -rf .venv build dist *.egg-info .mypy_cache .pytest_cache .ruff_cache .hypothesis
