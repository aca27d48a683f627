"""A recorded hand in place of a device: it moves as recorded, and incompatible options are refused by name."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import hvf
from experiments.cli import main
from experiments.config.options import run_config, with_options
from experiments.config.part import from_dict
from experiments.config.run_config import RunConfig, User
from experiments.runs.reproduce import reproduce
from experiments.setups.wiring import wire
from sim.errors import SimError
from sim.recording.recording import Recording
from tests.experiments.runs.simulations import CURVE, simulation

SECONDS = 1.5  # longer than the settling time of a released hand
HAND = ("t", "p", "quaternion", "v", "omega", "switch")
DEVICE_ALONE = hvf.Figure(kind="none")


def follow(k_r: float) -> hvf.Law:
    return hvf.Follow(CURVE, k_r=k_r, b_d=8)


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> hvf.Run:
    pushed = hvf.User(pushes=[hvf.Push(at=0.3, seconds=0.4, force=2.5)])
    sim = simulation(follow(300.0), user=pushed, figure=DEVICE_ALONE)
    return sim.run(SECONDS, record=tmp_path_factory.mktemp("hand") / "mine")


def replayed(recorded: hvf.Run, k_r: float, **parts: Any) -> hvf.Simulation:
    return simulation(follow(k_r), device=hvf.Replay(str(recorded.folder)), **({"figure": DEVICE_ALONE} | parts))


@pytest.mark.slow
def test_replay_in_same_field_reproduces_motion_and_force(recorded: hvf.Run) -> None:
    again = replayed(recorded, 300.0).run(SECONDS)
    for name in (*HAND, "force", "distance"):
        np.testing.assert_array_equal(again.ticks[name], recorded.ticks[name], err_msg=name)
    assert not again.ticks["user"].any()


def test_replay_into_the_folder_that_it_replays_is_refused(recorded: hvf.Run) -> None:
    with pytest.raises(hvf.HvfError, match=r"is the run whose hand is replayed.*; choose another record"):
        replayed(recorded, 300.0).run(SECONDS, record=recorded.folder, overwrite=True)
    assert recorded.ticks["t"].any()


def test_replay_in_another_field_changes_only_the_force(recorded: hvf.Run) -> None:
    again = replayed(recorded, 100.0).run(SECONDS)
    np.testing.assert_array_equal(again.ticks["p"], recorded.ticks["p"])
    assert np.abs(again.ticks["force"] - recorded.ticks["force"]).max() > 0.5
    assert again.summary.path.deviation_rms_mm is None
    assert f"The hand was that of {recorded.folder} and moved as recorded" in str(again)


def test_summary_names_the_replayed_recording_in_every_mode(recorded: hvf.Run) -> None:
    summary = replayed(recorded, 100.0).run(SECONDS).summary
    led = SimpleNamespace(lines=lambda: ["The figure was led."])
    for variant in (replace(summary, lead=led), replace(summary, editing=led)):  # pyright: ignore[reportArgumentType]
        assert [line for line in variant.lines() if line.startswith("The hand was that of")]
        assert "The figure was led." in variant.lines()


def test_replay_begins_at_the_recorded_hand(recorded: hvf.Run) -> None:
    session = replayed(recorded, 300.0).session(SECONDS)
    tip = session.world.data.site("phantom/tip").xpos
    np.testing.assert_allclose(tip - session.static()["p_WH"], recorded.ticks["p"][0], atol=1e-9)


@pytest.mark.parametrize("seed", [1, 7])
def test_seed_with_replay_is_refused(seed: int) -> None:
    with pytest.raises(hvf.ParameterError, match="whatever the seed; leave out the seed, or the replay"):
        run_config(replay="runs/mine", seed=seed)
    with pytest.raises(hvf.ParameterError, match="whatever the seed; leave out the seed, or the replay"):
        simulation(follow(300.0), device=hvf.Replay("runs/mine"), seed=7)
    assert with_options(run_config(seed=7), {"replay": "runs/mine"}).seed == 1


def test_iterated_replay_ends_with_the_recording(recorded: hvf.Run) -> None:
    assert len(list(replayed(recorded, 300.0))) == len(recorded.ticks["t"])


def device(folder: str | Path) -> dict[str, Any]:
    return {"device": hvf.Replay(str(folder)), "figure": DEVICE_ALONE}


def wired(folder: Path, **parts: Any) -> None:
    wire(RunConfig(**(device(folder) | {"seconds": SECONDS} | parts)))


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda run: wired(run / "nothing"), r"nothing/run.h5: cannot be opened \(there is no such file\)"),
        (lambda run: wired(run, clock=hvf.Clock(servo_period=2e-3)), "recorded every 0.001 s, and the servo runs every "
         "0.002 s; expected --servo-period 0.001"),
        (lambda run: wired(run, seconds=1.6), "for 1.5 s, and the run lasts 1.6 s; expected --seconds 1.5 or less"),
        (lambda run: wired(run, user=User(does="push")), "a replayed hand has no simulated user"),
        (lambda run: wired(run, user=User(person=hvf.persona("median"))), "a replayed hand has no simulated user"),
        (lambda run: simulation(follow(300.0), user=hvf.User(traces=CURVE), **device(run)), "has no simulated user"),
        (lambda run: run_config(mode="stretch-then-follow", replay=str(run)), "does not determine when; expected"),
        (lambda run: run_config(replay=str(run), cutoff=100.0), "--cutoff has no meaning with .* it belongs to the "
         "Phantom, without --replay"),
        (lambda run: hvf.certify(simulation(follow(300.0), **device(run))), "replayed and feels no force; expected a "
         "Phantom"),
    ],
    ids=["no recording", "other period", "too short", "user", "person", "hand of a simulation", "performs", "filter",
         "certified"],
)  # fmt: skip
def test_options_incompatible_with_replay_are_refused(
    recorded: hvf.Run, make: Callable[[Path], None], message: str
) -> None:
    with pytest.raises((hvf.ParameterError, SimError), match=message):
        make(recorded.folder)


def test_refused_replay_creates_no_folder(recorded: hvf.Run, tmp_path: Path) -> None:
    arguments = ["run", "--figure", "none", "--replay", str(recorded.folder), "--out", str(tmp_path / "run")]
    assert main(arguments) == 2
    assert not (tmp_path / "run").exists()


@pytest.mark.slow
@pytest.mark.usefixtures("without_page")
def test_replay_is_reproduced_only_while_its_recording_is_unchanged(recorded: hvf.Run, tmp_path: Path) -> None:
    hand, out = tmp_path / "hand", tmp_path / "out"
    hand.mkdir()
    (hand / "run.h5").write_bytes((recorded.folder / "run.h5").read_bytes())
    command = ["run", "--figure", "none", "--replay", str(hand), "--seconds", str(SECONDS), "--out", str(out)]
    assert main(command) == 0
    assert json.loads((out / "config.json").read_text())["device"] == {"kind": "replay", "run": str(hand)}
    with Recording(out / "run.h5") as recording:
        assert recording.texts["replayed"] == str(hand)
    assert reproduce(out).same
    other = simulation(follow(50.0), figure=DEVICE_ALONE).run(SECONDS)
    (hand / "run.h5").write_bytes((other.folder / "run.h5").read_bytes())
    with pytest.raises(SimError, match=rf"{hand}: the recorded hand has changed since the run was recorded"):
        reproduce(out)
    (hand / "run.h5").unlink()
    with pytest.raises(SimError, match=rf"{hand}/run.h5: cannot be opened"):
        reproduce(out)


def test_replay_option_replaces_the_user() -> None:
    config = run_config(user="push", seconds=2.0, cutoff=100.0)
    assert with_options(config, {"replay": "runs/mine"}) == run_config(replay="runs/mine", seconds=2.0)


def test_device_without_kind_is_a_phantom() -> None:
    assert from_dict(RunConfig, {"device": {"cutoff": 90.0}}, "here").device == hvf.Phantom(cutoff=90.0)
