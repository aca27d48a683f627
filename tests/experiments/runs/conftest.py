import pytest

import hvf


@pytest.fixture(scope="module")
def sim() -> hvf.Simulation:
    """A relaxed hand on a circle, without a figure."""
    curve = hvf.circle(lap=2.0)
    return hvf.Simulation(
        field=hvf.Follow(curve, k_r=300, b_d=8), haptic_map=hvf.Cylindrical(hvf.clips("cheer"), around=curve),
        figure=hvf.Figure(kind="none"),
    )  # fmt: skip
