# All set-up happens here: both targets make .venv in the checkout and build the extension into it.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.installed
SECONDS := 60
SEED := 0
NOISE_FREE := --planes 1,3 --side 2d --noise 0 --masks binary,coverage --scenes 50 --no-plots --force
SOURCES := $(shell find rust -name '*.rs' -o -name Cargo.toml | grep -v /target/) Cargo.toml pyproject.toml

.PHONY: demo test test-fast lint lint-rust lint-python fuzz soak docs bench packages clean

demo: $(STAMP)
	$(BIN)/regionpose demo --out demo --force

test: $(STAMP)
	cargo test --all-features --quiet
	$(BIN)/python -m pytest -n 2 --dist loadfile --no-loadscope-reorder

# What is run at each change: without the tests that are marked as slow.
test-fast: $(STAMP)
	cargo test --all-features --quiet
	$(BIN)/python -m pytest -n 2 -m 'not slow'

# Two targets, which `make --jobs` checks beside one another.
lint: lint-rust lint-python

lint-rust: $(STAMP)
	cargo fmt --all --check
	cargo clippy --workspace --all-targets --all-features --quiet -- -D warnings
	for features in "" alignment batch mesh serde; do \
	    cargo clippy --quiet --no-default-features --features "$$features" -- -D warnings || exit 1; \
	done
	RUSTDOCFLAGS="-D warnings" cargo doc --no-deps --all-features --quiet

lint-python: $(STAMP)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/python -m mypy.stubtest regionpose._core
	$(BIN)/codespell
	$(BIN)/proselint --config .proselintrc.json check README.md CONTRIBUTING.md CHANGELOG.md docs/*.md docs/*/*.md

# Mutated files through every reader and random inputs through the crate, each for half of SECONDS after a build that shares that
# of the tests; files that are found are kept in fuzz/found, inputs come again by their seed.
fuzz: $(STAMP)
	cargo build --all-features --quiet --profile test --example fuzz
	$(BIN)/python fuzz/readers.py --seconds $$(($(SECONDS) / 2)) --seed $(SEED) --keep fuzz/found
	cargo run --all-features --quiet --profile test --example fuzz -- --seconds $$(($(SECONDS) / 2)) --seed $(SEED)

# Very many estimates, files and commands in one process: memory and handles stay as they are. And runs ended while they save.
soak: $(STAMP)
	$(BIN)/python fuzz/soak.py
	$(BIN)/python fuzz/kills.py --seed $(SEED)

# The site, all pages read anew, with its examples run; warnings, dead links among them, are errors. Opens as docs/_build/html/index.html.
docs: $(STAMP)
	$(BIN)/python -m pip install --quiet --group docs
	$(BIN)/python -m sphinx -b html -E -W --keep-going --quiet docs docs/_build/html

# Wheel, source distribution and crate, each tested from where its user gets it.
packages: $(STAMP)
	$(BIN)/python -m pip install --quiet 'maturin>=1.9.4,<2'
	PATH="$(CURDIR)/$(BIN):$$PATH" $(BIN)/python tools/check_packages.py

bench: $(STAMP)
	$(BIN)/python -m pip install --quiet --editable '.[benchmarks]'
	$(BIN)/python -m benchmarks.speed
	$(BIN)/python -m benchmarks perspective $(NOISE_FREE) --out results/perspective.csv
	$(BIN)/python -m benchmarks omnidirectional $(NOISE_FREE) --out results/omnidirectional.csv
	$(BIN)/python -m benchmarks.stages --scenes 10
	$(BIN)/python -m benchmarks.workers --scenes 40
	$(BIN)/python -m benchmarks.confidence --scenes 10
	$(BIN)/python -m benchmarks.published --scenes 20
	$(BIN)/python -m benchmarks.peers --scenes 20
	$(BIN)/python -m benchmarks.image_segmentation --scenes 5
	$(BIN)/python -m benchmarks.click_masks
	$(BIN)/python -m benchmarks.cloud_segmentation --scenes 20
	$(BIN)/python -m benchmarks.matching --scenes 20
	$(BIN)/python -m benchmarks.rig --synthetic 5
	$(BIN)/python -m benchmarks.scale --points 1000000 --megapixels 6
	$(BIN)/python -m benchmarks.frame --growth
	$(BIN)/python -m benchmarks.real_scenes
	$(BIN)/python -m benchmarks.automatic
	$(BIN)/python -m benchmarks.agreement
	$(BIN)/python -m benchmarks.chessboards
	$(BIN)/python -m benchmarks.with_regions
	cargo bench --quiet --package regionpose-benches

$(STAMP): $(SOURCES)
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --upgrade pip
	$(BIN)/python -m pip install --quiet --editable '.[test]'
	touch $(STAMP)

clean:
	rm -rf $(VENV) target demo results docs/_build docs/gallery docs/reference/api
