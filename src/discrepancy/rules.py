"""Every constant that can change a verdict, what it decides, and where it comes from.

*Derived*: follows from something else that is named. *Measured*: on data, as said. *Chosen*: a round number; the
campaigns in docs/diagnosis/validation.md and docs/emps.md were run with it, and no study compares it with others.
What one cause alone has (tolerances, typical sizes, grids of its shapes) is in its file.
"""

# What the data say about one candidate.

LEAST_INFORMATION = 1e-3
"""Inverse variance (in units of tolerance) below which a direction is undecidable. Chosen."""
CLEAN_CHI2_PER_N = 1.15
"""Nothing is left to explain below that. Measured: clean teams leave 1.02 to 1.08, tolerances in use up to 1.13."""
NOTICED_SE = 1.2816
"""Standard errors by which noise lessens a value one time in ten. Derived: a quantile of the normal distribution."""
ABSURD_UNITS = 1e3
"""A detection limit of so many tolerances (or typical sizes) is none. Chosen."""

# Whitening.

AR_ORDER = 2
"""Autoregression of whitened channels, unless a rig says otherwise. Chosen: rows are nearly white already."""
EMPS_AR_ORDER = 8
"""Measured: more does not whiten the benchmark's noise better (by Akaike's criterion)."""
ROWS_PER_COEFFICIENT = 10
"""A series must have more rows than so many for each coefficient, or stays as it is. Chosen."""
LOUD_POWER = 2.25
"""Noise of a row, in squares of that of the others, above which it has a weight of its own. Derived: four standard
deviations of a mean square of ``NOISE_DRAWS`` draws, sqrt(2/24) = 0.29, above 1."""
SHRINKAGE_SHARE = 0.05
"""By which the channels' covariance is drawn to its diagonal at least. Chosen."""

# Search: which candidates are compared, how their shapes are sharpened.

MOST_CAUSES = 12
"""Of one verdict. Chosen: no more than a guard; the benchmark's first axis takes eight."""
LEADERS = 8
"""Candidates of a scan that are looked at closely, and as many more that are the likeliest of their cause. Chosen."""
FINER_ROUNDS = 4
"""Refinements of a shape around the best so far. Chosen."""
POLISH_ROUNDS = 3
"""Gauss-Newton steps of a shape after the grid. Chosen."""
REFIT_ROUNDS = 3
"""Gauss-Newton steps of causes and unknowns with exact residuals. Chosen."""

# Verdict and closed loop.

RESPONSE_SHARE = 0.8
"""Of the response's excess error that causes must remove, or what is left of a visible one is said beside the verdict.
Chosen."""
CLOSE_NATS = 20.0
"""Shapes are sharpened of candidates that a scan puts closer to its likeliest. Chosen: it costs time."""
AMBIGUOUS_NATS = CLOSE_NATS / 4.0
"""Rivals that the rows put closer are simulated; what the closed loop does not part either cannot be told apart.
Chosen."""
MARGIN_SHARE = 0.02
"""Simulations whose chi-square differs by less are equally good. Chosen."""
VISIBLE_CHI2_PER_N = 3.0
"""Of the closed loop, from which something is said of it beside the verdict. Chosen."""

# A team: what is accepted.

LEAST_S = 5.0
"""Of all recordings together below which nothing is diagnosed. Chosen."""
GOOD_S = 30.0
"""With which a diagnosis starts to be of use; only said. Chosen."""

# A team: filters and rows.

TEAM_PRE_HZ = 20.0
"""Cut-off before the nonlinear formulas. Derived: high enough that filtering and they commute to within the noise."""
TEAM_CUTOFF_HZ = 5.0
"""Cut-off of the rows. Chosen."""
TEAM_ROWS_HZ = 12.5
"""Chosen with the cut-off: it leaves filtered noise nearly white."""
TEAM_JACOBIAN_HZ = 25.0
"""Rate of derivatives, interpolated between. Chosen: twice the rows'."""
TEAM_TRIM_S = 2.0
"""Left out at both ends of a recording. Chosen."""
STILL_RAD_PER_S = 1e-3
"""Joints slower than that rest. Derived: twenty times what rounding does below ``HOLD_CUTOFF_HZ``."""
HOLD_CUTOFF_HZ = 2.0
"""Cut-off of the speed that tells rest. Chosen."""
SETTLING_S = 0.3
"""Left out at both ends of a hold. Chosen."""
SHORTEST_HOLD_S = 1.2
"""Left of a hold, to be one row. Chosen."""

# A team: noise of the sensors.

MODEL_PHI_RAD, MODEL_THETA_RAD, MODEL_TAU_NM, MODEL_HZ = 2e-6, 7e-7, 3e-4, 100.0
"""What the model itself leaves beside any sensor, as noise of readings at ``MODEL_HZ``; as much in a band at any
other rate. Measured: what soft rods, welds and the integrator leave of trials with ideal sensors weighs as much as 1 to
3 urad of phi below 0.5 Hz and a third of that to 2 Hz, 0.1 to 2 urad of theta, and, at the motion's own frequencies,
0.1 to 0.2 mN m in random trials."""
MODEL_BELOW_HZ, MODEL_ABOVE = 2.5, 0.2
"""Up to where, and the share of it that is left above. Measured: of the same, a twentieth of the power from 3 Hz on,
and hardly anything from 4 Hz."""
NOISE_ABOVE_HZ = 25.0
"""Where nothing moves, so that what is there is noise. Chosen."""
TEAM_SMOOTH_HZ = 12.0
"""Cut-off of signals when their rounding is drawn anew, and of rates that say where friction slides. Chosen."""
SLOW_HZ, SMOOTHER_OCTAVES = 1.0, 3
"""Where rounding shows as stairs: cut-off of the speed that tells their frequency, and how far that of the signal
falls with it. Chosen: the trajectory need only be one that the stairs may have come from."""
PHASE_TRAVEL = 4.0
"""Steps of travel after which a rounding error is drawn anew. Chosen: independent from one rest to the next, and
changes an encoder's speed by half at most."""
NOISE_DRAWS = 24
"""From which the rows' covariance is made. Chosen."""
PHI_FLOOR_RAD, THETA_FLOOR_RAD, TAU_FLOOR_NM = 2.5e-5, 1e-5, 6e-4
"""Of the closed loop. Measured: the integrator at 1 and at 0.25 ms; docs/diagnosis/validation.md, 'Integration'."""
TEAM_TIMESTEP_S = 1e-3
"""Of the closed loop's simulation. Measured: with it the integrator's error stays below the sensors' noise (ibid.)."""
LEAST_MOMENT_RATIO = 1e-3
"""Least principal moment of a simulated payload over the largest: a body needs some. Chosen."""

# A team: its causes.

PUSH_MOVES = (-0.4, -0.2, -0.1, -0.05, 0.0, 0.05, 0.1, 0.2, 0.4)
"""By which ends of a push are moved to refine it, in its duration; the axis' too. Chosen."""
TEAM_PUSH_S = (0.4, 0.8, 1.6, 3.2, 6.4)
"""Durations searched. Chosen: octaves."""
TEAM_SHORTEST_PUSH_S = 0.1
"""That refining may leave. Chosen."""
WORST_INTERVALS = 2
"""Per trial that become candidates, of those durations; the axis' too. Chosen."""
TEAM_SHORTEST_REST_S = 0.15
"""Rests for which friction is left open. Chosen."""
REST_RAD_PER_S, REST_NM_PER_S = 1e-3, 0.2
"""Below which a joint, or a spring's torque, rests and its friction is noise. Chosen: as of the causes."""
REST_KNOTS_S = 0.5
"""Between knots of friction at rest, which follows the load. Chosen."""
PLAY_FORCE_N = 0.4
"""Below which a payload may be anywhere in its play. Chosen."""
PLAY_KNOTS_S = 0.2
"""Between knots of the travel that play leaves open at small forces. Chosen."""
LENGTH_MOST_M = 0.02
"""By which a leg's lengths may be off. Chosen: a thousand tolerances; as large, columns are no straight lines."""
PULL_SE = 5.0
"""Standard errors that the stiffness of a payload's tether must be. Measured: uncalibrated robots without one leave up
to 3, with a constant force of 2 N."""
SLOSH_LENGTHS_M = (0.04, 1.0)
"""Derived: pendulums of 2.5 to 0.5 Hz; slower and faster ones look like drag or play."""
SLOSH_MOST_DAMPED = 0.3
"""Largest damping ratio tried. Chosen."""
SLOSH_SWINGS = 0.25
"""Largest damping ratio named. Chosen, after one of 0.29 had been named for drag."""
SLOSH_REACH_M = 1.5
"""From the centre of mass to where it hangs at most. Chosen: no payload of three robots is larger."""

# An EMPS axis: what is accepted of a recording.

EMPS_LEAST_HZ = 200.0
"""Chosen: position is differentiated twice."""
EMPS_LEAST_S = 4.0
"""Shorter recordings are refused. Chosen."""
JITTER_SHARE = 0.1
"""Of a period, by which stamps may be off the grid. Chosen."""
LONGEST_GAP_S = 0.02
"""Gaps up to here are filled. Derived: motion below the rows' 40 Hz does not change much in them."""
LEAST_MOTION_M = 1e-3
"""A recording that moves less is refused. Chosen."""
STUCK_S, STUCK_WHILE_M = 0.05, 1e-3
"""A position that stays for so long while the reference moves so far is stuck. Chosen."""
STUCK_SHARE = 1e-9
"""Of the way, by which readings that are the same may differ. Derived: what rounding makes of one value."""
LONGEST_STUCK_SHARE = 0.25
"""Of a recording, that may be left out. Chosen."""
COARSE_M = 1e-6
"""Steps of the position above which that is said. Chosen; ``SPOILT_SHARE`` decides what is not looked for."""
SIGN_HZ = 40.0
"""Cut-off of the check of the voltage's sign. Chosen: that of the rows."""

# An EMPS axis: blocks, filters, noise.

EDGE_S = 0.15
"""Left out at both ends, where smoothing has one side only. Chosen."""
BLOCK_LENGTH_S = 6.0
"""Of a block where the reference does not repeat. Chosen: about a cycle of the benchmark (6.24 s)."""
CUT_SHARE = 0.06
"""Of a block, by which a cut may move to where the motion is steady. Chosen."""
SAME_CYCLE_SHARE = 3e-4
"""Of the reference's range, to which its cycles agree. Measured: filled gaps leave that much."""
LEAST_PERIOD_S = 1.0
"""Shorter cycles are none. Chosen."""
LEAST_ROWS = 100
"""That a block must have to be one. Chosen: a second of them."""
EMPS_SMOOTH_HZ = 100.0
"""Cut-off before differentiating. Chosen: well above the rows' own."""
EMPS_CUTOFF_HZ = 40.0
"""Cut-off of the rows. Chosen."""
EMPS_ROWS_HZ = 100.0
"""Chosen with the cut-off, as for a team."""
HALF_S = 0.05
"""Half of the filter's length, and what a block's ends lose. Derived: it has died to 1e-3 there."""
REPEATED_SHARE = 0.02
"""Of the tracking error, by which cycles of one motion may differ. Chosen; the benchmark's differ by less."""
NOISE_SEED, DITHER_SEED = 20250, 0
"""Of drawn noise (a team's; the axis' rounding). Chosen: any will do; fixed, so that a verdict can be had again."""
SPOILT_SHARE = 0.01
"""Of a trace's square, that rounding may be. Derived: a fit would be off by as much."""
ERROR_BLOCK_S = 1.0
"""Blocks of the standard errors. Measured: benchmarks/emps/emps_errors.py; the rest correlates over a few tenths."""
REMEMBERED = 16
"""Samples before a block that the simulated loop starts with. Chosen."""

# An EMPS axis: its causes.

GIVEN_TO_SHARE = 1e-4
"""By which a gain may be off for the digits that it is given with. Chosen."""
SHORTEST_RIPPLE_M = 1e-3
"""Derived: shorter ripples are faster than the rows at most speeds of the benchmark."""
EMPS_PUSH_S = (0.2, 0.4, 0.8, 1.6)
"""Durations searched. Chosen: octaves."""
EMPS_SHORTEST_PUSH_S = 0.15
"""Anything shorter cannot be told from friction where the axis turns round. Chosen."""
PULSE_PERIODS_S = (0.2, 6.0)
"""Of trains of pulses searched. Chosen."""
PULSE_BINS = 50
"""Of a folded series, so widths from 4 to 96 %. Chosen; edges are sharpened to the sample afterwards."""
EQUAL_SHARE = 1e-9
"""By which what is equal may differ. Derived: rounding is a thousandth of that."""
ON_IT = 1e-6
"""To a whole number, or an edge of pulses [s]: what is that close is on it. Derived: rounding is far less."""
PULSE_STEPS = 6
"""Of a pulse, by which pulses in step with the motion are moved and shortened. Chosen."""
PULSE_FOLD_HZ = 100.0
"""Rate of the folded series. Chosen: that of the rows."""
SLOW_MPS = 1e-3
"""Below which the direction of friction fades, where nothing else is tried. Chosen."""
SLOWER_MPS = (1e-3, 1e-4, 3e-4, 3e-3)
"""The same, of dry friction by itself; the first is the catalogue's. Chosen."""
EMPS_SHORTEST_REST_S = 0.1
"""Rests for which friction is left open. Chosen."""
STRIBECK_MPS = (0.01, 0.004, 0.02, 0.04)
"""Speeds over which low-speed friction may fade. Chosen: slower is how dry friction fades, faster is viscous."""
CARRIAGE_SHARE = 0.5
"""Of the moving mass, behind a play. Chosen; 'What cannot be decided' in docs/emps.md says so."""
PLAY_SOFT_N = 2.0
"""Force over which a play changes sides. Chosen."""
PLAY_HZ = 60.0
"""Cut-off of these sides. Chosen."""
PLAY_STEPS = 3.0
"""Of the encoder, below which a play is rounding, which has a hysteresis of its own. Chosen."""

# Inference: what is learnt from the data, and with what priors.

CELL_BANDS = 6
"""Octaves of frequency in which the noise has powers of its own, of every group of channels and trial. Chosen."""
POWER_NUMBERS = 20.0
"""Numbers that the prior of a power counts for, at 1: whitening is right to 30 % without data. Chosen."""
SPREAD_NUMBERS = 4.0
"""Numbers that the tolerance counts for when a kind's spread is learnt. Chosen: that a kind scatters is no likelier
beforehand than that one of its places is at fault."""
MOST_SPREAD = 1e3
"""Of a kind over its tolerance. Chosen: an encoder's zero of 6 deg."""
LEAST_SLAB = 4.0
"""Size of what counts as a fault over the tolerance, at least. Chosen."""
LEAST_SIZE = 1e-6
"""Of a cause without a tolerance over its typical size. Derived: not to divide by nought."""
LEARN_ROUNDS, LEARN_NATS = 30, 0.05
"""Steps of powers and spreads at most, and the gain of evidence below which they have settled. Chosen."""
LEAST_POWER = 0.5
"""Of a cell over that of its whitening. Chosen: some noise of healthy robots is drawn larger than it is."""
FLAT_SHARE = 1e-10
"""Information that shared unknowns have beforehand, over that of the data. Derived: as good as none."""
PRIOR_ODDS = 0.05
"""Of any cause of the catalogue being there, at all its places together. Chosen: one in a team, of twenty causes."""
SLAB_OCTAVES = 10.0
"""In which the size of a fault is equally likely. Chosen: from the tolerance to a thousand times that."""
INTERVALS = 1000.0
"""At which an event may be. Derived: about so many are searched."""
LOOKED_AT_NATS = -5.0
"""Log odds in the scan, from which a candidate is looked at closely. Chosen: what it leaves open may make up for it."""
HELD_FACTOR = 1.5
"""Spread of a kind from which it is scanned within its tolerance, too. Chosen."""
WORST_EVENTS = 3
"""Intervals looked at closely. Chosen."""
NAMED_NATS = 5.0
"""Log odds from which a cause is named. Derived: a false alarm costs as much as 150 misses, ln 150."""
EXCHANGES = 4
"""Rounds in which causes are exchanged and taken away after one was added. Chosen."""
EXCHANGED_NATS = 1.0
"""By which another cause, or another shape, must be likelier to be taken instead. Chosen: less is a matter of steps."""
DIVERGED_NATS = 50.0
"""Fall of the evidence from which a Gauss-Newton step is not taken. Chosen."""
SETTLED_SE = 0.05
"""Standard errors: a value that moves less has settled. Chosen."""
CELL_NATS = 4.0
"""What a process of its own in a cell costs. Chosen: about a hundred cells are looked at, ln 100."""
UNLISTED_NATS = 60.0
"""Of all such processes, from which what is left is not noise. Chosen."""
LAW_SHARE = 0.2
"""Standard deviation of what the law of a cause that is there leaves of its trace, in amplitude. Chosen."""
EMPS_LAW_SHARE = 1.0
"""The same for what lasts on the axis. Chosen: its first recording leaves four times the noise whatever is named."""
LISTED_ODDS = 4.0
"""That a cause is one of the catalogue rather than an unlisted one that looks like it. Chosen."""
LAW_ERROR_SHARE = 0.02
"""By which the law of a cause puts its size off; part of every standard error. Chosen."""
LEAST_PROBABILITY = 0.5
"""From which a cause is named; below, it is a suspicion. Derived: it is then likelier than all else together."""
SCATTER_FACTOR = 3.0
"""Spread of a kind over its tolerance, from which a team is said to be off in it. Chosen."""
CONTRADICTED = 0.5
"""By which causes that make the closed loop's response worse lose probability. Chosen: as likely wrong as not."""
STRAIGHT_CHI2_PER_N = 0.01
"""What curvature adds to chi-square, from which all is linearised again. Chosen: a hundredth of the noise."""
BASE_ROUNDS = 4
"""Linearisations at most. Measured: robots 1 deg off take two."""
DOUBTFUL, LITTLE_SHARE = 2, 0.05
"""Causes in a row that are less likely than not when they are added, and the share of what is left (in nats) that they
explain at most, after which no more are looked for. Chosen: one may become likely beside the next."""
