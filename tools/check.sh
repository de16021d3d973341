#!/usr/bin/env bash
# Everything that must hold before a change lands; CI runs the same.
set -euo pipefail
cd "$(dirname "$0")/.."
export PYTHONPATH="$PWD${PYTHONPATH:+:$PYTHONPATH}"
step() { printf '\n== %s\n' "$*"; "$@"; }
step ruff check .
step ruff format --check .
step mypy
step lint-imports --no-cache
step python -m pytest -n "${LEMTOMAP_TEST_JOBS:-2}" "$@"
