"""Predicted load on the contact points, compared with what the clip does afterwards."""

import mujoco
import numpy as np

from models.humanoid.skeleton import CONTACT_RADIUS, figure_model
from models.mocap.library import embedded
from models.mocap.motion.kinematics import sole_points
from sim.body.clip_motion import ClipMotion, clip_motion
from sim.body.figure import Figure, FigureGains
from sim.body.tracking import TrackingConfig, floor_world

PREFIX = "figure/"
GAINS = FigureGains()


def _supports(motion: ClipMotion, frames):
    """Shares of load and stance of the feet's spheres, (n, 8) each, for a figure exactly at its reference."""
    model = floor_world(TrackingConfig())
    data = mujoco.MjData(model)
    figure = Figure(model, data, figure_model(), PREFIX, GAINS)
    shares, stances = [], []
    for k in frames:
        data.qpos[:], data.qvel[:] = motion.poses[k], motion.velocities[k]
        mujoco.mj_forward(model, data)
        figure.update(motion.poses[k], motion.velocities[k], motion.accelerations[k])
        shares.append(figure.state.share[:8].copy())
        stances.append(figure.state.near[:8].copy())
    return np.array(shares), np.array(stances)


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
