"""Six picks of a tower, twice: what many tests fit a similarity to."""

import numpy as np

# Two at the foot, two on the shaft, the apex, and one below it, in units of 3.26 m.
TOWER = np.array(
    [
        [0.1, 0.2, 0.0],
        [3.9, 0.1, 1.0],
        [3.8, 4.0, 4.0],
        [0.2, 3.9, 9.0],
        [2.0, 2.0, 15.0],
        [2.1, 0.1, 12.0],
    ]
)
APEX = 4

# The control picks of the demo, where they truly are: metres from the foot of its clock tower.
DEMO_IDS = ("plinth-sw", "course1-se", "course2-nw", "clock-s", "cornice-ne", "roof-se")
DEMO = np.array(
    [
        [-3.552, -6.680, 1.8],
        [6.556, -3.486, 12.5],
        [-6.556, 3.486, 24.6],
        [-0.738, -5.454, 28.2],
        [3.751, 7.055, 37.0],
        [2.123, -1.129, 45.5],
    ]
)
DEMO_APEX = 5
