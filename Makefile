# Everything happens in .venv, which each target makes when it is missing. Needs only python3 (>= 3.11) and make.
PYTHON ?= python3
BIN := .venv/bin
READY := .venv/.ready

.PHONY: setup demo test test-all test-commands test-processes test-python live-load lint format docs bench gate fuzz fault-table hil-vm clean

setup: $(READY)

$(READY): pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit("Python 3.11 or newer is needed, this is " + sys.version.split()[0]) if sys.version_info < (3, 11) else None'
	$(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[dev]'
	@touch $@

demo: $(READY)
	$(BIN)/hvf demo --out runs/demo --overwrite

test: $(READY)
	$(BIN)/python -m pytest -n 2 --dist loadfile

test-all: $(READY)
	$(BIN)/python -m pytest -n 2 --dist loadfile -m 'not commands'

# Every hvf command of README and docs, run in a fresh folder from top to bottom (half an hour).
test-commands: $(READY)
	$(BIN)/python -m pytest -m commands

# Processes against the clock, browsers, device nodes (Debian: chromium, umockdev, python3-gi, gir1.2-umockdev-1.0).
test-processes: $(READY)
	$(BIN)/python -m pytest -m processes

# Another Python, which may get newer libraries, in a venv of its own: all modules are imported, and a run is made.
test-python:
	$(PYTHON) -m venv --clear build/python
	build/python/bin/python -m pip install --quiet --disable-pip-version-check --editable '.[study,video,gltf]'
	build/python/bin/python -c 'import pkgutil, geometry, models, controllers, sim, experiments, hvf; \
	    [__import__(module.name) for top in (geometry, models, controllers, sim, experiments) \
	        for module in pkgutil.walk_packages(top.__path__, top.__name__ + ".") if not module.name.endswith("__main__")]'
	build/python/bin/hvf run --figure none --seconds 1 --out build/python/run --overwrite

# The live page in a browser: what it costs the servo while it is dragged and reloaded (four minutes).
live-load: $(READY)
	$(BIN)/python -m tests.live.live_load

lint: $(READY)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/lint-imports --no-cache
	NODE_OPTIONS=--max-semi-space-size=128 $(BIN)/pyright --pythonpath $(BIN)/python  # a fifth less processor time than with node's small heap

format: $(READY)
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

# Pages and reference, strictly: a warning or a link that leads nowhere is an error. Open build/docs/index.html.
docs: $(READY)
	$(BIN)/python -m sphinx --builder html --fail-on-warning --keep-going --quiet docs build/docs

bench: $(READY)
	$(BIN)/hvf bench

# Short runs of the commit REF and of this tree, compared bit for bit: for changes that move code and no number.
gate: $(READY)
	$(BIN)/python tests/gate/compare.py $(REF)

fuzz: $(READY)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[fuzz]'
	$(BIN)/python tests/models/mocap/readers/fuzz_readers.py -max_total_time=300

# Injects every fault, and writes the table of docs/validation/fault-matrix.md.
fault-table: $(READY)
	$(BIN)/python -m tests.devices.fault_table

# The HID driver on Linux's own hidraw, in a virtual machine whose kernel has uhid; needs qemu-system-x86 and busybox-static.
hil-vm: $(READY)
	$(BIN)/python -m tests.hil.vm

clean:
	rm -rf .venv runs
