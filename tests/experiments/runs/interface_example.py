# The names of `hvf` in one script; `test_simulation_runs.py` runs it.
# ruff: noqa
# fmt: off
import hvf
walk, jump = hvf.clips("walk", "jump")
curve = hvf.circle(radius=0.0477, lap=4.0)

@hvf.law
def floor(hand, k=500.0, b=3.0):          # [N/m], [N s/m] -> F_H [N]
    depth = -1e-3 - hand.p[2]
    return (0, 0, max(0.0, k * depth - b * hand.v[2])) if depth > 0 else (0, 0, 0)

sim = hvf.Simulation(
    device=hvf.Phantom(), field=(hvf.Follow(curve, k_r=300, b_d=8) + floor).limited(8.0),
    haptic_map=hvf.Cylindrical([walk, jump], around=curve), user=hvf.User(pushes=[hvf.Push(at=5.0, seconds=1.2, force=2.5)]), seed=1)
run = sim.run(20.0)                        # in memory; record="runs/mine" for a folder
run.summary.path.deviation_rms; run.ticks["force"]; run.to_bvh("edited.bvh"); run.report(); run.frame()   # frame(): pandas, if installed
for r in hvf.sweep(sim, {"field.k_r": [100, 200, 400, 800]}, threads=2): ...
print(hvf.certify(sim).stability)          # of this field, with the own law
