"""Predicted load on the contact points, compared with what the clip does afterwards."""

import mujoco
import numpy as np

from models.humanoid.skeleton import CONTACT_RADIUS, JOINTS, N_TANGENT, figure_model, rest_pose
from models.mocap.library import embedded
from models.mocap.motion.kinematics import sole_points
from sim.body.clip_motion import ClipMotion, clip_motion
from sim.body.figure import Figure, FigureGains
from sim.body.tracking import TrackingConfig, floor_world

PREFIX = "figure/"
GAINS = FigureGains()


def _supports(motion: ClipMotion, frames):
    """Shares of load and stance of the feet's spheres, (n, 8) each, for a figure exactly at its reference."""
    support = _supporting()
    found = [support(motion.poses[k], motion.poses[k], motion.velocities[k], motion.accelerations[k]) for k in frames]
    return np.array([shares for shares, _ in found]), np.array([stances for _, stances in found])


def _supporting():
    """Shares of load and stance (8,) by pose of the figure, and pose, velocity and acceleration of its reference."""
    model = floor_world(TrackingConfig())
    data = mujoco.MjData(model)
    figure = Figure(model, data, figure_model(), PREFIX, GAINS)

    def support(pose, wanted_pose, wanted_velocity, wanted_acceleration):
        data.qpos[:], data.qvel[:] = pose, wanted_velocity
        mujoco.mj_forward(model, data)
        figure.update(wanted_pose, wanted_velocity, wanted_acceleration)
        return figure.state.share[:8].copy(), figure.state.near[:8].copy()

    return support


def _standing_on_inner_edges(roll: float):
    """A pose that stands on the inner edges of feet rolled by an angle [rad]."""
    pose = rest_pose().copy()
    for side, sign in (("left", 1.0), ("right", -1.0)):
        at = 7 + 4 * JOINTS.index(f"{side}_ankle")
        pose[at : at + 4] = np.cos(roll / 2), sign * np.sin(roll / 2), 0.0, 0.0
    pose[2] -= (sole_points(pose[None])[0, :, 2] - CONTACT_RADIUS).min()
    return pose


def test_points_about_to_lift_are_released_and_resting_points_bear_load():
    step = 0.005
    times = np.arange(0.0, 4.4, step)
    motion = clip_motion(embedded("walk"), times)
    places = sole_points(motion.poses)
    later = round(GAINS.unload_time / step)
    heights, frames = places[:, :, 2] - CONTACT_RADIUS, np.arange(len(times) - later)
    shares, stances = _supports(motion, frames)
    now, afterwards = heights[frames], heights[frames + later]
    moved = np.linalg.norm(places[frames + later] - places[frames], axis=2)
    lifted, resting = (now < 2e-3) & (afterwards > 0.03), (np.abs(now) < 1e-3) & (moved < 1e-3)
    assert lifted.sum() > 30
    assert resting.sum() > 300
    assert np.mean(stances[lifted] < 0.05) > 0.95
    # Around heel strike the acceleration misleads the prediction, but then others do not bear the load either.
    assert np.mean(shares[resting] > 0.5) > 0.99
    assert np.mean(stances[resting] > 0.5) > 0.8


def test_last_points_before_a_flight_bear_load_until_takeoff():
    times = np.arange(0.0, 2.4, 0.002)
    motion = clip_motion(embedded("jump"), times)
    lowest = (sole_points(motion.poses)[:, :, 2] - CONTACT_RADIUS).min(axis=1)
    flies = lowest > GAINS.flight_height
    takes_off = int(np.flatnonzero(np.diff(flies.astype(int)) == 1)[0])
    leaves = takes_off - int(np.argmax(lowest[takes_off::-1] < 1e-3))
    before = np.array([leaves - round(0.03 / 0.002)])
    shares, stances = _supports(motion, before)
    assert stances.max() < 0.1
    assert shares.max() > 0.5


def test_edge_that_the_reference_holds_up_bears_no_load_and_one_that_it_has_on_the_floor_does():
    support, still = _supporting(), np.zeros(N_TANGENT)
    rolled, flat = _standing_on_inner_edges(np.deg2rad(10.0)), _standing_on_inner_edges(0.0)
    heights = sole_points(rolled[None])[0, :, 2] - CONTACT_RADIUS
    raised = heights > GAINS.stance_height
    assert raised.sum() == 4, heights
    assert heights.max() < GAINS.settling_reach
    held_up, _ = support(rolled, rolled, still, still)
    assert np.all(held_up[raised] == 0.0)
    assert np.all(held_up[heights < 1e-4] > 0.9)
    settling, _ = support(rolled, flat, still, still)
    assert np.all(settling[raised] > 0.05)
