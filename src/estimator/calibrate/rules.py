"""Constants of the calibration, each with where it comes from."""

PRE_HZ = 12.0
"""Cut-off of joint signals before they are mapped to poses and wrenches. Measured: angles filtered at 5 Hz and then
mapped leave harmonics of micrometres and millinewtons, which moved spring scales by two to five standard errors."""
SAMPLE_HZ = 33.0
"""Instants at which loops and balance are evaluated, before the residual is averaged into rows. Derived: above twice
``PRE_HZ``."""
ROW_S = 0.25
"""Time between rows. Measured: noise of accelerations grows with frequency, and biases scales where rows are shorter
(one standard error at 0.12 s)."""
LOBES = 3
"""Half length, in rows, of the kernel that they are weighed with. Chosen: white noise then correlates by 0.013."""
ROLL_OFF = 0.5
"""Roll-off of that kernel. Chosen: nothing passes above 3 Hz."""
TRIM_S = 2.0
"""Dropped at both ends against the filters' transients. Chosen, as in the paper."""
STILL_RADPS = 1.5e-3
"""Joint speed below which an encoder's rounding counts as one error that lasts. Chosen: a 16 bit encoder makes sixteen
steps a second at this speed."""
STILL_HZ = 2.0
"""Cut-off of the joint speeds that are held against it. Chosen: rounding at rest then stays below a twentieth."""
SETTLING_S, SHORTEST_HOLD_S = 0.4, 1.0
"""Left out at both ends of a hold, and the least that must be left of it. Chosen: twice what ``STILL_HZ`` takes."""
BESIDE_S = 0.5
"""Least time between a row in motion and a rest. Chosen: 98 % of a row's weight lie within it."""
SHORTEST_PERIOD_S, PERIODS, REPEATED = 1.0, 20, 0.2
"""Period of a motion that repeats, the number of them looked at, and the least share of readings that are the same
again. Chosen: random motion has less than a thousandth."""
NOISE_ABOVE_HZ = 25.0
"""Above it a signal is noise. Measured: commanded motion ends at 5 Hz."""
PASSED = 0.17
"""Frequency, over the rate of the samples, up to which a conversion leaves everything. Derived: its low-pass
filter's passband ends at 0.18."""
DITHER = 0.35
"""White noise, in steps, from which on rounding errors of neighbouring samples are independent. Derived: their
correlation is exp(-4 pi^2 0.35^2), below one percent."""
TO_AND_FRO, NOISE_TO_AND_FRO, LEAST_SLOW = 0.1, 1.77, 50
"""Share of slow readings that go a step to and fro below which it tells the noise, in steps: sqrt(pi) times that share.
Derived: a reading between two values takes one with chance p and the other with q, and the mean of p q over a step is
sigma / sqrt(pi) where sigma is small; of 50 readings a noise of ``DITHER`` moves ten."""
PHI_FLOOR_RAD, THETA_FLOOR_RAD, TORQUE_FLOOR_NM = 4e-6, 8e-7, 3e-4
"""What the model itself leaves in motion at 100 Hz beside any sensor: soft rods and welds shift a wrist by micrometres
and hardly turn it. Measured on trials with ideal sensors and with encoders of 19 and 20 bits: loops of random trials
leave 0.55, and 0.8 to 1.2, of what is claimed with these."""
AT_REST = 0.2
"""Share of these that a rest shows, at any rate. Measured: static trials with ideal sensors leave a fiftieth of the
floors' variance, and less."""
FLOOR_HZ = 100.0
"""Rate that the floors above are given for. Chosen."""
CURVATURE_EVERY = 3
"""Instants between those at which derivatives are taken where they are averaged. Chosen: eleven a second."""
BLOCK_ROWS = 512
"""Rows whose derivatives are held at a time. Chosen; the result does not depend on it."""
COARSE_ROWS = 250
"""Rows that the first steps take, evenly from all trials. Chosen: the way to the solution needs no more."""
MAX_STEPS, MAX_COARSE_STEPS = 40, 30
"""Steps in all, and on few rows. Chosen: forty teams of the prior's spread needed six at most."""
LEAST_DAMPING, DAMPING = 1e-3, 10.0
"""Share of the diagonal that damps a step after one that went up, and by how much it then grows and falls. Chosen, as
in Marquardt's paper."""
RISE = 0.01
"""Rise of the sum of squares that a step may still make, for rows' noise is each point's own. Chosen: whole steps of
teams that fit made none; a whole step between two teams made it ten times larger and more."""
FLAT = 0.01
"""Share of the sum of squares by which a damped step must lower it, or the descent ends. Chosen: recordings of other
robots than the rest's leave a valley whose floor falls by a thousandth a step."""
COARSE = 0.5
"""Largest step of any unknown, in posterior standard errors, that ends those on few rows. Chosen."""
CONVERGED = 0.001
"""The same that ends all. Measured: at 0.02, signals were adjusted to unknowns a step back; at 0.002, what held robots'
errors do to the payload was predicted up to 3.4 % off, at 0.001 and at 0.0001 less than 3 %."""
MISFIT = 1.3
"""chi2/n of loops or balance of a recording above which no calibration explains it. Measured: below 1.1 on uncalibrated
teams with nothing else wrong; what noise adds to it is 0.03."""
MISFIT_SIGMAS = 4.0
"""The same where rows are few, in standard deviations of chi2/n, which are sqrt(2/n). Chosen: a static trial of two
robots has three dozen rows, and noise alone makes 1.3 of one in ten of them."""
SUFFICES = 0.99
"""Share of a misfit that one change in one recording must explain to be named where it does not explain all. Measured:
slips of 0.2 to 1 deg 0.9999 and more, by derivatives; the best change where a joint rubs in all recordings 0.07."""
