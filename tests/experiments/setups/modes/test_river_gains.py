"""Default gains of rivers, with which the default push moves the hand from one river into another; their names."""

from dataclasses import replace
from typing import cast

import numpy as np

from controllers.curves.trajectory import Trajectory
from controllers.fields.algebra.instructions import TRACE_RIVER
from controllers.fields.algebra.program import evaluate
from controllers.fields.follow import Follow
from controllers.fields.higher_order import HigherOrder
from controllers.state import HAND_POSITION, HAND_SIZE, HAND_VELOCITY
from experiments.config.modes import Follow as FollowMode
from experiments.config.options import run_config
from experiments.setups.modes.rivers import drawn, river_bundle
from experiments.setups.parts.defaults import resolved
from experiments.setups.parts.part_types import ClipMapParts, Parts
from experiments.setups.setups import map_parts, parts_of
from models.humanoid.skeleton import figure_model
from models.mocap.library import embedded
from sim.users.hand.arm import hand_force

MASS, FRICTION, PERIOD = 0.15, 0.03, 1e-3  # [kg], [N], [s]; mass and friction are about the Phantom's
CURVE = Trajectory.circle(0.0477, 4.0)
SECONDS = 4.0
MAPS = map_parts(run_config(map="composite", clips=("cheer",)), figure_model())


def parts_with(mode: str = "rivers", user: str = "push", **words: object) -> Parts:
    return parts_of(resolved(run_config(mode, "composite", user, seconds=SECONDS, **words)), MAPS)


def river_at_each_tick(parts: Parts) -> np.ndarray:
    """River of the default hand, a mass with friction, at each tick; it starts on the level river."""
    assert isinstance(parts.field, HigherOrder)
    program, arm = parts.field.program(), parts.user.compiled()
    memory, hand, wrench, user = program.fresh_memory(), np.zeros(HAND_SIZE), np.zeros(6), np.zeros(3)
    p, v = CURVE.point(0.0), CURVE.velocity(0.0)
    rivers = np.empty(round(SECONDS / PERIOD))
    for k in range(len(rivers)):
        hand[0] = k * PERIOD
        hand[HAND_POSITION : HAND_POSITION + 3], hand[HAND_VELOCITY : HAND_VELOCITY + 3] = p, v
        evaluate(*program.compiled(), memory, hand, wrench)
        rivers[k] = memory[TRACE_RIVER]
        hand_force(arm, k * PERIOD, p, v, user)
        slowing = FRICTION * v / max(float(np.linalg.norm(v)), 1e-3)
        v = v + PERIOD / MASS * (wrench[:3] + user - slowing)
        p = p + PERIOD * v
    return rivers


def test_rivers_and_follow_have_separate_default_gains() -> None:
    for words, expected in (({}, (16.0 / 150.0, 16.0)), ({"stiffness": 120.0, "damping": 12.0}, (0.1, 12.0))):
        field = parts_with(**words).field
        assert isinstance(field, HigherOrder)
        for river in field.bundle.rivers:
            assert (river.tau, river.drag) == expected
    for words, expected in (({}, (300.0, 8.0)), ({"stiffness": 500.0, "damping": 3.0}, (500.0, 3.0))):
        alone = parts_with("follow", **words).field
        assert isinstance(alone, Follow)
        assert (alone.k_r, alone.b_d) == expected


def test_default_flow_of_follow_depends_on_the_map() -> None:
    assert resolved(run_config("follow", "any.npz")).mode == FollowMode(flow="parallel")
    assert resolved(run_config("follow", "any.npz", flow="curve")).mode == FollowMode(flow="curve")
    assert resolved(run_config("follow")).mode == FollowMode(flow="curve")
    assert resolved(run_config("follow", "composite")).mode == FollowMode(flow="parallel")
    assert resolved(run_config("follow", "composite", flow="curve")).mode == FollowMode(flow="curve")


def test_default_push_moves_the_hand_into_another_river() -> None:
    rivers = river_at_each_tick(parts_with())
    assert np.all(rivers[:1900] == 0.0)
    assert np.all(rivers[2600:] > 0.0)
    assert np.sum(rivers < 0.0) < 20


def test_hand_stays_in_its_river_without_push_or_with_stiff_gains() -> None:
    assert np.all(river_at_each_tick(parts_with(user="relaxed")) == 0.0)
    alone = FollowMode()
    stiff = parts_with(stiffness=alone.stiffness, damping=alone.damping)
    assert not np.all(river_at_each_tick(stiff)[2600:] > 0.0)


def test_names_of_rivers_tell_the_clip_that_each_plays() -> None:
    maps, bundle = cast(ClipMapParts, MAPS), river_bundle(CURVE, 0.02, 0.1, 8.0, 0.015)
    assert drawn(bundle, maps)["river_names"] == "level\nwave\nhigh"
    own = replace(maps, clips=(embedded("walk"), embedded("jump")), plays_rivers=True)
    assert drawn(bundle, own)["river_names"] == "level (walk)\nwave (jump)\nhigh (walk)"
