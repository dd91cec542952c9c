# make setup | demo | test | check | bench : each does its own set-up and needs nothing before it.
PYTHON ?= python3
VENV   := .venv
BIN    := $(VENV)/bin
STAMP  := $(VENV)/.installed

setup: $(STAMP)

$(STAMP): requirements.lock src/sdimu_calibration/setup.py src/sdimu_sim/setup.py src/rate_table_sim/setup.py
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps -r requirements.lock
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation --use-pep517 \
	    -e src/sdimu_calibration -e src/rate_table_sim -e src/sdimu_sim
	touch $@

.PHONY: setup
