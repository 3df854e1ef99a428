"""A serial robot: its logs, rows, noise and causes; origins are named as in ``discrepancy.rules``."""

MOST_CAUSES = 60
"""A nominal model that says nothing of friction lacks four or five causes a joint. Chosen: no limit for seven axes."""

# Filters and rows.

SMOOTH_HZ = 60.0
"""Cut-off before the nonlinear formulas. Chosen: three times the rows', so that filtering and they commute."""
SMOOTH_SHARE = 0.2
"""The same over the sampling rate, at most. Chosen: a cut-off must stay below half of it."""
WORK_RATIO = 4.0
"""Rate of the mechanics over ``SMOOTH_HZ``, about. Derived: what it folds back has been damped to 1/80."""
CUTOFF_HZ = 20.0
"""Cut-off of the rows. Chosen: arms move below 5 Hz, and bend from some 10 Hz on."""
LOAD_CUTOFF_SHARE = 0.35
"""Of that, for a load that is differentiated twice. Chosen: arms move below 5 Hz, and so does the load of their links;
noise of the trace falls with the fourth power."""
SERVO_CUTOFF_HZ = 10.0
"""The same where torques follow from duties. Chosen: a servo moves below 3 Hz, and faster than this its duty tells how
the gear sticks and slips, which no cause describes. Measured with 20 Hz on an XL330: springs and delays, or a ripple,
were named from two of three pairs of its gains; with 10, from all, friction, friction by load and back-EMF alone."""
CUTOFF_SHARE = 0.15
"""The same over the sampling rate, at most. Chosen."""
ROWS_RATIO = 2.5
"""Rows a second over the cut-off. Chosen: filtered noise is then nearly white."""
HALF_PERIODS = 2.5
"""Half of the filter's length in periods of its cut-off. Derived: it has died to 1e-3 there."""
EDGE_PERIODS = 6.0
"""Left out at both ends of a log, in periods of the first cut-off. Derived: padding is forgotten there, to 1e-8."""
BLOCK_S, FEWEST_BLOCKS = 6.0, 3
"""Length of a block of one log, and blocks at least. Chosen: long enough to hold most of a motion's poses."""
LEAST_ROWS = 40
"""That a block must have to be one. Chosen."""
ERROR_BLOCK_S = 0.5
"""Blocks of the standard errors. Chosen: a reversal takes less."""

# Noise.

AR_ORDER = 4
"""Of the whitening. Chosen."""
NOISE_BAND = (1.5, 6.0)
"""Where the torque's noise is read off, over the rows' cut-off. Chosen: next to the rows, where little moves."""
TOP_BAND = (0.25, 0.45)
"""Where the position's is, over the sampling rate. Chosen: motion is least there, whose noise is differentiated."""
FILTERED_BAND = (0.1, 0.2)
"""The same of a log that was low-passed when it was resampled. Derived: ``mocobot_logs`` keeps as much."""
SPOILT_SHARE = 0.05
"""Of a trace's square, that noise of the positions may be. Derived: a fit would be off by as much; a share
of friction by load that is off by 5 % is better than none."""
SPOILT_GAIN = 8.0
"""Of chi-square, that noise in a trace may have by meeting itself in the residual. Derived: a third of the 24 from
which a single number is significant."""
STILL_S, STILL_STEPS = 0.1, 0.3
"""How long a position's reading must be the same, and within which share of its step (of a resampled log it ripples a
little), to be without noise. Chosen: rounding is all the noise there is then."""
STICKING_SHARE = 0.06
"""Of a joint's typical speed, by which its smoothed velocity is off where it turns round. Derived: sticking takes some
10 ms there and a period of ``SMOOTH_HZ`` 17 ms, in which a joint that takes 0.3 s from one speed to the other would
have gone on by as much."""
LEAST_FREEDOM = 0.1
"""Of the rows, that a fit of all causes leaves. Chosen: with less the logs are too short to be told noise from."""
SEGMENT_S = 0.5
"""Of the spectra whose median over time is the noise: bursts, such as reversals, are not. Chosen."""
NOISE_SEED = 8113
"""Of drawn noise. Chosen: any will do; fixed, so that a verdict can be had again."""
LEAST_LEVEL = 1e-3
"""Noise of a channel over its motion, at least. Chosen: no drive tells its torque better than to a thousandth."""

# Speeds.

SLOW_SHARES = (0.01, 0.003, 0.03, 0.1)
"""Of a joint's typical speed, below which the direction of friction fades; the first is the catalogue's. Chosen."""
SLOW_ROUNDINGS = 2.0
"""The same, at least, over what rounding of the positions makes of a velocity. Chosen: two standard deviations; a joint
that creeps through the steps of a coarse encoder has no direction."""
STRIBECK_SHARES = (0.05, 0.1, 0.2)
"""The same, over which low-speed friction may fade. Chosen: slower is how dry friction fades, faster is viscous."""
STRIBECK_RANGE = (0.02, 0.1)
"""The same, beyond which it may not. Derived: half of the least that is tried; and of what fades over more than the
latter a straight line over the speed, Coulomb and viscous friction, explains about half (0.39 of the square over a
TX40's speeds; 0.82 over 0.4). Measured with 0.4 there: such a peak of 11.8 N m and a bend of 49 N m, both of one curve,
left joint 2 with 1.2 N m of Coulomb friction in one half of the log and 3.8 in the other."""
STRIBECK_PER_S = 0.1
"""Speed over which it may fade in any case [rad/s or m/s]. Chosen: where lubrication sets in depends on the contact,
not on how fast a joint was moved; slow logs must not hide it."""
EXPONENTS = (0.5, 0.3, 0.7)
"""Of the speed in friction that grows more slowly than it. Chosen: between Coulomb (0) and viscous (1)."""
THINS_SHARES, THINS_FINER, LINE_NODES = (0.0, 0.3, 1.0), (0.6, 1.5), 40
"""Of the typical speed, below which such friction is viscous: those tried, factors that are tried next, and points at
which its straight line is taken. Chosen: what is faster than the typical speed is a straight line in a log."""
WARMING_SHARES, WARMING_RANGE = (0.3, 1.0, 0.1), (0.05, 1.0)
"""Time over which friction fades as a joint warms up, over the longest log's: those tried, and the range. Chosen: what
takes longer is a straight line in a log, as the longest nearly is; what is faster is the first stroke."""
BRISTLES_RAD = (5e-4, 1e-3, 2e-3, 4e-3)
"""By which dry friction gives way before it slips, if it does. Chosen: gears and greased bearings bend by a few tenths
of a mrad to some mrad; friction that bends by 2 mrad was taken for a lack of it near standstill."""
LEAST_SPEED = 1e-6
"""Typical speed of a joint that does not move [rad/s or m/s]. Chosen: no more than a number to divide by."""
LEAST_TRAVEL = 1e-3
"""Of a joint, in rad or m, below which nothing is asked of its friction. Chosen: ten steps of a coarse encoder."""

REST_KNOTS_S, SHORTEST_REST_S = 0.5, 0.03
"""Between knots of friction at rest, which follows the load, and rests for which it is left open. Chosen; and measured:
joints under a soft controller stick for some 50 ms where they turn round, and fitted rotors of four simulated arms were
off by 2.1 standard errors (rms) with 0.1 s, by 1.1 with this and with less."""
SERVO_KNOTS_S = 0.02
"""The same, both, where torques follow from duties: no row tells anything at rest. Derived: rows are as far apart."""
LEAST_REST_SHARE = 1e-6
"""Of a unit, that such a friction must leave in the rows. Chosen: rounding is less."""

# What is normal of a model.

INERTIA_SHARE = 0.1
"""Of masses, lengths to centres of mass, and moments of inertia, by which a CAD model is off. Chosen: drawings leave
out cables, grease and screws."""
JOINT_SHARE = 0.03
"""Of rotors and friction that a model names, by which they are off. Chosen: no two fits of friction agree better, and
sticking at reversals moves fitted rotors by up to 0.02 (of a simulated arm without any error)."""
MOST_INERTIA_SHARE = 1.0
"""Of the same, beyond which a link is not off but another. Chosen: rotors and payloads add more, and are themselves."""
DENSER = 2.0
"""Of the same, beyond which no link is heavier. Derived: steel has 2.9 times the density of aluminium."""
MOST_SE = 2.0
"""Spreads of a kind in the most that one of it can be. Derived: of a normal one, nineteen in twenty are within two."""
RUBS_MORE = 2.0
"""Tolerances by which dry friction must be off, or its giving way is that of a healthy one. Chosen: where a healthy
joint and one with the least slab (``LEAST_SLAB``) are about equally likely."""
LEAST_LINK_M = 0.02
"""Size of a link, at least, of which its centre of mass is off by that share. Chosen."""
ZERO_RAD, ZERO_M = 2e-3, 5e-4
"""By which a joint's zero is off. Chosen: an arm that was mastered with its marks, not measured."""
LENGTH_M = 1e-3
"""By which lengths of a link are off. Chosen: castings."""
LEVEL_RAD = 5e-3
"""By which a base is not level. Chosen: a bubble's worth."""
SCALE_SHARE = 0.02
"""By which torques are off in scale. Chosen: torque constants are given to two digits."""
MOST_ZERO_RAD, MOST_LENGTH_M = 0.2, 0.02
"""Beyond which a zero or a length is not off but that of another pose or model. Chosen: 11 degrees, 2 cm."""
DELAY_S = 5e-4
"""By which torques are late or early. Chosen: half a period of a drive's loop at 1 kHz."""
SCALE_BENDS, SCALE_BEND_STEP, MOST_BEND = (-0.1, 0.1), 0.1, 0.3
"""Of an error of a torque's scale, by which share it is larger at twice the typical load: those tried, over which
slopes are taken, and from which it is not the scale that is off. Chosen: iron saturates by some percent; steps find the
rest."""
LEAST_SCALE, MOST_SCALE = 2.0 * SCALE_SHARE, 0.75
"""Up to which a scale that bends is none that stands out, and from which it is a wrong unit or gear. Chosen: friction
that grows with the load was a scale of 2 % that bends; units and gears are factors of two and more. With 0.5 a drive
whose iron saturates, off by 60 % at rest, was friction and a counterbalance."""

# Servos.

LEAST_DRIVEN_SHARE = 0.1
"""Of the square of what a drive was given, that the model's torque must account for. Chosen: of a joint that only rubs,
nobody can tell what a volt is worth."""
MOTOR_SHARE, MOVES_THROUGHOUT = 0.5, 0.98
"""Cut-off of the fit of what a volt is worth, over the rows', and the share of its filter's window in which the joint
moves. Chosen: noise of accelerations would make the torque look smaller than it is."""
UNKNOWN_SCALE_SHARE = 0.1
"""By which what a volt or an ampere is worth may be off once it was fitted. Chosen: as much as the masses."""
MOVING_SHARE, LEAST_OFF_S = 0.3, 0.2
"""Of a joint's typical speed, and for how long, it moves while its drive is off. Chosen: a fall takes so long."""
LOOP_STRETCH_S = 1.0
"""Stretches whose scatter gives a loop's standard errors. Chosen: longer than any loop remembers."""
MOST_LOOP_SHARE = 0.1
"""Of a duty's variance, that a loop's law may leave. Chosen: what leaves more is another kind of loop."""
CUT_OFF_SHARE, LEAST_CUT_OFF, CUT_OFF_SAMPLES = 0.97, 0.003, 7
"""Of the largest duty, up to which the law of a loop is fitted; the share of the time in which that law asks for more
than the largest by as much, from which it is cut off; and samples left out around a large one. Chosen: resampling
ripples for three samples on either side."""
LATE_S = 1e-3
"""Lag of a loop that is worth a word. Chosen: less is within the stamps of a bus."""

# Shapes and searches.

RIPPLE_TURNS = (1.0, 2.0)
"""Periods of a ripple in one turn of joint or motor. Chosen: eccentricity, and a gear's or a rotor's two sides."""
MOST_RIPPLE_HZ = 0.5
"""Of the rows' cut-off: at which a ripple may pass at the joint's typical speed. Chosen: faster ones are filtered."""
NEUTRAL_SHARES, NEUTRAL_STEP_SHARE = (0.0, -0.5, -0.25, 0.25, 0.5), 0.25
"""Of a joint's travel, from its middle, where a spring's neutral is looked for, the first that of the catalogue; and
what slopes by it are taken over. Chosen: all of the travel. A spring that is neutral far beyond it is an offset."""
PAYLOAD_M, PAYLOAD_FINER_M, PAYLOAD_STEP_M = (0.1, 0.25), (-0.03, -0.01, 0.01, 0.03), 0.02
"""Where a payload's centre is looked for in the last link's frame, and differences by it. Chosen: hands are as long."""
PAYLOAD_CLOSER = (0.85, 0.7, 0.5)
"""Of how far its centre is away, where its inertia is none that can be. Chosen: its first moment is known best."""
PAYLOAD_GYRATION_M, PAYLOAD_INERTIA_SHARE = 0.04, 0.5
"""Radius of gyration of a payload, and the share of its square by which its moments and products differ from those of
such a ball. Chosen: a ball of 6 cm, within 30 %."""
SOFT_LOAD_SHARE = 0.03
"""Of a joint's typical torque, over which play changes sides. Chosen."""
PUSH_S, SHORTEST_PUSH_S = (0.2, 0.4, 0.8, 1.6), 0.1
"""Durations searched, and what refining may leave. Chosen: octaves."""
STEP_RAD, STEP_M = 1e-4, 1e-5
"""Of differences by joint positions and by lengths. Derived: squares of the step and rounding are both below 1e-6."""
STEP_RATE, STEP_ACCELERATION = 1e-2, 1e-1
"""Of differences by a joint's rate and by its acceleration, per second and per second squared. Derived: torques are
quadratic in the one and linear in the other, so that any will do that rounding does not see."""
LOAD_STEP = 1e-3
"""Of differences by torques that the model asks for, as a share of a column. Derived: what depends on loads is linear
in them but where they change sign; rounding is far below."""
ALIKE_SHARE, MOST_UNITS = 0.02, 30.0
"""Of a trace's square, that another cause may leave of it to be the same, and how many units of that it may take.
Chosen: a seventh of the trace itself; what would take more is no imitation."""
REDUNDANT = 1e-9
"""Of the largest singular value, below which columns depend on each other. Derived: rounding is 1e-12."""

FORM_SHARE, FORM_DEGREE = 0.1, 6
"""By which real causes have another form than their law, in each of some ways (``rows.other_forms``), of their trace in
amplitude; and the degree of polynomials in the position. Chosen: of the forms that were hidden in a simulated arm, a
harmonic of 15 %, a dress pack that stiffens by 20 % and readings that drift by 20 % must be no second cause."""
SERIAL_LAW_SHARE = 1.0
"""Standard deviation of what the law of a lasting cause leaves of its trace, in amplitude. Chosen: noise is that of
the sensors, less than gears leave whatever is named."""
RIVAL_SHARE = 0.2
"""The same towards a rival: traces that differ by less leave it open which of the two it is. Chosen: what was hidden in
a simulated arm in other forms is off by 15 to 25 %."""
UNSEEN_NATS = 20.0
"""What something unlisted may leave beside a lasting cause without being seen. Chosen: a third of ``UNLISTED_NATS``,
since where the cause acts is known."""
RESTS = 2.0
"""Noise over which a joint's readings must scatter for it to move. Chosen: less of a motion tells nothing."""
