"""An EMPS axis: its recordings, rows, noise and causes; origins are named as in ``discrepancy.rules``."""

# What is accepted of a recording.

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

# Blocks, filters, noise.

EMPS_AR_ORDER = 8
"""Measured: more does not whiten the benchmark's noise better (by Akaike's criterion)."""
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
DITHER_SEED = 0
"""Of drawn rounding. Chosen: any will do; fixed, so that a verdict can be had again."""
SPOILT_SHARE = 0.01
"""Of a trace's square, that rounding may be. Derived: a fit would be off by as much."""
ERROR_BLOCK_S = 1.0
"""Blocks of the standard errors. Measured: benchmarks/emps/emps_errors.py; the rest correlates over a few tenths."""
REMEMBERED = 16
"""Samples before a block that the simulated loop starts with. Chosen."""

# Its causes.

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
EMPS_LAW_SHARE = 1.0
"""The same for what lasts on the axis. Chosen: its first recording leaves four times the noise whatever is named."""
