# make demo: set up, build, let the simulated iCub lift a glass past an obstacle, say where the report is.
# make test: set up, run every test. Both work from a fresh clone.

VENV   := .venv
BIN    := $(VENV)/bin
READY  := $(VENV)/.ready
# pybullet has wheels for CPython 3.10 and 3.11 only; PYTHON=... overrides the search.
PYTHON ?= $(shell for p in python3.11 python3.10 python3 python; do \
	$$p -c 'import sys, venv, ensurepip; sys.exit(sys.version_info[:2] not in ((3, 10), (3, 11)))' >/dev/null 2>&1 \
	&& echo $$p && break; done)
SEED   ?= 3

.PHONY: demo test bench lint wheel clean setup

demo: $(READY)
	$(BIN)/motorprime reach --obstacle --seed $(SEED) --name demo

test: $(READY)
	cargo test --quiet
	$(BIN)/python -m pytest

bench: $(READY)
	$(BIN)/motorprime bench --json runs/bench/bench.json --picture runs/bench/bench.png
	@echo "Figures: runs/bench/bench.json, picture: runs/bench/bench.png; docs/kernels.md says how to read them."
	@echo "'cargo bench' measures the kernels without Python, over sizes of images."

lint: $(READY)
	cargo fmt --check
	cargo clippy --quiet --all-targets -- -D warnings
	cargo clippy --quiet --all-targets --features python -- -D warnings
	$(BIN)/ruff check python tests benches examples
	$(BIN)/ruff format --check python tests benches examples
	$(BIN)/mypy
	$(BIN)/python -m mypy.stubtest motorprime._core

wheel: $(READY)
	$(BIN)/pip wheel --quiet --no-deps --wheel-dir dist .

setup: $(READY)

clean:
	rm -rf $(VENV) target dist runs

$(READY): pyproject.toml Cargo.toml $(shell find rust/src -name '*.rs' 2>/dev/null)
	@command -v cargo >/dev/null || { echo "motorprime needs a Rust toolchain: https://rustup.rs"; exit 1; }
	@test -n "$(PYTHON)" || { echo "motorprime's simulator needs CPython 3.11 or 3.10 with venv and pip."; \
	  echo "Install one, e.g. 'apt-get install python3.11-venv' or 'pyenv install 3.11', or name it: make PYTHON=/path/to/python3.11"; \
	  exit 1; }
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --upgrade pip
	$(BIN)/python -m pip install --quiet --editable '.[sim,learn,scale,viz,onnx,dev]'
	@$(BIN)/python -m motorprime.evaluate.text_model || echo "without the text detector its tests are skipped"
	@touch $@
