# snca_ros. `make help` lists the targets; `make walk` is where to start.
PYTHON ?= python3
VENV   := .venv
BIN    := $(VENV)/bin
READY  := $(VENV)/.ready
TOOLS  := $(VENV)/.tools
OLDEST := .venv-oldest

.DEFAULT_GOAL := help
.PHONY: help setup walk test lint unit oldest bench docs api pictures clean

help:  ## list the targets
	@awk -F ':.*## ' '/^[a-z-]+:.*## /{printf "  make %-10s %s\n", $$1, $$2}' $(MAKEFILE_LIST)

setup: $(TOOLS)  ## make .venv with ROS 2 Jazzy, all else and what tests need, from PyPI

$(READY): setup.py
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 10))' \
	  || { echo 'Python 3.10 or newer is needed: make PYTHON=python3.12 ...'; exit 1; }
	@test -x $(BIN)/python || $(PYTHON) -m venv $(VENV) \
	  || { echo 'cannot make a virtual environment (Debian, Ubuntu: apt install python3-venv)'; exit 1; }
	$(BIN)/python -m pip install -q --disable-pip-version-check -e '.[ros]'
	@touch $@

$(TOOLS): $(READY)
	$(BIN)/python -m pip install -q --disable-pip-version-check -e '.[ros,test]'
	@touch $@

walk: $(READY)  ## the trained biped walks 30 s, ten voxels in ten processes, recorded
	$(BIN)/snca walk

test: lint unit  ## everything that a change must pass

lint: $(TOOLS)  ## style and types
	$(BIN)/ruff check .
	$(BIN)/mypy

unit: $(TOOLS)  ## the tests: unit tests, then graphs of real processes
	$(BIN)/python -m pytest -n auto --dist loadfile --no-loadscope-reorder test --ignore=test/graph
	$(BIN)/python -m pytest -n auto --dist worksteal test/graph

oldest:  ## tests of what the oldest supported numpy, matplotlib, scipy and numba must do
	@test -x $(OLDEST)/bin/python || $(PYTHON) -m venv $(OLDEST)
	$(OLDEST)/bin/python -m pip install -q --disable-pip-version-check -c test/oldest.txt -e . \
	  pytest pytest-xdist hypothesis
	$(OLDEST)/bin/python -m pytest -n auto --dist loadfile test/snca_ros/comparison \
	  test/snca_ros/assessment/test_figures.py test/snca_ros/evolution/test_history.py \
	  test/sim_node/munk2d/test_soft_spring.py test/sim_node/numerics/test_code_cache.py \
	  test/sim_node/numerics/test_dispatch.py

bench: $(TOOLS)  ## speed of episodes, evolution and graphs, ratios first; writes bench.json
	$(BIN)/python -m benchmarks --json bench.json

docs: $(TOOLS)  ## fill the generated sections of docs/ anew, draw its figures and the architecture
	$(BIN)/python -m docs.refresh
	$(BIN)/python -m docs.draw_architecture
	$(BIN)/python -m docs.study_figures

api: $(TOOLS)  ## all docstrings as pages in build/api, by pdoc
	$(BIN)/python -m pip install -q --disable-pip-version-check pdoc
	$(BIN)/pdoc --docformat google --output-directory build/api \
	  sim_node snca_ros '!snca_ros.__main__'

pictures: $(TOOLS)  ## make the pictures of README and docs/ anew
	$(BIN)/snca render biped-U-nD-snn-h docs/walk.gif --start 8 --duration 6 --width 560
	$(BIN)/snca assess biped-U-nD-snn-h biped-U-D-mlp biped-nU-D-mlp --figure docs/robustness.png \
	  --faults loss=0..0.9..0.1 --faults delay=0..10 --faults sensor_noise=0..0.5 \
	  --faults death=0..1@5 --faults broken_actuators=frozen:0..1@5 \
	  --faults broken_sensors=random:0..1@5
	$(BIN)/python -m docs.concept_pictures

clean:  ## remove what the targets made, but neither runs nor bags
	rm -rf $(VENV) $(OLDEST) build *.egg-info .pytest_cache .mypy_cache .ruff_cache .hypothesis
