# Two commands: `make demo` and `make test`. Each sets up what it needs in .venv and reuses it the next time.
# Nothing is installed outside .venv: what is missing there is named, with the command that installs it.
PYTHON ?= $(firstword $(foreach name,python3.11 python3.12 python3.13 python3.14 python3,$(shell $(name) -c \
    'import sys; (3, 11) <= sys.version_info[:2] <= (3, 14) and print("$(name)")' 2>/dev/null)))
VENV := .venv
SAMPLES := examples/data
BIN := $(VENV)/bin
# Modules are compiled when they are first imported: to compile all of them takes a minute.
PIP := $(BIN)/python -m pip install --quiet --disable-pip-version-check --no-compile -c constraints.txt
# In .venv and not in an environment that pip makes and forgets: `make demo` and `make test` compile alike.
BUILD_TOOLS = $$($(BIN)/python -c 'import tomllib; \
    print(*tomllib.load(open("pyproject.toml", "rb"))["build-system"]["requires"])') cmake ninja
# Files in their order: by the number of tests, the few that take minutes would come last, and one process would wait.
PYTEST := $(BIN)/python -m pytest -n auto --maxprocesses 4 --dist loadscope --no-loadscope-reorder
export ORT_DISABLE_TELEMETRY := 1
# Hundreds of programs start in the tests, and each imports the same modules: compiled once, whatever the shell says.
unexport PYTHONDONTWRITEBYTECODE
# The tests of the C library build it with the CMake that is installed here.
export PATH := $(CURDIR)/$(BIN):$(PATH)

.PHONY: demo test test-slow test-providers test-all announce tools lint bench docs clean

demo: $(VENV)/.runtime
	$(BIN)/endosdk predict $(SAMPLES)/demo/left.png $(SAMPLES)/demo/right.png \
	    --calibration $(SAMPLES)/rig.json --truth $(SAMPLES)/demo/disparity.png --out out
	@echo "look at out/overview.png"

# What decides whether a change is right. The rest trains, renders and builds for longer: `make test-all`.
test: announce tools $(VENV)/.develop lint
	$(PYTEST) -m "not slow"

# Providers that compute, each in an environment of its own: the whole accelerator path without an accelerator.
PROVIDERS := build/providers
test-providers: $(VENV)/.develop
	scripts/fetch_providers.sh $(PROVIDERS)
	PYTHONPATH=$(PROVIDERS)/openvino ENDOSDK_TEST_PROVIDER=openvino $(BIN)/python -m pytest tests/providers -q
	PYTHONPATH=$(PROVIDERS)/webgpu ENDOSDK_TEST_PROVIDER=webgpu LD_LIBRARY_PATH=$(PROVIDERS)/swiftshader \
	    VK_DRIVER_FILES=$(PROVIDERS)/swiftshader/vk_swiftshader_icd.json $(BIN)/python -m pytest tests/providers -q -n 2 --dist load

test-slow: tools $(VENV)/.develop
	$(PYTEST) -m slow

test-all: test test-slow

announce:
	@echo "make test: about 12 minutes on two cores, 3 of them to install the first time (make test-all: about 30)"

lint: $(VENV)/.develop
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

bench: $(VENV)/.runtime
	$(BIN)/endosdk-bench --model fast --size 960x720 --threads 2 --frames 300 --against sgbm

# The documentation site, built without a network; a warning is an error.
docs: $(VENV)/.docs
	$(BIN)/python -m sphinx -q -W --keep-going -c docs . build/site
	@echo "open build/site/docs/index.html"

$(VENV)/.docs: $(VENV)/.develop
	@$(PIP) $$($(BIN)/python -c 'import tomllib; \
	    print(*tomllib.load(open("pyproject.toml", "rb"))["project"]["optional-dependencies"]["docs"])')
	@touch $@

# What an application needs: the package with its processor runtime, no training, no renderer.
$(VENV)/.runtime: $(VENV)/.python pyproject.toml CMakeLists.txt $(shell find cpp models examples/data python -type f -not -name '*.pyc')
	@echo "installing endosdk and its run time into $(VENV)"
	@if [ -f $(VENV)/.develop ]; then $(MAKE) --no-print-directory $(VENV)/.develop; else \
	    $(PIP) $(BUILD_TOOLS) && $(PIP) --no-build-isolation '.[cpu]'; fi
	@touch $@

# What a developer needs: an editable install with every extra.
$(VENV)/.develop: $(VENV)/.python pyproject.toml constraints.txt CMakeLists.txt $(shell find cpp -type f)
	@echo "installing endosdk, training, renderer and test tools into $(VENV) (a few minutes the first time)"
	@$(PIP) $(BUILD_TOOLS)
	@$(PIP) --no-build-isolation -e '.[cpu,train,simulate,live,ray,viz,dev]'
	@touch $@ $(VENV)/.runtime

$(VENV)/.python:
	@if [ -z "$(PYTHON)" ]; then \
	    echo "no Python from 3.11 to 3.14: install one (Debian: apt-get install python3 python3-dev python3-venv), or name it:" \
	        "make PYTHON=/path/to/python3"; exit 1; fi
	$(PYTHON) -m venv $(VENV)
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --upgrade pip
	@touch $@

# Names what some tests need and this machine lacks; those tests are skipped.
tools:
	@lacking=""; \
	command -v c++ > /dev/null || lacking="$$lacking g++"; \
	command -v pkg-config > /dev/null || lacking="$$lacking pkg-config"; \
	command -v abidiff > /dev/null || lacking="$$lacking abigail-tools"; \
	ldconfig -p 2>/dev/null | grep -q libEGL.so.1 || lacking="$$lacking libegl1 libgl1-mesa-dri"; \
	if [ -n "$$lacking" ]; then \
	    echo "some tests will be skipped; for all of them (Debian): apt-get install$$lacking"; fi

clean:
	rm -rf build dist out $(VENV)
