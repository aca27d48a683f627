"""Heights of a sole over the floor between which its foot passes from stance to swing, for all that hold or measure it.

What corrects a blend's feet, what tracks the motion and what measures skate must agree on them: a foot that is held
lower than it is measured skates in between, and one that is lifted less than the tracking releases is held back.
"""

STANDS = 0.003
"""Height up to which a sole stands: its foot keeps its place, and what it moves is skate [m].

In-betweens of cheer and ginga slide by 1.0 cm at most, with half or twice of it, too. Measured up to twice of it, the
low swing of walk and run counts as skate, 7.8 cm instead of 0.4; up to half of it, 0.1.
"""

SWINGS = 0.008
"""Height from which a sole swings: the tracking figure no longer holds its foot on the floor [m]. With half or
twice of it in tracking alone the residual of a jump is 2.9 or 6.3 % of weight instead of 2.8."""
