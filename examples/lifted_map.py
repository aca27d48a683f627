"""Lift two clips to curves of their own, follow one with a user-defined field, then push over from it to the other."""

import tempfile
from pathlib import Path

import hvf

with tempfile.TemporaryDirectory() as folder:
    file = Path(folder) / "map.npz"
    print(hvf.lift(["walk", "run", "jump", "backflip"], file).lines()[0])
    run_map = hvf.Lifted(file, curve="run")
    # Timed so that the Phantom, with its friction and its inertia, goes round at the clip's own pace.
    river = hvf.paced(run_map.around, drag=8, stiffness=300)
    sim = hvf.Simulation(field=hvf.Follow(river, k_r=300, b_d=8).limited(3.0), haptic_map=run_map)
    alone = sim.run(4.0)
    print(f"the run alone: residual {100 * alone.summary.figure.residual_force_rms:.1f} % of weight")
    over = hvf.run(map=str(file), curve="walk", mode="rivers", user="push", seconds=8.0)
    print("\n".join(line for line in str(over).splitlines() if line.startswith("Rivers")))
