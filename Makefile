# Each target sets up what it needs: a fresh machine with Python >= 3.11 is enough; the simulator needs 3.11.
VENV := .venv
STAMP := $(VENV)/.installed
FITS := import sys, venv, ensurepip; sys.exit(sys.version_info < (3, 11))
PYTHON ?= $(shell for p in python3.11 python3 python3.13 python3.12; do \
	$$p -c "$(FITS)" 2>/dev/null && echo $$p && break; done)

.PHONY: demo test docs clean

demo: $(STAMP)  ## the whole robot in simulation, on fake serial ports
	$(VENV)/bin/lemtomap sim --out runs/demo

test: $(STAMP)  ## every check and every test
	PATH="$(CURDIR)/$(VENV)/bin:$$PATH" tools/check.sh

docs: $(STAMP)  ## the API reference, from the docstrings, in build/api
	$(VENV)/bin/python -m pip install --quiet --disable-pip-version-check --editable '.[docs]'
	PATH="$(CURDIR)/$(VENV)/bin:$$PATH" tools/api_reference.sh build/api

$(STAMP): pyproject.toml
	@test -n "$(PYTHON)" || { echo "needs Python 3.11 or newer with venv (Debian: apt install python3-venv)"; exit 2; }
	$(PYTHON) -m venv $(VENV)
	$(VENV)/bin/python -m pip install --quiet --disable-pip-version-check --editable '.[dev]'
	touch $@

clean:
	rm -rf $(VENV) build *.egg-info
