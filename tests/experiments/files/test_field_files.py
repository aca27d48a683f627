"""Field files: exact round trip, and refusal of other files."""

import numpy as np
import pytest

from controllers.curves.trajectory import Trajectory
from controllers.fields.bundle import RiverBundle
from controllers.fields.edited import Edited, performance
from controllers.fields.river import River
from experiments.files.field_files import load_field, save_field
from sim.errors import SimError

CIRCLE = Trajectory.circle(0.05, 4.0)
FIELDS = [
    RiverBundle((River(CIRCLE), River(CIRCLE, np.inf, speeds=[[0.0, 0.1], [0.05, 0.2]])), ("a river/one", "../two")),
    Edited(River(CIRCLE), (performance(CIRCLE.times, 1.1 * CIRCLE.positions),), (0.5,), pace="wait"),
]


@pytest.mark.parametrize("field", FIELDS, ids=lambda field: type(field).__name__)
def test_field_round_trips_exactly_through_its_file(field, tmp_path):
    path = tmp_path / "field.npz"
    save_field(field, path)
    again = load_field(path)
    assert type(again) is type(field)
    for key, value in field.arrays().items():
        np.testing.assert_array_equal(again.arrays()[key], value)
    np.testing.assert_array_equal(again.program().params, field.program().params)


def test_non_field_file_is_refused_by_name(tmp_path):
    text = tmp_path / "text.npz"
    text.write_text("no archive")
    other, cut, odd = (tmp_path / name for name in ("other.npz", "cut.npz", "odd.npz"))
    np.savez(other, a=np.zeros(3))
    save_field(FIELDS[0], cut)
    cut.write_bytes(cut.read_bytes()[:200])
    np.savez(odd, kind=np.array("Edited"), keys=np.array(["edited"]), **{"0": np.zeros(3)})
    for path in (text, other, cut, odd):
        with pytest.raises(SimError, match=path.name):
            load_field(path)
    what = r"missing\.npz: cannot be read \(No such file or directory\); expected the \.npz file of a field"
    with pytest.raises(SimError, match=what):
        load_field(tmp_path / "missing.npz")
