"""A circle, a user-defined law, and simulations of a field on that circle."""

import hvf

CURVE = hvf.circle(lap=2.0)


@hvf.law
def level(hand, k=50.0):
    return (0.0, 0.0, -k * hand.p[2])


def simulation(field: hvf.Law, **parts: object) -> hvf.Simulation:
    around = hvf.Cylindrical(hvf.clips("cheer"), around=CURVE)
    return hvf.Simulation(field=field, haptic_map=around, **parts)  # pyright: ignore[reportArgumentType]
