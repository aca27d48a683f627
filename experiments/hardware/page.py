"""Live view of a hardware run in a browser: device, force and figure from the servo's latest row; its own process."""

import os
import signal
import time
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from controllers.safety.arming import State
from controllers.safety.faults import Fault
from experiments.config.run_config import RunConfig
from experiments.hardware.link import link_now
from experiments.hardware.parts import served, session_of
from experiments.setups.session import Session
from experiments.setups.wiring import Ready, wire
from geometry.arrays import Array
from sim.hardware.gated_servo import ROW_SIZE, columns
from sim.hardware.process_start import parent_id
from sim.hardware.recorder_process import RECORDER_FORCE, RECORDER_SIZE
from sim.hardware.shared import SharedNumbers
from sim.reference.reference import reference_poses
from sim.viewer.live_page import LivePage
from sim.viewer.shown import Moment, courses
from sim.world.shown_phantom import show_angles, shown_phantom

_POLL_INTERVAL = 1.0 / 60.0  # [s] between two polls: half the time between two images


def page_session(config: RunConfig, ready: Ready = lambda units: None) -> Session:
    """Session that the page shows: with the kinematic figure, or the device alone if the figure is led; see `wire`."""
    if config.leads:
        return session_of(served(config), ready)
    return wire(replace(config, figure=config.figure.as_kind("kinematic", leads=False)), ready=ready)


def show_status(config: RunConfig, status: SharedNumbers, recorder_status: SharedNumbers) -> None:
    """Show a run until the parent process ends; the target of a process that no other one waits for.

    The force of the hand is the twin's estimate (`recorder_status`). The figure is the animation h(p) itself; a
    figure that is led is not shown, as its walker is in the servo's process.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    is_led, session = config.leads, page_session(config)
    world = session.world
    static = session.static()
    page = LivePage(world.full_model(), courses(static), float(np.asarray(static["tube_radius"])), world.kind)
    linkage, parent = shown_phantom(world.model, world.data), parent_id()
    row, twin = np.zeros(ROW_SIZE), np.zeros(RECORDER_SIZE)
    while os.getppid() == parent:
        if status.read(row):
            tick = {name: channel[0] for name, channel in columns(row[None]).items()}
            show_angles(linkage, tuple(tick["theta"]), tuple(tick["gimbal"]))
            stylus = np.concatenate([tick["p"], tick["quaternion"]])[None]
            pose = np.zeros(0) if is_led else reference_poses(session.servo.reference, stylus)[0]
            qpos = np.concatenate([world.data.qpos, pose])
            recorder_status.read(twin)
            hand = twin[RECORDER_FORCE : RECORDER_FORCE + 3].copy()
            shown = Moment(float(tick["t"]), qpos, pose[:0], tick["p"], tick["force"], hand, np.full(3, np.nan))
            page.show(shown, notes_of(tick))
        time.sleep(_POLL_INTERVAL)


def notes_of(tick: Mapping[str, Array]) -> tuple[str, ...]:
    """Notes of the page on a tick: state of the gate, fault, and quality of the link."""
    fault = Fault(int(tick["fault"]))
    state = State(int(tick["state"])).name.lower()
    return (f"{state}: {fault.words(float(tick['fault_value']))}" if fault else state, *link_now(tick).split(", "))
