"""MuJoCo is an optional dependency."""

import pytest

pytest.importorskip("mujoco")
