# make setup | demo | test | check | thorough | other-blas | colcon | wheels | bench | study | mutations | mutants | docs | pictures | grades | campaigns | lock : each does its own set-up and needs nothing before it.
PYTHON ?= python3
VENV   := .venv
BIN    := $(VENV)/bin
PIP    := $(BIN)/python -m pip install -qq --disable-pip-version-check --no-deps
SETUPS := $(wildcard src/*/setup.py study/setup.py)
# What runs, and what tests, builds and campaigns need beside it; every file by its hash.
RUN    := $(VENV)/.run
STAMP  := $(VENV)/.installed
TOOLS  := extras campaigns test build
BOOK   := $(VENV)/.book
OUT    ?= out/demo
PACKAGES := rate_table_sim sdimu_calibration sdimu_sim
NUMBER   := $(words $(PACKAGES))
# `make colcon COLCON_TEST="$(PACKAGES)"` repeats every test on what was installed; make test has run them already.
COLCON_TEST ?= rate_table_sim

export PATH := $(CURDIR)/$(BIN):$(PATH)
# Small matrices: a second thread of BLAS waits for its core longer than the work takes.
export OPENBLAS_NUM_THREADS ?= 1
# Where the environment forbids to keep bytecode, every process would compile 600 modules anew. Empty: not set.
export PYTHONDONTWRITEBYTECODE :=

setup: $(STAMP)

$(RUN): requirements/run.lock $(SETUPS)
	@test -x $(BIN)/python || { echo "making $(VENV)" && $(PYTHON) -m venv $(VENV); }
	@$(BIN)/python requirements/install.py run
	@echo "installing the three packages of src"
	@$(PIP) --no-build-isolation --use-pep517 $(foreach package,$(PACKAGES),-e src/$(package))
	@touch $@

# Beside the lock files of tools: the studies, which are no part of what users install.
$(STAMP): $(RUN) $(TOOLS:%=requirements/%.lock)
	@$(BIN)/python requirements/install.py $(TOOLS)
	@$(PIP) --no-build-isolation --use-pep517 -e study
	@touch $@

$(BOOK): $(STAMP) requirements/docs.lock
	@$(BIN)/python requirements/install.py docs
	@touch $@

# A whole simulated test over DDS, from the table to report.html.
demo: $(RUN)
	$(BIN)/sdimu run --replace --out $(OUT)

# Style, types and the direction of imports.
check: setup
	$(MAKE) --no-print-directory -j 2 --output-sync=target check-style check-types

check-style: setup
	$(BIN)/ruff check .
	$(BIN)/ruff format --check -q .
	$(BIN)/lint-imports

check-types: setup
	$(BIN)/mypy $(foreach package,$(PACKAGES),src/$(package)/$(package)) study/sdimu_study

# What every change must pass at once: some minutes. A file's tests stay on one worker, which makes its fixtures once;
# the longest files come first (test/sharing.py). All tests run with the kernels of OpenBLAS for AVX2, on a machine that
# has others, too: the same digits wherever a test runs.
test: export OPENBLAS_CORETYPE = Haswell
test: check-style
	$(MAKE) --no-print-directory -j 2 check-types test-run

# Types keep one core busy for half a minute: the tests go on beside them.
test-run: setup
	$(BIN)/python -m pytest -n 2 --dist loadfile -m "not thorough and not slow and not bench"

# The rest of what must hold (test/tiers.py): tutorials, browser, faults, damaged files, nodes over DDS, campaigns.
# Nodes wait for each other more than they work: they run beside what keeps both cores busy.
thorough: setup
	$(MAKE) --no-print-directory -j 2 --output-sync=target thorough-nodes thorough-rest

thorough-nodes thorough-rest: export OPENBLAS_CORETYPE = Haswell
# Targets that run side by side, each in ROS domains of its own; a run that looks for a free domain takes none of these.
thorough-rest: export SDIMU_FIRST_DOMAIN = 215
thorough-nodes: export SDIMU_FIRST_DOMAIN = 219
other-blas: export SDIMU_FIRST_DOMAIN = 223
colcon: export SDIMU_FIRST_DOMAIN = 227
# Three folders hold all of them: to import the others would take each worker 5 s.
thorough-nodes: setup
	$(BIN)/python -m pytest -n 2 --dist loadfile -m "thorough and ros and not slow and not bench" test/ros test/book test/browser

# Behind the nodes where both wait for a core: a node that gets none for long is taken for dead by the others.
thorough-rest: setup
	nice -n 10 $(BIN)/python -m pytest -n 2 --dist loadfile -m "thorough and not ros and not slow and not bench"

# What linear algebra decides, with other kernels of OpenBLAS (without AVX) than in `test` and `thorough`: no test stands on
# the last digits of a library. The quick tests alone: the long ones hold with the kernels that users have.
NUMERICAL := $(addprefix test/sdimu_calibration/core/,alignment batch/test_chain.py diagnosis/test_diagnose.py \
    estimation/test_inseparable.py estimation/test_prior_check.py evidence/test_influence.py evidence/test_signatures.py \
    filter/test_kalman.py fleet/test_population.py fleet/test_reml.py joint/test_combine.py joint/test_held_out.py \
    joint/test_reduction.py plan_search/test_known.py planning/test_observability.py test_probability.py)

other-blas: export OPENBLAS_CORETYPE = Nehalem
other-blas: setup
	nice -n 10 $(BIN)/python -m pytest -n 2 --dist loadfile -m "not thorough and not slow and not bench" $(NUMERICAL)

# As a user of ROS would: build the three packages, test what was installed, and run a launch file of it outside the
# repository (by the stand-in for ros2/launch, which is no wheel). Its test of 19 s runs the loops as Python: to compile
# them anew takes a minute, and test/ros/test_ros_machine.py does so in such an installation.
colcon: setup
	work=$$(mktemp -d) && trap 'rm -rf "$$work"' EXIT && \
	test "$$(colcon --log-base $$work/log list --base-paths src | grep -c '(ros.ament_python)')" -eq $(NUMBER) && \
	colcon --log-base $$work/log build --base-paths src --build-base $$work/build --install-base $$work/install && \
	colcon --log-base $$work/log test --base-paths src --build-base $$work/build \
	    --install-base $$work/install --python-testing pytest --return-code-on-test-failure \
	    --packages-select $(COLCON_TEST) \
	    --pytest-args -q -m "not slow and not bench and not ros" && \
	printf '%s\n' 'format: sdimu-plan/1' 'dwell: 8 s' 'rate: 30 deg/s' 'acceleration: 60 deg/s^2' \
	    'turns: [{axis: Y, angle: 90 deg}]' > $$work/plan.yaml && cp test/ros/launch_stub.py $$work && cd / && \
	NUMBA_DISABLE_JIT=1 ROS_DOMAIN_ID=231 ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST ROS_LOG_DIR=$$work/log $(CURDIR)/$(BIN)/python \
	    $$work/launch_stub.py $$work/install sdimu_sim simulation_launch.py plan:=$$work/plan.yaml out:=$$work/run \
	    drive:=plan allow_motion:=true && test -s $$work/run/result.json

# For a machine without a clone: pip install out/wheels/*.whl brings `sdimu`, its config files and what it needs to run.
wheels: $(RUN)
	work=$$(mktemp -d) && trap 'rm -rf "$$work"' EXIT && cp -r LICENSE config src "$$work" && rm -rf "$$work"/src/*/build && \
	$(BIN)/python -m pip wheel -qq --disable-pip-version-check --no-deps --no-build-isolation -w out/wheels \
	    $(foreach package,$(PACKAGES),"$$work/src/$(package)")

# How fast: samples a second, bags, start of the command line.
bench: setup
	$(BIN)/python -m pytest -m bench -s

# Many runs: is sigma honest, is the bias zero. Minutes to hours.
study: setup
	$(BIN)/python -m pytest -n 2 -m slow --timeout 0

# Quarter of an hour: 15,900 damaged files of every format; SDIMU_MUTATIONS=N for N of each.
mutations: setup
	$(BIN)/python -m pytest test/mutation -m slow -s --timeout 0

# A quarter of an hour: is a core that was made wrong in one place noticed by `make test`?
mutants: setup
	$(BIN)/python test/mutants.py

# What the book needs to be made.
docs-setup: $(BOOK)

# The book, out/docs/index.html: it is read without a network. Every warning is an error.
docs: $(BOOK)
	nice -n 10 $(BIN)/python -m sphinx -W --keep-going -q -b html doc out/docs

# Minutes: every kind of fault in the data at five sizes.
faults: setup
	$(BIN)/sdimu study faults --out out/study-faults && cp out/study-faults/faults.md doc/faults.md

# Hours: every IMU file, clean and with one hidden effect.
grades: setup
	$(BIN)/sdimu study grades --out out/study-grades && cp out/study-grades/grades.md doc/grades.md

# The pictures of the README, from a run with a hidden effect.
pictures: setup
	$(BIN)/sdimu simulate --plan kim18_signed --seed 7 --effect "gyro_scale_asymmetry_y=40 ppm" --replace \
	    --out out/pictures/bag
	$(BIN)/sdimu pictures out/pictures/bag --out doc/pictures

campaigns: setup
	$(BIN)/sdimu monte-carlo -n 200 --out out/monte-carlo
	$(BIN)/sdimu hidden-campaign -n 200 --out out/hidden-campaign

# The lock files anew, from what is installed: after `.venv/bin/pip install` of something newer.
lock: setup
	$(BIN)/python requirements/lock.py
	$(BIN)/python requirements/vendored.py

.PHONY: setup demo check check-style check-types test test-run thorough thorough-nodes thorough-rest other-blas colcon wheels bench study mutations mutants docs docs-setup faults grades pictures campaigns lock
