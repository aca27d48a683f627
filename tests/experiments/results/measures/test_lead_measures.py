"""Measures of a led run on motions with known answers, and refused configurations of the lead mode."""

from dataclasses import replace
from pathlib import Path
from typing import ClassVar, cast

import numpy as np
import pytest

from controllers.haptic_map.led import Led
from controllers.walking.gait import Gait
from experiments.config.maps import Led as LedMap
from experiments.config.modes import Lead
from experiments.config.options import run_config
from experiments.config.run_config import RunConfig
from experiments.fitting.figure_legs import figure_legs
from experiments.preparation.prepared_clip import PreparedClip
from experiments.results.measures.lead_measures import LeadSummary, _Retrace, lead_summary, support_at
from experiments.results.measures.soles import Soles
from experiments.setups.modes.lead import lead_parts, leading, walker_argument
from experiments.setups.parts import clips
from experiments.setups.parts.leading_hand import leading_hand, s_curve
from experiments.setups.parts.led_figure import gait_remark, led_clips, led_map, led_parts
from models.humanoid.skeleton import figure_model, rest_pose
from models.mocap.dynamics.contacts import contacts
from models.mocap.library import embedded
from models.mocap.motion.clip import Clip, PlanarDisplacement
from models.world.scene import SceneConfig
from sim.recording.recording import Recording
from sim.world.world import phantom_angles

GAIT = Gait(1.4, 1.25, np.repeat([2, 1, 2, 1], [18, 48, 18, 48]), 0.45)


def poses_along(places: np.ndarray, aside: float = 0.0, turned: float = 0.0) -> np.ndarray:
    """Rest poses on a circle of 3 m, at arc lengths [m]."""
    angles = places / 3.0
    radius = 3.0 - aside
    return np.array([
        PlanarDisplacement(radius * np.sin(a), 3.0 - radius * np.cos(a), a + turned).moved(rest_pose()) for a in angles
    ])  # fmt: skip


@pytest.mark.parametrize(("aside", "turned"), [(0.0, 0.0), (0.02, 0.0), (-0.03, np.radians(4.0))])
def test_retrace_measures_distance_and_turn_from_the_outward_path(aside: float, turned: float) -> None:
    measure = _Retrace()
    forth, back = np.arange(0.0, 4.0, 0.01), np.arange(3.5, 0.5, -0.013)
    measure.add(forth[:150], poses_along(forth[:150]), -np.inf)
    measure.add(forth[150:], poses_along(forth[150:]), float(forth[149]))
    assert measure.result() == (None, None)
    measure.add(back, poses_along(back, aside, turned), float(forth[-1]))
    distance, turn = measure.result()
    assert distance == pytest.approx(100.0 * abs(aside), abs=0.02)
    assert turn == pytest.approx(np.degrees(turned), abs=0.05)


def test_retrace_compares_with_the_nearest_place_and_heading() -> None:
    measure = _Retrace()
    forth = np.arange(0.0, 4.0, 0.01)
    # The pelvis goes to and fro by 6 cm every 30 cm while it turns by 12°.
    swing = 2.0 * np.pi * forth / 0.3
    poses = np.concatenate([
        poses_along(np.array([s + 0.06 * np.sin(a)]), 0.0, np.radians(12.0) * np.sin(0.5 * a))
        for s, a in zip(forth, swing, strict=True)
    ])  # fmt: skip
    measure.add(forth, poses, -np.inf)
    measure.add(forth[350:50:-1], poses[350:50:-1], float(forth[-1]))
    distance, turn = measure.result()
    assert distance is not None
    assert turn is not None
    assert distance < 0.01
    assert turn < 0.1
    # Behind the start there is no outward path to compare with.
    measure.add(np.array([-0.1]), poses_along(np.array([-0.1])), float(forth[-1]))
    assert measure.result() == (distance, turn)


def test_retrace_of_turn_on_the_spot_uses_the_heading_there() -> None:
    # For 10 cm of its path the pelvis goes on by 1 mm only, and turns by 40°; coming back it is 2 mm behind.
    forth = np.arange(0.0, 2.0, 0.01)
    still = np.clip(forth - 1.0, 0.0, 0.1)
    poses = np.concatenate([
        poses_along(np.array([s - 0.99 * d]), 0.0, np.radians(400.0) * d) for s, d in zip(forth, still, strict=True)
    ])  # fmt: skip
    measure = _Retrace()
    measure.add(forth, poses, -np.inf)
    back = slice(180, 20, -1)
    behind = poses[back] - 0.002 * np.eye(1, poses.shape[1])
    measure.add(forth[back], behind, float(forth[-1]))
    distance, turn = measure.result()
    assert distance is not None
    assert turn is not None
    assert 0.1 < distance < 0.25
    assert turn < 0.5


def test_sole_sliding_is_measured_only_in_contact() -> None:
    measure, standing = Soles(SceneConfig()), rest_pose()
    lowest = Soles(SceneConfig())
    lowest.add(standing[None])
    moved = np.tile(standing, (5, 1))
    moved[:, 0] += [0.0, 0.01, 0.02, 0.0, 0.0]
    moved[3, 2] += 0.1
    measure.add(moved)
    assert measure.slide == pytest.approx(0.02, abs=1e-9)
    pressing = Soles(SceneConfig(), physical=True)
    moved[:, 2] -= 1e-4
    pressing.add(moved)
    assert pressing.slide == pytest.approx(0.02, abs=1e-9)
    hovering = Soles(SceneConfig(), physical=True)
    moved[:, 2] += 2e-4
    hovering.add(moved)
    assert hovering.slide == 0.0


def test_leading_path_is_reachable_and_closed() -> None:
    field = leading(Lead(), GAIT)
    path = leading_hand(field).path
    for place in path[::50]:
        phantom_angles(place)
    np.testing.assert_allclose(path[[0, -1], :2], [field.walking.start] * 2, atol=1e-9)
    np.testing.assert_allclose(path[len(path) // 2, 2], 0.0, atol=1e-12)
    curve = s_curve()
    assert np.hypot(*np.ptp(path[:, :2], axis=0)) == pytest.approx(0.14, rel=0.1)
    assert field.walking.scale * curve.length == pytest.approx(5.0 * GAIT.speed)


def test_slow_gait_with_long_strides_is_led_along_a_longer_curve_with_damped_steering() -> None:
    """A zombie's walk was 0.5 m beside the curve: steering from a front 0.7 m ahead had a damping ratio of 0.3."""
    fast, slow = leading(Lead(), GAIT).walking, leading(Lead(), replace(GAIT, speed=0.34, reach=0.59)).walking
    assert fast.rate == 2.5
    assert np.sqrt(2.0) * slow.gait.speed / (slow.rate * slow.ahead) == pytest.approx(np.sqrt(0.5))
    assert slow.scale * s_curve().length == pytest.approx(3.0 * (slow.ahead + slow.lead[0]))
    assert leading(Lead(floor_scale=7.0), GAIT).walking.scale == 7.0


@pytest.mark.parametrize(("seconds", "remarked"), [(10.0, True), (25.0, False)])
def test_run_that_ends_before_the_hand_has_led_is_remarked(seconds: float, remarked: bool) -> None:
    config = run_config(mode="lead", clips=("walk",), seconds=seconds)
    mode, maps = cast(Lead, config.mode), led_parts(config, (embedded("walk"),), figure_model())
    remarks = lead_parts(config, mode, maps).remarks
    assert bool(remarks) is remarked
    assert all(remark.endswith("s; give --seconds more than that") for remark in remarks)


@pytest.mark.parametrize(("name", "feet"), [("walk", 2), ("run", 1)])
def test_led_figure_begins_in_its_largest_support(name: str, feet: int) -> None:
    led, gait = led_map(embedded(name), figure_model())
    assert gait.support[0] == feet
    assert support_at(gait, np.array([0.0]))[0] == feet
    assert led.pose(walker_argument(np.zeros(1))[0])[2] == pytest.approx(0.9, abs=0.1)


def test_gait_remarks_for_clips_with_flights() -> None:
    figure = figure_model()
    walk, run = (led_map(embedded(name), figure)[0] for name in ("walk", "run"))
    capture, _ = led_map(embedded("run"), figure, authored=False)
    assert gait_remark("walk", walk, "physical") == ()
    assert "led slowly it goes without flights" in gait_remark("run", run, "kinematic")[0]
    assert "by steps of 0.75 m at most, at " in gait_remark("capture", capture, "kinematic")[0]
    standing = np.zeros((8, 2), dtype=bool)
    standing[:4, 0] = True
    hop = Led((embedded("run").poses, embedded("run").fps), figure_legs(figure), 0.0, standing)
    assert "may fall where it is slow" in gait_remark("hop", hop, "physical")[0]
    assert gait_remark("hop", hop, "kinematic") == ()


def test_best_lap_of_a_capture_without_a_cycle_is_led(monkeypatch: pytest.MonkeyPatch) -> None:
    run, walk = embedded("run"), embedded("walk")

    def loaded(paths: list[Path], raw: bool = False, loop: str = "auto") -> list[PreparedClip]:
        opened = Clip(walk.poses[1:], walk.fps, "b")
        by_name = {"a": run, "b": walk if loop == "lap" else opened}
        return [PreparedClip(by_name[path.stem], (f"raw {raw}, {loop}",)) for path in paths]

    monkeypatch.setattr(clips, "prepared_clips", loaded)
    assert led_clips(LedMap(clips=("a.bvh",))) == ((run,), ("raw False, auto",))
    assert led_clips(LedMap(clips=("b.bvh",))) == ((walk,), ("raw False, lap",))
    note, slides = led_clips(LedMap(clips=("b.bvh",), raw=True))[1]
    assert note == "raw True, auto"
    assert slides.startswith("b.bvh: led as captured: its feet slide")
    (clip,), remarks = led_clips(LedMap(clips=("run",)))
    np.testing.assert_array_equal(clip.poses, run.poses)
    assert remarks == ()


def test_clip_with_long_leaps_is_led_by_grounded_steps() -> None:
    run = embedded("run")
    # Each flight is 1 m longer: a root low enough for both feet to reach the floor would lie on it.
    flies = ~contacts(run).planted.any(axis=1)
    far, flights = run.poses.copy(), np.count_nonzero(flies[1:] & ~flies[:-1])
    far[:, 0] += np.cumsum(flies) * flights / flies.sum()
    led, gait = led_map(Clip(far, run.fps, "leaps"), figure_model())
    assert not led.flies
    assert led.has_grounded_form
    assert gait.grounded
    assert gait.stride < run.displacement.x + flights


def test_lead_summary_lines() -> None:
    summary = LeadSummary(6.3, (0.0, 41.0, 55.0), 1.1, 0.0, 1.5, 2.5, 0.2, 0.1, 2.0, 1.0)
    assert summary.lines() == [
        "The figure was led 6.3 m, turning by up to 55°/s on two feet, 41°/s on one and 0°/s on none; its soles slid "
        "by up to 1.5 cm, the physical figure's by up to 2.5 cm.",
        "On the way back it retraced its path within 0.20 cm and 0.10°, the physical figure within 2.0 cm and 1.0°. "
        "The hand felt "
        "up to 1.1 N.",
    ]
    never = LeadSummary(6.3, (0.0, 41.0, 55.0), 1.1, 12.34, 1.5, 2.5, None, None, None, None)
    assert never.lines()[1] == (
        "The figure was not led back. The hand felt up to 1.1 N; for 12.3 s the field asked for more than the motors "
        "bear."
    )


class _Recording:
    """A led run of a second whose motors give half of the field's force from 0.5 s on."""

    rates: ClassVar = {"ticks": 1000.0, "frames": 500.0}

    def __init__(self) -> None:
        t, s = 1e-3 * np.arange(1000), 1e-3 * np.arange(1000)
        field = np.tile([3.0, 4.0, 1.0, 0.0, 0.0, 0.0], (1000, 1))
        force = field[:, :3] * np.where(t < 0.5, 1.0, 0.5)[:, None]
        poses = poses_along(s[::2])
        self.groups = {
            "ticks": {"phase": s, "field": field, "force": force},
            "frames": {"t": t[::2], "reference": poses, "qpos": poses},
        }


def test_led_hand_feels_what_the_motors_give_not_what_the_field_asks_for() -> None:
    """A slow walk that could not follow asked for 7.4 N; the motors gave 4.6 N and, once warm, 1.5 N."""
    recording, walking = _Recording(), leading(Lead(), GAIT).walking
    summary = lead_summary(cast(Recording, recording), GAIT, walking.fresh(), SceneConfig(), None)
    assert summary.force_max == pytest.approx(5.0)
    assert summary.limited_s == pytest.approx(0.5)
    recording.groups["ticks"]["force"] *= np.where(np.arange(1000) < 500, 0.2, 1.0)[:, None]
    assert lead_summary(
        cast(Recording, recording), GAIT, walking.fresh(), SceneConfig(), None
    ).force_max == pytest.approx(2.5)


def test_resolved_configuration_contains_the_floor_scale() -> None:
    config = run_config(mode="lead")
    assert isinstance(config.map, LedMap)
    maps = led_parts(config, (embedded("walk"),), figure_model())
    resolved = lead_parts(config, Lead(), maps).config
    assert isinstance(resolved, RunConfig)
    assert resolved.mode == Lead(floor_scale=leading(Lead(), maps.gait).walking.scale)
