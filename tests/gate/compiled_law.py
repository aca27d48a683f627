"""A run with a user-defined compiled law, for the gate: ``python tests/gate/compiled_law.py FOLDER`` records it."""

import sys

import hvf


@hvf.law(compiled=True)
def level(hand, k=50.0):
    return (0.0, 0.0, -k * hand.p[2])


def main(out: str) -> None:
    curve = hvf.circle(lap=2.0)
    sim = hvf.Simulation(
        field=(hvf.Follow(curve, k_r=300, b_d=8) + level(k=100.0)).limited(8.0),
        haptic_map=hvf.Cylindrical(hvf.clips("cheer", "angry"), around=curve),
        user=hvf.User(pushes=[hvf.Push(at=0.5, seconds=0.3, force=2.0)]),
    )
    sim.run(1.5, record=out)


if __name__ == "__main__":
    main(sys.argv[1])
