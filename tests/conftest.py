"""Shared fixtures, and shape checks that only tests pay for."""

from __future__ import annotations

import os

os.environ.setdefault("MPLBACKEND", "agg")

from hypothesis import HealthCheck, settings
from jaxtyping import install_import_hook

import tests.shape_check  # noqa: F401  (the hook looks it up by attribute)

# Kernels are left out: a check wrapped around them would have to be compiled with them.
CHECKED = ["volume"]
install_import_hook([f"softreach.{name}" for name in CHECKED], "tests.shape_check.check")

import numpy as np
import pytest

from softreach.arm import designs
from softreach.arm.manipulator import Manipulator
from tests.browser import browser  # noqa: F401  (a fixture)

settings.register_profile(
    "ci",
    derandomize=True,
    deadline=None,  # the first call compiles
    max_examples=25,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.function_scoped_fixture],
)
settings.load_profile("ci")


@pytest.fixture(scope="session")
def trunk() -> Manipulator:
    """The paper's best design."""
    return designs.minimal_trunk()


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(7)
