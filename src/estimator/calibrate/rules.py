"""Constants of the calibration and where each comes from."""

PRE_HZ = 12.0
"""Cut-off of the low-pass on joint signals before they are mapped to poses and wrenches. Measured: mapping angles
filtered at 5 Hz leaves harmonics of micrometres and millinewtons, which bias spring scales by two to five standard
errors."""
SAMPLE_HZ = 33.0
"""Rate at which loops and balance are evaluated, before the residual is averaged into rows. Derived: more than twice
``PRE_HZ``."""
ROW_S = 0.25
"""Time between rows. Measured: acceleration noise grows with frequency, so shorter rows bias the spring scales (by one
standard error at 0.12 s)."""
DRIVEN_ROW_S = 0.6
"""Time between rows of bases that drive. Measured: rollers of the wheels make bases rock at 2 to 5 Hz, in phase with
their acceleration; with rows of 0.25 s the moment of inertia about the vertical is four standard errors too large."""
LOBES = 3
"""Half length of the row kernel, in rows. Chosen: the residuals of neighbouring rows under white noise then correlate
by 0.013."""
ROLL_OFF = 0.5
"""Roll-off of the row kernel. Chosen: nothing above 3 Hz passes."""
TRIM_S = 2.0
"""Time dropped at both ends because of filter transients. Chosen, as in the paper."""
STILL_RADPS = 1.5e-3
"""Joint speed below which the rounding of an encoder counts as one lasting error. Chosen: a 16-bit encoder makes
sixteen steps per second at this speed."""
STILL_HZ = 2.0
"""Cut-off of the joint speeds that are compared with ``STILL_RADPS``. Chosen: the rounding of a resting joint then
stays below a twentieth of that limit."""
SETTLING_S, SHORTEST_HOLD_S = 0.4, 1.0
"""Time dropped at both ends of a hold, and the shortest hold that must remain. Chosen: twice the settling time of
``STILL_HZ``."""
BESIDE_S = 0.5
"""Shortest time between a row in motion and a rest. Chosen: 98 % of a row's weight lie within it."""
SHORTEST_PERIOD_S, PERIODS, REPEATED = 1.0, 20, 0.2
"""Detection of periodic motion: shortest period, number of candidate periods, and smallest share of readings that must
repeat. Chosen: random motion repeats less than a thousandth of its readings."""
NOISE_ABOVE_HZ = 25.0
"""Frequency above which a signal is noise. Measured: commanded motion ends at 5 Hz."""
PASSED = 0.17
"""Highest frequency that a conversion leaves unchanged, relative to the sampling rate. Derived: the passband of the
conversion's low-pass filter ends at 0.18."""
DITHER = 0.35
"""White noise, in rounding steps, from which the rounding errors of neighbouring samples are independent. Derived:
their correlation is exp(-4 pi^2 0.35^2), below one percent."""
TO_AND_FRO, NOISE_TO_AND_FRO, LEAST_SLOW = 0.1, 1.77, 50
"""Noise of slow readings from the share that step back and forth: largest usable share, noise in steps per share, and
fewest slow readings. Derived: a reading between two values takes one with probability p and the other with q. The mean
of p q over a step is sigma / sqrt(pi) for small sigma, so sigma is sqrt(pi) times the share. Noise of ``DITHER`` moves
ten of 50 readings."""
PHI_FLOOR_RAD, THETA_FLOOR_RAD, TORQUE_FLOOR_NM = 4e-6, 8e-7, 3e-4
"""Errors of the simulated mechanics in motion at 100 Hz, besides any sensor: soft rods and welds shift a wrist by
micrometres and hardly turn it. Measured: with these floors, the loops of random trials leave 0.55 (ideal sensors) and
0.8 to 1.2 (encoders of 19 and 20 bits) of the predicted residual."""
AT_REST = 0.2
"""Share of these floors that applies at rest, at any rate. Measured: static trials with ideal sensors show at most a
fiftieth of the floors' variance."""
FLOOR_HZ = 100.0
"""Sampling rate at which the floors above hold. Chosen."""
CURVATURE_EVERY = 3
"""Stride of the instants at which averaged derivatives are evaluated. Chosen: eleven per second."""
BLOCK_ROWS = 512
"""Number of rows whose derivatives are in memory at a time. Chosen; the result does not depend on it."""
COARSE_ROWS = 250
"""Number of rows used in the first steps, evenly spaced over all trials. Chosen: the early steps need no more."""
MAX_STEPS, MAX_COARSE_STEPS = 40, 30
"""Most steps in all, and on ``COARSE_ROWS``. Chosen: forty teams drawn from the prior needed six at most."""
LEAST_DAMPING, DAMPING = 1e-3, 10.0
"""Levenberg-Marquardt damping: first share of the diagonal after a step that raised the sum of squares, and the factor
by which it then grows or falls. Chosen, as in Marquardt's paper."""
RISE = 0.01
"""Relative rise of the sum of squares that a step may cause, because the row covariance depends on the point. Chosen:
full steps of teams that fit cause no rise; a full step between two different teams multiplies the sum by ten or more.
"""
FLAT = 0.01
"""Relative decrease of the sum of squares below which a damped step ends the descent. Chosen: if one recording is of
other robots, the sum falls by a thousandth per step along a valley."""
COARSE = 0.5
"""Largest step of any unknown, in posterior standard errors, that ends the steps on ``COARSE_ROWS``. Chosen."""
CONVERGED = 0.001
"""Largest step of any unknown, in posterior standard errors, at convergence. Measured: at 0.001 and 0.0001, the effect
of held robots' errors on the payload is predicted to within 3 %; at 0.002, to within 3.4 %."""
MISFIT = 1.3
"""chi2/n of the loops or balance of a recording above which the calibration does not explain it. Measured: below 1.1
on uncalibrated teams with no other error; noise adds 0.03."""
MISFIT_SIGMAS = 4.0
"""The same limit for few rows, in standard deviations sqrt(2/n) of chi2/n. Chosen: a static trial of two robots has
three dozen rows, and noise alone exceeds 1.3 in one of ten such trials."""
SUFFICES = 0.99
"""Share of a misfit that a change in one recording must explain to be reported, if it does not explain all of it.
Measured: slips of 0.2 to 1 deg explain 0.9999 and more by derivatives. If a joint rubs in all recordings, the best
change explains 0.07."""
ODOMETRY_RATIO = 0.01
"""Standard deviation of the relative errors of a driving base's odometry, in yaw, x and y. Chosen: tolerance of wheels.
"""
ROCKS = 2e-4, 2e-5
"""Standard deviations of how a base rocks: tilt by its acceleration [rad s^2/m] and by the moment of its load
[rad/(N m)]. Chosen: wheels of 0.7 MN/m under 40 kg, half a metre apart."""
FLOOR_M = -0.46
"""Height of the floor, on which a base rocks, in {b} [m]. Derived: models/omnid/omnid.xml."""
ROCKING_S = 0.5
"""Time in which a base forgets how it rocks on its wheels. Chosen: that of commanded motion, which moves the load."""
LOST = 0.1
"""Standard deviation of a base's error [m, rad] at the start of rows that follow others of the same trial. Chosen."""
DRIFT_LOG = 2.0
"""Standard deviation of the logarithms of what is learnt of the bases' errors. Chosen."""
