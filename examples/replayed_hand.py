"""One hand in three fields: what a recorded hand, which moves as it did whatever the force, feels in each of them."""

import hvf

curve = hvf.circle(lap=2.0)
around = hvf.Cylindrical(hvf.clips("cheer", "angry"), around=curve)
alone = hvf.Figure(kind="none")
pushes = [hvf.Push(at=0.5, seconds=0.6, force=2.5)]

river = hvf.Follow(curve, k_r=300, b_d=8)
mine = hvf.Simulation(field=river, haptic_map=around, user=hvf.User(pushes=pushes), figure=alone).run(2.0)
for k_r in (100, 300, 500):
    other = hvf.Follow(curve, k_r=k_r, b_d=8)
    hand = hvf.Replay(str(mine.folder))
    run = hvf.Simulation(field=other, haptic_map=around, device=hand, figure=alone).run(2.0)
    largest = (run.ticks["force"] ** 2).sum(axis=1).max() ** 0.5
    print(f"k_r = {k_r} N/m: the same hand would feel {largest:.1f} N")
