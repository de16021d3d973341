# Each target sets up what it needs: a fresh machine with Python >= 3.11 is enough.
PYTHON ?= python3
VENV := .venv
STAMP := $(VENV)/.installed

.PHONY: demo test check clean

demo: $(STAMP)  ## the whole robot in simulation, on fake serial ports
	$(VENV)/bin/lemtomap sim --out runs/demo

test: $(STAMP)  ## every check and every test
	PATH="$(CURDIR)/$(VENV)/bin:$$PATH" tools/check.sh

$(STAMP): pyproject.toml
	$(PYTHON) -m venv $(VENV)
	$(VENV)/bin/python -m pip install --quiet --disable-pip-version-check --editable '.[dev]'
	touch $@

clean:
	rm -rf $(VENV) build *.egg-info
