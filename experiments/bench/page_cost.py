"""Cost of an image of the live page in its process: poses and arrows of one time, turned into messages."""

import contextlib
import io
import time

import numpy as np
import viser

from experiments.live.session.messages import SLICE_SIDE
from experiments.setups.session import Session
from sim.viewer.courses import courses
from sim.viewer.live_stage import LiveStage
from sim.viewer.shown import Moment

PICTURES, WARM = 200, 20  # images that are timed, and drawn before as a warm-up


def picture_microseconds(session: Session) -> float:
    """Processor time of an image in which every body has moved [µs], without connected browsers."""
    model, data = session.world.full_model(), session.world.data
    with contextlib.redirect_stdout(io.StringIO()):
        server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
    try:
        stage = LiveStage(server.scene, model, courses(session.static()), 0.01)
        rng = np.random.default_rng(1)
        qpos = data.qpos[: model.nq] + 0.05 * rng.normal(size=(2, model.nq))
        pose, forces = qpos[:, -75:], rng.normal(size=(2, SLICE_SIDE**2, 3))
        begin = 0.0
        for k in range(WARM + PICTURES):
            if k == WARM:
                begin = time.thread_time()
            moment = k % 2
            place = np.full(3, 0.01 * moment)
            with server.atomic():
                stage.show(Moment(0.016 * k, qpos[moment], pose[moment], place, 1.0 + place, 1.0 - place, place))
                stage.draw_slice(forces[moment], forces[moment])
        return 1e6 * (time.thread_time() - begin) / PICTURES
    finally:
        with contextlib.redirect_stdout(io.StringIO()):
            server.stop()
