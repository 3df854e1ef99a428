"""Every constant that can change a verdict, what it decides, and where it comes from.

*Derived*: follows from something else that is named. *Measured*: on data, as said. *Chosen*: a round number; the
campaigns in docs/diagnosis/validation.md and docs/emps.md were run with it, and no study compares it with others.
What one cause alone has (tolerances, typical sizes, grids of its shapes) is in its file.
"""

# Evidence: what the data say about one candidate.

COMPLEXITY = 1.6
"""Penalty per parameter and ln n on the scale of chi-square. Chosen: stricter than the 1 of Schwarz's criterion."""
LEAST_INFORMATION = 1e-3
"""Inverse variance (in units of tolerance) below which a direction is undecidable. Chosen."""
SIGNIFICANT_LOG10_P = -6.0
"""To be looked at at all; also: tolerances strained more than that are no explanation. Chosen, so that the best of a
hundred candidates (of a thousand intervals, for a push) is by chance once in ten thousand recordings."""
INTERVALS_LOG10 = 3.0
"""What a transient pays for the intervals searched. Derived: about a thousand of them."""
CLEAN_CHI2_PER_N = 1.15
"""Nothing is left to explain below that. Measured: clean teams leave 1.02 to 1.08, tolerances in use up to 1.13."""
NOTICED_CHI2 = 38.0
"""Expected gain found nine times in ten. Derived: (sqrt(23.9) + 1.28)^2, 23.9 being chi-square at p = 1e-6."""
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

MOST_CAUSES = 3
"""Chosen; docs/diagnosis/method.md, 'Search'."""
EMPS_MOST_CAUSES = 10
"""The nominal axis is a bare mass without friction of any kind. Chosen; the benchmark's first recording takes eight."""
MOST_REJECTED = 4
"""Candidates that held-out trials may reject before the search ends. Chosen."""
LEADERS = 8
"""Significant candidates that are sharpened and compared. Chosen."""
FINER_ROUNDS = 4
"""Refinements of a shape around the best so far. Chosen."""
POLISH_ROUNDS = 3
"""Gauss-Newton steps of a shape after the grid. Chosen."""
REFIT_ROUNDS = 3
"""Gauss-Newton steps of causes and unknowns with exact residuals. Chosen."""
DIVERGED_RATIO = 1.5
"""Misfit over the last one from which such a step is not taken. Chosen."""
RIVAL_SHARE = 0.5
"""A rival explains at least this share of what the best does. Chosen."""

# Worth: is a further cause named beside others?

NEXT_SHARE = 0.25
"""Share of what those before it left that it must take away. Chosen; docs/diagnosis/method.md, 'Search'."""
LOOK_ALIKE_GROWTH = 10.0
"""Growth of a named cause's standard error beside it from which the two are the same. Chosen, after friction had been
divided among parallel gimbal axes (docs/diagnosis/validation.md, 'Verdicts', 10 times)."""

# Held out: does a cause help where it was not fitted?

SUPPORTING_TRIALS = 2
"""That it must help, when fitted to the others. Chosen: one may be chance, and more need not show the cause."""
AGAINST_SHARE = 1.0 / 3.0
"""What it harms over what it helps, at most. Chosen, after a count of trials had lost a hardening that two saw."""
INTERLEAVED_BLOCKS = 4
"""In which a transient's own trial is split, as nothing else shows it. Chosen."""
SHORT_ROWS = 24
"""A transient of fewer (2 s of a team) cannot be split; its evidence has to do. Chosen: blocks of three rows."""
INSIDE_SHARE = 0.1
"""Of its largest row: rows that a transient reaches; a trial's own unknowns spread a trace everywhere. Chosen."""

# Verdict and closed loop.

RESPONSE_SHARE = 0.8
"""Of the response's excess error that causes must remove, or what is left of a visible one is said beside the verdict.
Chosen."""
LEAST_SHARE = 0.3
"""Causes that explain less of a large misfit, of rows or closed loop, are no explanation. Chosen."""
MOST_BELIEVED = 2
"""More causes at one robot, or of so few families, imitate another. Chosen; docs/diagnosis/method.md, 'Verdict'."""
CLOSE_NATS = 20.0
"""Rivals that the rows put closer are simulated, too. Chosen: simulations cost most of the time."""
AMBIGUOUS_NATS = CLOSE_NATS / 4.0
"""Rivals that the rows put closer, and the closed loop does not part, cannot be told from a cause. Chosen."""
MARGIN_SHARE = 0.02
"""Simulations whose chi-square differs by less are equally good. Chosen."""
VISIBLE_CHI2_PER_N = 3.0
"""Of the nominal closed loop, from which causes have to improve it. Chosen."""
WINNING_SHARE = 0.5
"""Of the trials that a rival must do better in to replace a cause. Chosen: most trials, not one by much."""

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
REST_KNOTS_S = 0.5
"""Between knots of friction at rest, which follows the load. Chosen."""
PLAY_KNOTS_S = 0.2
"""Between knots of the travel that play leaves open at small forces. Chosen."""
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
