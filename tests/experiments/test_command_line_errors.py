"""Mistakes on the command line: one line on stderr that names the option and what would be right, exit code 2."""

import shutil
from pathlib import Path

import pytest

from tests.experiments.refused_command import refused

ROOT = Path(__file__).resolve().parents[2]
WALK = ROOT / "models" / "mocap" / "clips" / "walk.bvh"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["run", "--seed", "9" * 23], "--seed is 99999999999999999999999; expected less than 9223372036854775808"),
        (["lift", "walk", "--seed", "9" * 23], "--seed is 99999999999999999999999; expected less than"),
        (["lift", "walk", "--out", "map.txt"], "a map is written into a .npz file"),
        (["lift", "walk", "nobody"], "no embedded clip 'nobody'"),
        (["lift", "walk", "--cyclic", "run"], "cyclic names run; expected some of the clips"),
        (["lift", "walk", "--room.r-range", "0.02", "0.3"], "the Phantom"),
        (["lift", "walk", "run", "--room.separation", "0.2"], "2 clips do not fit 200 mm apart"),
        (["run", "--out", ""], "nothing is given after --out; expected a value"),
        (["run", "--out="], "nothing is given after --out; expected a value"),
        (["run", "--seconds", "1e12"], "--seconds is 1e+12: a recording of 4e+05 TB or more, and "),
        (["run", "--seconds", "1e12", "--user", "push"], "--seconds is 1e+12: a recording of"),
        (["run", "--mode", "stretch", "--lap", "0.01"], "--lap is 0.01; expected 0.1 s or more"),
        (["run", "--mode", "stretch", "--lap", "0.8"], "expected --lap 1.1 or more, or --bump 0.39 or less"),
        (["run", "--stiffness", "-5"], "--stiffness is -5; expected 0 N/m or more"),
        (["run", "--stiffness", "1e308"], "--stiffness is 1e+308; expected at most"),
        (["run", "--damping", "1e308"], "--damping is 1e+308; expected at most"),
        (["run", "--reach", "0.2"], "expected less than 0.0467 m"),
        (["run", "--radius", "0.3"], "beyond the Phantom's stops"),
        (["run", "--mode", "stretch", "--user", "trace"], "--user relaxed, push or turn"),
        (["run", "--mode", "lead", "--user", "trace"], "leave out --user trace\n"),
        (["run", "--mode", "lead", "--clips", "walk", "run"], "got 2 --clips; expected one to lead"),
        (["run", "--mode", "lead", "--clips", "cheer"], "hvf: a clip that is led must go somewhere"),
        (["run", "--walls", "--wall-margin", "0.3"], "--wall-margin is 0.3 rad; expected at most 0.261 rad"),
        (["run", "--smoothing", "1000"], "1000"),
        (["run", "--physics-step", "0.0003"], "does not divide"),
        (["run", "--stature", "9"], "stature"),
        (["run", "--mass", "1"], "mass"),
        (["run", "--figure", "ghost"], "hvf: --figure is 'ghost'; expected physical, kinematic, none\n"),
        (["run", "--clips", "moonwalk"], "squat_dance"),
        (["run", "--clips", "no/such/file.bvh"], "no/such/file.bvh"),
        (["run", "--clips", *["cheer"] * 5], "1 to 4"),
        (["run", "--map", "no/map.npz"], "no/map.npz: cannot be read (No such file or directory); expected the .npz"),
        (["run", "--map", "robot-arm", "--lap", "1e-9"], "--lap is 1e-09; expected 0.1 s or more, and finite"),
        (["run", "--map", "robot-arm", "--radius", "5"], "the Phantom does not reach (4.330, 0.000, 2.500) m of the"),
        (["run", "--lap", "1e10", "--clips", "walk", "run"], "--lap is 1e+10; expected at most 86400 s"),
        (["run", "--mode", "lead", "--floor-scale", "1e14"], "--floor-scale is 1e+14; expected at most 10000"),
        (["live", "--stiffness", "-1"], "--stiffness is -1"),
        (["certify", "--stiffness", "-1"], "--stiffness is -1"),
        (["certify", "--hand-push", "-1"], "--hand-push is -1; expected 0 N or more"),
        (["certify", "--hand.stiffness", "0", "1e300"], "stiffness of a hand must be at most 1e+06, got 1e+300"),
        (["certify", "--hand.mass", "0", "1e9"], "mass of a hand must be at most 1000, got 1e+09"),
        (["certify", "--delay", "3"], "the delay of a loop must be at most 128 periods of 0.001 s, got 3.0 s"),
        (["certify", "--map", "no/map.npz"], "no/map.npz: cannot be read"),
        (["certify", "--clip", "jump", "--friction", "0"], "--friction is 0"),
        (["track", "walk", "--seconds", "-1"], "--seconds is -1"),
        (["lift", "walk", "--seed", "-1"], "--seed is -1"),
        (["hardware", "doctor", "--seconds", "1e12"], "--seconds is 1e+12; expected at most 3600 s"),
        (["hardware", "calibrate", "--seconds", "1e12"], "--seconds is 1e+12; expected at most 3600 s"),
        (["run", "--stiffness", "abc"], "--stiffness is 'abc'; expected a number; hvf run --help"),
        (["run", "--seed", "1.5"], "--seed is '1.5'; expected a whole number; hvf run --help"),
        (["run", "--crossing", "sideways"], "--crossing is 'sideways'; expected discrete, smooth, sum; hvf run"),
        (["run", "--mode"], "nothing is given after --mode; expected a value; hvf run --help"),
        (["run", "--clips"], "nothing is given after --clips; expected one or more names"),
        (["live", "--clips", "--mode", "lead"], "nothing is given after --clips; expected one or more names"),
        (["live", "--clips", "nope.bvh"], "nope.bvh: cannot be opened (No such file or directory)"),
        (["live", "--map", "nope.npz"], "nope.npz: cannot be read (No such file or directory)"),
        (["--tyro-print-completion", "tcsh"], "--tyro-print-completion is 'tcsh'; expected bash, zsh, fish"),
        (["run", "--tyro-print-completion"], "--tyro-print-completion is ''; expected bash, zsh, fish"),
        (["run", "--bogus", "1"], "unrecognized options: --bogus, 1; hvf run --help"),
        (
            ["run", "--up", "-X"],
            "unrecognized options: --up=-X; hvf prepare takes --up, and writes a BVH file for hvf run",
        ),
        (["certify", "--no-no-hand"], "unrecognized options: --no-no-hand"),
        (["run", "--no-governor"], "unrecognized options: --no-governor"),
        (["run", "--stifness", "3"], "--stifness, 3; perhaps --stiffness is meant; hvf run --help lists the options"),
        (["bogus"], "no such command: bogus; expected one of demo, run, live, "),
        (["hardware", "lst"], "no such command: lst; expected one of list, doctor, run, calibrate, identify; hvf hard"),
        (["hardware"], "expected one of {list, doctor, run, "),
        (
            ["convert"],
            "missing from hvf convert: PATH (Motion file to read), PATH (File to write: .bvh, or .glb for glTF)",
        ),
        (
            ["picture", "run", "--fine", "run.png"],
            "missing from hvf picture: PATH, or an option is mistyped; hvf picture",
        ),
        (["live", "--port", "99999999"], "--port is 99999999; expected less than 65536"),
        (["convert", "nowhere.bvh", "x.bvh"], "hvf: nowhere.bvh: cannot be opened (No such file or directory)"),
        (["convert", "walk.bvh", "x.fbx"], "only BVH and glTF can be written; expected a name that ends in .bvh, .glb"),
        (["track", "nowhere.bvh"], "hvf: nowhere.bvh: cannot be opened (No such file or directory)"),
        (["run", "--clips", "nowhere.amc"], "/nowhere.amc: cannot be opened (No such file or directory)"),
    ],
)
def test_mistake_is_refused_in_one_line(
    arguments: list[str],
    message: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    assert message in refused(arguments, capsys)
    assert not list(tmp_path.iterdir())


def test_motion_file_of_unsupported_format_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    shutil.copy(WALK, tmp_path / "walk.fbx")
    stderr = refused(["convert", str(tmp_path / "walk.fbx"), str(tmp_path / "out.bvh")], capsys)
    assert "walk.fbx: .fbx files are not read; expected BVH, AMC (with its ASF beside it) or DeepMimic JSON" in stderr
    assert "Blender imports it and exports BVH" in stderr
