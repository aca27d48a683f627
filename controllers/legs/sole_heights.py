"""Heights of a sole over the floor at which its foot passes from stance to swing, for every module that needs them.

The correction of a blend's feet, the tracking of the motion and the measure of their slide must use the same heights: a
foot that is held only up to a lower height than it is measured slides in between, and one that is lifted less than the
height at which tracking releases it is held back.
"""

STANCE_HEIGHT = 0.003
"""Height up to which a sole is in stance: its foot keeps its place, and any motion over the floor is a slide [m].

In-betweens of cheer and ginga slide by at most 1.0 cm, also with half or twice this height. Measured up to twice this
height, the low swing of walk and run counts as a slide: 7.8 cm instead of 0.4; up to half of it, 0.1 cm.
"""

SWING_HEIGHT = 0.008
"""Height above which a sole is in swing: the tracking figure no longer holds its foot on the floor [m].

With half or twice this height in tracking alone, the residual of a jump is 2.9 or 6.3 % of weight instead of 2.8."""
