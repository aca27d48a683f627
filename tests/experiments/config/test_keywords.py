"""Messages from Python name keyword arguments where those of the command line name options."""

import warnings
from pathlib import Path

import pytest

import hvf
from controllers.errors import ParameterError
from experiments.cli import main
from experiments.config.keywords import in_keywords, keywords
from experiments.config.words import run_config

CURVE = hvf.circle()
SIM = hvf.Simulation(
    field=hvf.Follow(CURVE, k_r=300, b_d=8), haptic_map=hvf.Cylindrical(hvf.clips("cheer"), around=CURVE),
    figure=hvf.Figure(kind="none"),
)  # fmt: skip


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("--wall-margin is 3 rad", "wall_margin is 3 rad"),
        ("expected --lap 1.1 or more, or --bump 0.24.", "expected lap=1.1 or more, or bump=0.24."),
        ("--residual-force 1e-05 has no meaning", "residual_force=1e-05 has no meaning"),
        ("leave out --user push; with --figure none", 'leave out user="push"; with figure="none"'),
        ("--map FILE.npz, --mode follow, --governor", 'map FILE.npz, mode="follow", governor'),
        ("choose another --out, or --overwrite it", "choose another record, or overwrite it"),
        ("as `hvf run --help` has them, or --threads", "as `hvf run --help` has them, or threads"),
        ("a hand -- and a file a--b-c.bvh", "a hand -- and a file a--b-c.bvh"),
        ("0.4 m --> 0.5 m", "0.4 m --> 0.5 m"),
    ],
)
def test_an_option_is_named_as_the_keyword_that_it_is(text: str, said: str) -> None:
    assert keywords(text, out="record") == said


def test_the_kind_of_an_error_and_where_it_was_raised_stay() -> None:
    @in_keywords()
    def fails() -> None:
        raise ParameterError("--lap is 0; expected more")

    with pytest.raises(ParameterError, match=r"^lap is 0; expected more$") as raised:
        fails()
    assert raised.traceback[-1].name == "fails"


def test_what_python_is_told_is_in_keywords_and_the_command_line_in_options(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "run.h5").write_bytes(b"precious")
    words = {"figure": "none", "seconds": 1.0}
    for begin in (lambda: SIM.run(1.0, record=tmp_path), lambda: hvf.run(record=tmp_path, **words)):
        with pytest.raises(hvf.SimError, match=r"holds a run; choose another record, or overwrite it$"):
            begin()
    assert main(["run", "--figure", "none", "--seconds", "1", "--out", str(tmp_path)]) == 2
    assert "choose another --out, or --overwrite it" in capsys.readouterr().err
    for given, said in (
        ({"foo": 3}, "^foo is not known; there are "),
        (
            {"figure": "none", "smoothing": 6.0},
            '^smoothing=6.0 has no meaning with figure="none"; it belongs',
        ),
        ({"mode": "lead", "clips": ["walk", "run"]}, "expected clips of one, such as walk or run$"),
        ({"stiffness": -1.0}, "^stiffness is -1; expected 0 N/m or more"),
    ):
        with pytest.raises(hvf.ParameterError, match=said):
            hvf.run(**given)
    with pytest.raises(hvf.ParameterError, match=r"^--foo is not known; there are "):
        run_config(foo=3)
    with pytest.raises(hvf.ParameterError, match=r"got 0; expected so many clips$"):
        hvf.Cylindrical([], around=CURVE)


def test_remarks_of_a_run_are_in_keywords() -> None:
    turns = hvf.run(user="turn", figure="none", seconds=0.1)
    assert any(remark.endswith("this map does not look at that; expressive does") for remark in turns.remarks)
    assert "--" not in str(turns)


def test_what_a_prepared_capture_is_not_is_warned_of_in_keywords(monkeypatch: pytest.MonkeyPatch) -> None:
    class Found:
        feasible, remarks, clip = False, ("not feasible; --raw takes the capture as it is",), SIM

    monkeypatch.setattr("experiments.public.prepared_clips", lambda *given: (Found(),))
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        hvf.load("mine.bvh")
    assert [str(one.message) for one in said] == ["not feasible; raw takes the capture as it is"]
    assert said[0].filename == __file__
