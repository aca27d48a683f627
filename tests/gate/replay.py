"""A recorded hand as the device of a run, for the gate: ``python tests/gate/replay.py FOLDER RUN`` records it."""

import sys
from pathlib import Path

from experiments.results.folder import config_of
from experiments.setups.wiring import wire
from sim.devices.replayed import recorded_hand, replayed_hand
from sim.loop.channels import groups, record_into
from sim.loop.loop import Loop
from sim.recording.recorder import Recorder
from sim.recording.recording import Recording


def main(out: Path, run: Path) -> None:
    with Recording(run / "run.h5") as recording:
        config, rows, period = config_of(recording), recorded_hand(recording), 1.0 / recording.rates["ticks"]
    session = wire(config, device=lambda world: replayed_hand(rows, world, period))
    out.mkdir(parents=True)
    with Recorder(out / "run.h5", {}, 1, groups(session.servo), {}) as recorder:
        record = record_into(recorder, session.servo, session.world)
        Loop(session.servo, session.world, record).run(len(rows) * period)


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
