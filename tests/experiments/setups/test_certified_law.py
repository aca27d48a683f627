"""Gains and width that the certificate of a mode uses."""

import numpy as np
import pytest

from experiments.config.options import run_config
from experiments.setups.certified_law import certified_laws


def test_convolved_bunny_is_certified_with_its_effective_gains():
    law = certified_laws(run_config(mode="bunny", bunny_attraction="convolution"))[""]
    assert law.stiffness == pytest.approx(300.0 / 2.0**2.5)
    assert law.damping == pytest.approx(8.0 / 2.0**1.5)
    assert law.width == pytest.approx(0.05 * np.sqrt(2.0))
