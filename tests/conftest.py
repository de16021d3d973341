"""Tests that need the simulator's physics are skipped, with the reason, where pybullet is not installed."""

import importlib.machinery
import sys
from importlib.util import find_spec

import pytest


class SkipWithoutPhysics:
    """Stands in for pybullet: whoever imports it is skipped, a whole module or one test."""

    def find_spec(self, name, _path=None, _target=None):
        return importlib.machinery.ModuleSpec(name, self) if name == "pybullet" else None

    def create_module(self, _spec):
        pytest.skip("the simulator needs pybullet", allow_module_level=True)

    def exec_module(self, _module):
        """Never reached."""


if find_spec("pybullet") is None:
    sys.meta_path.append(SkipWithoutPhysics())
