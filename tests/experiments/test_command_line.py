"""The `hvf` command with bad input: one line on stderr, exit code 2, nothing lost."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from experiments.cli import main, parse_command
from tests.experiments.refused_command import refused


def test_configuration_without_clips_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "mine.json"
    file.write_text('{"map": {"kind": "cylindrical", "clips": []}}', encoding="utf-8")
    stderr = refused(["run", "--config", str(file), "--out", str(tmp_path / "out")], capsys)
    assert "got 0 --clips; expected 1 to 4 for the cylindrical map" in stderr


@pytest.mark.parametrize("command", [["lift", "walk", "--out"], ["prepare", "missing.bvh"]])
def test_unwritable_target_is_refused_before_anything_is_computed(
    command: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("experiments.lifting.lift_report.lift_clips", lambda *_: pytest.fail("clips were lifted"))
    (tmp_path / "file").write_text("no folder")
    end = ".npz" if command[0] == "lift" else ".bvh"
    stderr = refused([*command, str(tmp_path / "file" / f"target{end}")], capsys)
    assert str(tmp_path / "file") in stderr
    assert "missing" not in stderr
    assert "Errno" not in stderr


@pytest.mark.skipif(not Path("/proc/self").exists(), reason="this system has no /proc")
def test_output_on_a_file_system_without_size_is_not_reported_as_full(capsys: pytest.CaptureFixture[str]) -> None:
    """It is refused before anything is compiled, about which the error output would say a line."""
    stderr = refused(["run", "--figure", "none", "--seconds", "1", "--out", "/proc/nowhere"], capsys)
    assert stderr.startswith("hvf: /proc/nowhere: ")
    assert "free" not in stderr


def test_folder_made_in_order_to_see_whether_it_can_be_written_does_not_remain(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "new" / "run"
    refused(["run", "--figure", "none", "--map", "missing.npz", "--out", str(out)], capsys)
    assert not (tmp_path / "new").exists()


def test_folder_with_a_run_is_kept_unchanged(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "run.h5").write_bytes(b"precious")
    assert "--overwrite" in refused(["run", "--out", str(tmp_path)], capsys)
    assert (tmp_path / "run.h5").read_bytes() == b"precious"


def test_invalid_option_with_overwrite_keeps_the_old_run(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "run.h5").write_bytes(b"precious")
    refused(["run", "--out", str(tmp_path), "--overwrite", "--stiffness", "-1"], capsys)
    assert (tmp_path / "run.h5").read_bytes() == b"precious"


def test_output_folder_that_is_a_file_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "out").write_text("a file")
    assert "is a file" in refused(["run", "--out", str(tmp_path / "out")], capsys)


@pytest.mark.parametrize("command", ["report", "reproduce"])
def test_folder_without_a_run_is_refused(command: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert "run.h5" in refused([command, str(tmp_path)], capsys)
    (tmp_path / "run.h5").write_bytes(b"not HDF5")
    assert "run.h5" in refused([command, str(tmp_path)], capsys)


def test_invalid_motion_file_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    source = tmp_path / "bad.bvh"
    source.write_text("HIERARCHY\nROOT hips\n{\n")
    assert "bad.bvh:" in refused(["convert", str(source), str(tmp_path / "out.bvh")], capsys)


def test_converted_file_is_not_replaced_without_overwrite(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from models.mocap.library import embedded
    from models.mocap.readers.own_bvh import write_bvh

    source, target = tmp_path / "in.bvh", tmp_path / "out.bvh"
    write_bvh(embedded("cheer"), source)
    assert main(["convert", str(source), str(target)]) == 0
    before = target.read_bytes()
    assert "--overwrite" in refused(["convert", str(source), str(target)], capsys)
    assert target.read_bytes() == before


@pytest.mark.parametrize("command", ["convert", "prepare"])
def test_negative_axis_is_parsed_as_option_value(command: str) -> None:
    assert parse_command([command, "in.bvh", "out.bvh", "--up", "-Y"]).up == "-Y"
    assert parse_command([command, "--up=-Z", "in.bvh", "out.bvh"]).up == "-Z"


@pytest.mark.slow
def test_closed_pipe_ends_the_command_silently_with_code_141(tmp_path: Path) -> None:
    from models.mocap.library import embedded
    from models.mocap.readers.own_bvh import write_bvh

    write_bvh(embedded("cheer"), tmp_path / "in.bvh")
    for arguments in (["--help"], ["convert", str(tmp_path / "in.bvh"), str(tmp_path / "out.bvh")]):
        reading, writing = os.pipe()
        os.close(reading)
        try:
            command = [sys.executable, "-m", "experiments.cli", *arguments]
            completed = subprocess.run(command, stdout=writing, stderr=subprocess.PIPE, check=False, timeout=60)
        finally:
            os.close(writing)
        assert completed.returncode == 141
        assert completed.stderr == b""


@pytest.mark.parametrize("closed", ["stdin", "stdout", "stderr"])
@pytest.mark.slow
def test_closed_standard_stream_affects_neither_result_nor_exit_code(closed: str, tmp_path: Path) -> None:
    from models.mocap.library import embedded
    from models.mocap.readers.own_bvh import write_bvh

    write_bvh(embedded("cheer"), tmp_path / "in.bvh")
    number = ["stdin", "stdout", "stderr"].index(closed)
    main_of = f"import os, sys; os.close({number}); os.execv(sys.executable, [sys.executable, *sys.argv[1:]])"
    command = ["-m", "experiments.cli", "convert", str(tmp_path / "in.bvh"), str(tmp_path / "out.bvh")]
    completed = subprocess.run([sys.executable, "-c", main_of, *command], capture_output=True, check=False, timeout=60)
    assert completed.returncode == 0, completed.stderr
    assert (tmp_path / "out.bvh").read_text(encoding="utf-8").startswith("HIERARCHY")


def test_interrupt_during_imports_is_one_line() -> None:
    """Also if the module being imported converts the exception, as MuJoCo does."""
    code = "import os, signal, experiments.console.startup\n"
    code += "try: os.kill(os.getpid(), signal.SIGINT)\nexcept BaseException: raise ImportError('initialization failed')"
    completed = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False, timeout=60)
    assert completed.stderr == "hvf: stopped; no partial files are left\n"
    assert completed.returncode == 130


@pytest.mark.slow
def test_mujoco_warnings_are_counted_by_commands_and_left_to_library_users(tmp_path: Path) -> None:
    """A command neither prints it nor writes MuJoCo's log into the user's folder."""
    code = (
        "import hvf, mujoco; print(mujoco.get_mju_user_warning())\nfrom experiments.cli import main; main(['clips'])\n"
    )
    code += "from sim.world.world import World; world = World(kind='none'); world.data.qvel[:] = 1e30\n"
    code += "mujoco.mj_checkVel(world.model, world.data); print(world.warnings())"
    completed = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, env=os.environ | {"PYTHONPATH": str(Path.cwd())},
        capture_output=True, text=True, check=True, timeout=60,
    )  # fmt: skip
    assert (completed.stdout.splitlines()[0], completed.stdout.splitlines()[-1]) == ("None", "{'badqvel': 1}")
    assert completed.stderr == ""
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("first", ["from experiments.cli import main; main(['clips'])", "import hvf"])
@pytest.mark.slow
def test_missing_library_for_mujoco_gl_is_named_and_skipped(first: str) -> None:
    code = "import ctypes.util; ctypes.util.find_library = lambda name: None\n"
    code += f"{first}; import os; print(os.environ.get('MUJOCO_GL'))"
    completed = subprocess.run(
        [sys.executable, "-c", code], env=os.environ | {"MUJOCO_GL": "osmesa"}, capture_output=True, text=True,
        check=True, timeout=60,
    )  # fmt: skip
    assert completed.stderr.splitlines()[0] == (
        "MUJOCO_GL is 'osmesa', and libOSMesa is not on this machine: ignored; unset it, or apt-get install libosmesa6"
    )
    assert completed.stdout.split()[-1] in ("None", "disable")


def test_interrupted_device_run_names_its_recording(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(*_: object) -> None:
        (tmp_path / "run.h5").write_bytes(b"")
        raise KeyboardInterrupt

    monkeypatch.setattr("experiments.hardware.run.run_hardware", interrupted)
    assert main(["hardware", "run", "--device", "emulated", "--out", str(tmp_path)]) == 130
    assert f"hvf report {tmp_path} writes its page" in capsys.readouterr().err


@pytest.mark.parametrize("name", ["picture.foo", "picture", "folder.png"])
def test_non_png_picture_is_refused(name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "folder.png").mkdir()
    assert "ends in .png" in refused(["picture", str(tmp_path), str(tmp_path / name)], capsys)


def test_existing_picture_is_kept(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "mine.png").write_bytes(b"mine")
    assert "exists and is left" in refused(["picture", str(tmp_path), str(tmp_path / "mine.png")], capsys)
    assert (tmp_path / "mine.png").read_bytes() == b"mine"


def test_film_too_large_for_encoders_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert "8192 at most" in refused(["render", str(tmp_path), "--width", "1000000"], capsys)
