"""The unit that a format defines, beside the length of the legs in it."""

import pytest

from models.mocap.library import load
from tests.models.mocap.readers.motion_files import AMC, ASF

NO_HUMANS = "which are no human's: the file's unit is another"


@pytest.mark.parametrize(("length", "human"), [("0.45", True), ("0.01", False), ("45", False), ("1", True)])
def test_a_stated_unit_in_which_the_legs_are_no_humans_is_called_another(tmp_path, length, human):
    (tmp_path / "1.asf").write_text(ASF.replace("length 0.45", f"length {length}"))
    (tmp_path / "1_1.amc").write_text(AMC)
    report = load(tmp_path / "1_1.amc").report
    assert report is not None
    assert "(the format says so), legs" in report.unit
    assert (NO_HUMANS in report.unit) != human
