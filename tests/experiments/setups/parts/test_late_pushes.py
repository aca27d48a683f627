"""Remarks on the actions of a simulated hand."""

import pytest

from experiments.config.run_config import User
from experiments.setups.parts.hands import late_remark
from sim.users.hand.actions import Push


@pytest.mark.parametrize(
    ("at", "remarks"),
    [
        ((), ()),
        ((4.9, 7.0), ()),
        ((7.0, 5.0), ("the first push is at 5 s, after the run's end; give --seconds more than that",)),
    ],
)
def test_pushes_that_all_lie_past_the_end_are_reported(at: tuple[float, ...], remarks: tuple[str, ...]) -> None:
    user = User(does="push", pushes=tuple(Push(start, 0.5, 2.0) for start in at))
    assert late_remark(user, 5.0) == remarks
