"""The page of a hardware run: device, force and figure as the servo's last row has them; in a process of its own."""

import os
import signal
import time
from dataclasses import replace

import numpy as np

from controllers.state import Array
from experiments.config.run_config import RunConfig
from experiments.hardware.parts import served, session_of
from experiments.setups.session import Session
from experiments.setups.wiring import wire
from models.scene import P_WH
from sim.hardware.gated_servo import ROW_SIZE, columns
from sim.hardware.shared import SharedNumbers
from sim.reference.reference import poses_along
from sim.viewer.courses import courses
from sim.viewer.live_page import LivePage
from sim.viewer.shown import Shown
from sim.world.shown_phantom import show_angles, shown_phantom

_PAUSE = 1.0 / 60.0  # [s] between two looks: half a picture's time


def show_status(config: RunConfig, status: SharedNumbers) -> None:
    """Show a run until whoever started this is gone; the target of a process. Nobody waits for it.

    The figure is the animation h(p) itself; one that is led has a walker that lives in the servo, and is not shown.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    led = config.map.kind == "led"
    session = (
        session_of(served(config)) if led else wire(replace(config, figure=replace(config.figure, kind="kinematic")))
    )
    world = session.world
    static = session.static()
    page = LivePage(world.full_model(), courses(static), float(np.asarray(static["tube_radius"])), P_WH, world.kind)
    linkage, row, parent = shown_phantom(world.model, world.data), np.zeros(ROW_SIZE), os.getppid()
    while os.getppid() == parent:
        if status.read(row):
            tick = {name: channel[0] for name, channel in columns(row[None]).items()}
            show_angles(linkage, tuple(tick["theta"]), tuple(tick["gimbal"]))
            pose = np.zeros(0) if led else _pose(session, np.concatenate([tick["p"], tick["quaternion"]]))
            qpos = np.concatenate([world.data.qpos, pose])
            none = np.zeros(3)  # who holds the stylus is not known
            page.show(Shown(float(tick["t"]), qpos, pose[:0], tick["p"], tick["force"], none, np.full(3, np.nan)))
        time.sleep(_PAUSE)


def _pose(session: Session, argument: Array) -> Array:
    """Pose of the animation at a stylus pose (7,), shape (75,)."""
    reference, poses = session.servo.reference, np.empty((1, session.haptic_map.nq))
    poses_along(reference.kind, reference.params, reference.memory.copy(), argument[None], poses)
    return poses[0]
