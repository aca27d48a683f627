"""A user-defined hand: a person who pulls inwards while the stylus is on the left, and feels what that takes."""

import hvf

pulled = []


def inwards(t, place, force):  # [s], where she believes her hand is [m], what she feels [N] -> where she wants it
    if place[0] > 0.0:
        return hvf.intents.Wish(place=None)  # she lets it go where it goes
    pulled.append((force**2).sum() ** 0.5)
    return 0.9 * place


sim = hvf.Simulation(
    field=hvf.Follow(hvf.circle(lap=2.0), k_r=150, b_d=8),
    haptic_map=hvf.Cylindrical(hvf.clips("cheer", "angry"), around=hvf.circle(lap=2.0)),
    user=hvf.User(person=hvf.persona("median"), intent=hvf.intents.Own(inwards)),
    figure=hvf.Figure(kind="kinematic"),
)
run = sim.run(3.0)
print(f"{1e3 * run.ticks['distance'].max():.1f} mm from the river at most; she felt {max(pulled):.1f} N")
