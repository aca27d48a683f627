"""A user-defined law of force beside a built-in one: in Python, compiled, and certified."""

import hvf


@hvf.law
def floor(hand, k=500.0, b=3.0):  # [N/m], [N s/m] -> F_H [N]
    depth = -1e-3 - hand.p[2]
    return (0, 0, max(0.0, k * depth - b * hand.v[2])) if depth > 0 else (0, 0, 0)


@hvf.law(compiled=True)
def level(hand, k=50.0):  # [N/m] -> F_H [N]
    return (0.0, 0.0, -k * hand.p[2])


curve = hvf.circle(lap=2.0)
sim = hvf.Simulation(
    field=(hvf.Follow(curve, k_r=300, b_d=8) + floor + level(k=100.0)).limited(8.0),
    haptic_map=hvf.Cylindrical(hvf.clips("cheer"), around=curve),
)
lowest = 1e3 * sim.run(1.0).ticks["p"][:, 2].min()
print(f"the stylus stays above {lowest:.2f} mm")
print(hvf.certify(sim).stability.reason)  # of both branches of floor, and of switching between them
without = hvf.Simulation(field=hvf.Follow(curve, k_r=300, b_d=8) + level, haptic_map=sim.haptic_map)
print(hvf.certify(without).stability.reason)
