# Two commands: `make demo` and `make test`. Each sets up what it needs in .venv and reuses it the next time.
PYTHON ?= python3.11
VENV := .venv
SAMPLES := examples/data
BIN := $(VENV)/bin
PIP := $(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt
export ORT_DISABLE_TELEMETRY := 1

.PHONY: demo test lint bench clean graphics abi-tools

demo: $(VENV)/.runtime
	$(BIN)/endosdk predict $(SAMPLES)/demo/left.png $(SAMPLES)/demo/right.png \
	    --calibration $(SAMPLES)/rig.json --truth $(SAMPLES)/demo/disparity.png --out out
	@echo "look at out/overview.png"

test: $(VENV)/.develop graphics abi-tools lint
	$(BIN)/python -m pytest

lint: $(VENV)/.develop
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

bench: $(VENV)/.runtime
	$(BIN)/endosdk-bench --model fast --size 960x720 --threads 2 --frames 300 --against sgbm

# What an application needs: the package with its processor runtime, no training, no renderer.
$(VENV)/.runtime: $(VENV)/.python pyproject.toml CMakeLists.txt $(shell find cpp models examples/data python -type f -not -name '*.pyc')
	@echo "installing endosdk and its run time into $(VENV)"
	@if [ -f $(VENV)/.develop ]; then $(MAKE) --no-print-directory $(VENV)/.develop; else $(PIP) '.[cpu]'; fi
	@touch $@

# What a developer needs: an editable install with every extra.
$(VENV)/.develop: $(VENV)/.python pyproject.toml constraints.txt CMakeLists.txt $(shell find cpp -type f)
	@echo "installing endosdk, training, renderer and test tools into $(VENV) (a few minutes the first time)"
	@$(PIP) 'scikit-build-core>=1.0' 'pybind11>=3.0' cmake ninja
	@$(PIP) --no-build-isolation -e '.[cpu,train,simulate,live,ray,viz,dev]'
	@touch $@ $(VENV)/.runtime

$(VENV)/.python:
	$(PYTHON) -m venv $(VENV)
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --upgrade pip
	@touch $@

# The renderer's tests need an EGL driver; the software one of Debian serves. Without rights to install it they are skipped.
graphics:
	@if ! ldconfig -p | grep -q libEGL.so.1; then \
	    if [ "$$(id -u)" = 0 ]; then apt-get update -qq && apt-get install -y -qq libegl1 libgl1-mesa-dri; \
	    else echo "no EGL driver: renderer tests will be skipped (apt-get install libegl1 libgl1-mesa-dri)"; fi; fi

# The C library's ABI is compared by abidiff. Without rights to install it that test is skipped.
abi-tools:
	@if ! command -v abidiff > /dev/null; then \
	    if [ "$$(id -u)" = 0 ]; then apt-get update -qq && apt-get install -y -qq abigail-tools pkg-config; \
	    else echo "no abidiff: the ABI test will be skipped (apt-get install abigail-tools)"; fi; fi

clean:
	rm -rf build dist out $(VENV)
