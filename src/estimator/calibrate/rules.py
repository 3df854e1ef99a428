"""Constants of the calibration, each with where it comes from."""

PRE_HZ = 12.0
"""Cut-off of joint signals before they are mapped to poses and wrenches. Angles filtered at 5 Hz and then mapped leave
harmonics of micrometres and millinewtons, which moved spring scales by two to five standard errors."""
SAMPLE_HZ = 33.0
"""Instants at which loops and balance are evaluated, before the residual is averaged into rows."""
ROW_S = 0.25
"""Time between rows. Noise of accelerations grows with frequency, and biases scales
where rows are shorter (one standard error at 0.12 s)."""
LOBES = 3
"""Of the sinc that rows are weighed with, to either side."""
TRIM_S = 2.0
"""Dropped at both ends against the filters' transients, as in the paper."""
STILL_RADPS = 1.5e-3
"""Joint speed below which an encoder's rounding counts as one error that lasts. A 16 bit encoder makes sixteen steps a
second at this speed."""
STILL_HZ = 2.0
"""Cut-off of the joint speeds that are held against it."""
SETTLING_S, SHORTEST_HOLD_S = 0.4, 1.0
"""Left out at both ends of a hold, and the least that must be left of it."""
NOISE_ABOVE_HZ = 25.0
"""Above it a signal is noise."""
DITHER = 0.35
"""White noise, in steps, from which on rounding errors of neighbouring samples are independent (correlation below 3 %:
exp(-2 pi^2 0.35^2) of the error's variance)."""
ANGLE_FLOOR_RAD, TORQUE_FLOOR_NM = 2e-6, 3e-4
"""What the model itself leaves at 100 Hz beside any sensor: rods and welds that give, integration."""
FLOOR_HZ = 100.0
BLOCK_ROWS = 512
"""Rows whose derivatives are held at a time; the result does not depend on it."""
COARSE_ROWS = 250
"""Rows that the first steps take, evenly from all trials: the way to the solution needs no more."""
MAX_STEPS = 12
"""Gauss-Newton steps; teams off by three times the prior needed five."""
COARSE = 0.5
"""Largest step, in the same, that ends those on few rows."""
CONVERGED = 0.02
"""Largest step of any unknown that ends them, in posterior standard errors."""
