"""A team that carries one payload: its rows, noise and causes; origins are named as in ``discrepancy.rules``."""

# What is accepted.

LEAST_S = 5.0
"""Of all recordings together below which nothing is diagnosed. Chosen."""
GOOD_S = 30.0
"""With which a diagnosis starts to be of use; only said. Chosen."""

# Filters and rows.

TEAM_PRE_HZ = 20.0
"""Cut-off before the nonlinear formulas. Derived: high enough that filtering and they commute to within the noise."""
TEAM_CUTOFF_HZ = 5.0
"""Cut-off of the rows. Chosen."""
TEAM_ROWS_HZ = 12.5
"""Chosen with the cut-off: it leaves filtered noise nearly white."""
TEAM_JACOBIAN_HZ = 25.0
"""Rate of derivatives, interpolated between. Chosen: twice the rows'."""
PART_S = 180.0
"""Of a recording at most that is looked at as one trial. Chosen: what a trial leaves open costs its square, and ten of
its overlaps are a tenth of that; longer than any trial of the experiment."""
LINEAR_BYTES = 1.5e8
"""Of all linear trials, from which they are kept in files. Chosen: memory; those of seven minutes of three robots."""
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
STRAIGHT_CHI2_PER_N = 0.01
"""What curvature adds to chi-square, from which all is linearised again. Chosen: a hundredth of the noise."""
STRAIGHT_BESIDE_CHI2_PER_N = 0.1
"""The same beside causes, where a step takes 6 to 10 s. Chosen. Measured: a tether's pull down, known to 0.09 N, is
0.67 N off where columns miss 34 in chi-square per n, and 0.34, 0.18 and 0.11 N where they miss 2.0, 0.45 and 0.07."""

# Errors of the laws.

TEAM_LAW_ERRORS = {
    **dict.fromkeys(("phi_zero", "theta_zero", "link_length", "base_creep", "grasp_play"), 0.002),
    **dict.fromkeys(("joint_friction", "sea_hysteresis", "sea_scale", "torque_skew"), 0.005),
    **dict.fromkeys(("base_tilt", "sea_bias", "sensor_lag", "gimbal_friction", "payload_mass"), 0.01),
    **dict.fromkeys(("base_compliance", "slosh"), 0.03),
}
"""``LAW_ERROR_SHARE`` by cause, where it is another. Measured on kept sealed sets (docs/diagnosis/validation.md), forms
in which sizes compare with the law's among them: with these, errors are 0.7 to 1.25 of their standard errors, rms by
cause, but for grasps that give way and tethers of the payload, where sets of older rules make it 2.0 and 1.8; with 0.02
for all, those of zeros, lengths, friction in driven joints, hysteresis and scales had been 0.1 to 0.75 of them."""

# Noise of the sensors.

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
NOISE_LINES, CHATTER_STEPS = 0.5, 10.0
"""Share of the amplitude there that is between the lines, below which the lines are no noise: a joint that chatters.
And over the torque's step, from which on that is worth a note and, where it is over the noise as well, wider filters.
Chosen: healthy joints have no lines, and what a tenth of a newton metre does is 0.04 mN, as it goes with the square."""
CHATTER_OVER, CHATTER_RATE_SHARE = 2.0, 0.45
"""Cut-off of signals in which something chatters, over its frequency, and at most over the sampling rate. Derived: the
mean of a torque times the angle at which it acts is that of both oscillating together, of which the square of the
filter's gain is left: at 27 Hz and 100 Hz 0.4 % with the usual cut-off and all with 45 Hz, at 1 kHz 97 % with 54 Hz.
Measured: of torques of +- 7 N m it is up to 49 mN (docs/diagnosis/validation.md, 'Robots that chatter')."""
CHATTER_JACOBIAN_HZ = 10.0
"""Cut-off of signals at which slopes are taken where something chatters. Derived: below half of
``TEAM_JACOBIAN_HZ``."""
TEAM_SMOOTH_HZ = 12.0
"""Cut-off of signals when their rounding is drawn anew, and of rates that say where friction slides. Chosen."""
SLOW_HZ, SMOOTHER_OCTAVES = 1.0, 3
"""Where rounding shows as stairs: cut-off of the speed that tells their frequency, and how far that of the signal
falls with it. Chosen: the trajectory need only be one that the stairs may have come from."""
PHASE_TRAVEL = 4.0
"""Steps of travel after which a rounding error is drawn anew. Chosen: independent from one rest to the next, and
changes an encoder's speed by half at most."""
DRAWS_AT_A_TIME, DRAWN_TOGETHER = 8, 4.5e5
"""Of noise, and samples of all robots in them, at most. Chosen: memory; eight of three minutes of three robots."""
NOISE_DRAWS = 24
"""From which the rows' covariance is made. Chosen."""
NOISE_SEED = 20250
"""Of these draws. Chosen: any will do; fixed, so that a verdict can be had again."""
INERTIA_OFF = 0.3
"""Share by which the inertia that turns noise into moments may be off. Chosen: then these are off by as much at most;
with none at all, a healthy log of 12 bits left twice its noise."""
PHI_FLOOR_RAD, THETA_FLOOR_RAD, TAU_FLOOR_NM = 2.5e-5, 1e-5, 6e-4
"""Of the closed loop. Measured: integrator at 1 and 0.25 ms; docs/diagnosis/validation-history.md, 'Integration'."""
TEAM_TIMESTEP_S = 1e-3
"""Of the closed loop's simulation. Measured: with it the integrator's error stays below the sensors' noise (ibid.)."""
LEAST_MOMENT_RATIO = 1e-3
"""Least principal moment of a simulated payload over the largest: a body needs some. Chosen."""

# Its causes.

TEAM_PUSH_S = (0.4, 0.8, 1.6, 3.2, 6.4)
"""Durations searched. Chosen: octaves."""
REST_RAD_PER_S, REST_NM_PER_S = 1e-3, 0.2
"""Below which a joint, or a spring's torque, rests and its friction is noise. Chosen: as of the causes."""
TURN_RAD_PER_S = 1e-2
"""Below which friction that is kept may not be reversed yet when a joint turns round. Derived: from a turn at 0.5
rad/s^2 until then it moves by 0.1 mrad, a step of 16 bits. Measured on four recordings (0.096 N m in a joint that gives
way by 10 urad): chi2/n 1.72, 1.29, 2.55, 1.23 without, 1.13, 0.99, 1.29, 1.05 with 4e-3, 1.12, 0.98, 1.15, 1.05 with
this; viscous friction is off by 6.9, 5.4, 14, 0.4 standard errors, by 1.1, 0.9, 2.2, 0.9, and by 0.3, 1.1, 0.7, 1.3."""
QUIET_RAD_PER_S, QUIET_NM_PER_S, QUIET_HZ, NOISY_STEPS = 3e-4, 0.22, 6.0, 0.15
"""Noise of the rates that tell rest from sliding, up to which they are smoothed as usual; signals with more are
smoothed more, down to that cut-off. Derived: a joint that turns round at 0.3 rad/s^2 is told to do so within 1 ms, of a
row's 80; a torque's is that of the sensors with which thresholds were chosen; rows have nothing above 5 Hz. Noise
counts from that share of a rounding step on: with less a joint at rest repeats one reading; its error is a tenth."""
REST_KNOTS_S = 0.05
"""Between knots of friction at rest, which follows the load. Measured on three sets (0.17 N m in a joint, 0.17 inside a
spring, 0.24 in a gimbal): chi2/n 1.75, 1.25 and 1.24 with knots every 0.5 s (0.1 inside springs) and rests of less than
0.15 s left out; 1.12, 1.05 and 1.09 with 0.05 s; 1.07, 1.03 and 1.08 with every rest. Nothing faster passes the filter
of the rows."""
SPRINGS_SCATTER = 0.05
"""Of stiffnesses, at most. Chosen: `mocobot calibrate` takes 0.02; makers sell springs within a tenth. One of all is
hardly told from the payload's mass: without a limit, friction and a creep in a team at ten times its tolerances were
springs that are all 35 to 50 % off, and three tethers that make up for the weight of the arms."""
TEAM_PUSH_EDGE_S = 0.05
"""Over which slopes by the ends and ramps of a push are taken. Derived: rows are 0.08 s apart. Measured: an end that is
0.1 s off costs 276 of 1483 nats of a push of 0.64 N for 10 s."""
PRESLIDINGS_NM = (0.05, 0.2)
"""Torque that a spring takes up while the friction inside it gives way before it slips, tried first. Chosen: Bouc-Wen
springs that yield over 0.3 to 3 mrad at 100 N m/rad."""
PRESLIDING_RANGE_NM = (0.01, 1.0)
"""Derived: less is passed within a sample; more is hardly ever turned round."""
PRESLIDINGS_RAD, PRESLIDING_RANGE_RAD = (5e-4, 2e-3), (5e-5, 1e-2)
"""The same of a joint's friction, by its angle. Chosen: bristles of 0.2 to 2 mrad are met; a step of 16 bits is 0.1."""
PRESLIDING_FINER = (0.5, 0.7, 0.85, 1.2, 1.4, 2.0)
"""Shares of such a torque that are tried next. Chosen."""
PRESLIDING_OPEN_SHARE = 0.5
"""Of its limit, by which friction that gives way may differ from Prandtl's law until it slips. Measured on LuGre, Dahl
and Bouc-Wen friction of 0.15, 0.14 and 0.40 N m: chi2/n 1.43, 1.39 and 9.5 with 0, 1.10, 1.12 and 1.6 with 0.2, 1.05,
1.07 and 1.35 with this; by evidence 1000, 1000 and 2500 nats likelier, sizes 3, 2 and 6 % off instead of 6, 6, 20."""
PLAY_FORCE_N = 0.4
"""Below which a payload may be anywhere in its play. Chosen."""
PLAY_KNOTS_S = 0.2
"""Between knots of the travel that play leaves open at small forces. Chosen."""
PLAY_OPEN_N, PLAY_OPEN_S = 1.0, 0.03
"""Force below which a payload that is loose may travel, and for how long before and after. Measured: it travels for a
tenth of a second, with forces of up to 1 N in the filtered signals where there should be none; and derived: so long a
filter of 20 Hz takes to show a force that begins. With 0.4 N alone, half of the travel is outside."""
PLAY_OPEN_KNOTS_S = 0.05
"""Between knots of that travel. Measured: play of 0.8 mm leaves a chi2/n of 51 with knots every 0.2 s and forces below
0.4 N, 12 every 0.1 s below 1 N, 1.15 every 0.05 s; nothing faster passes the rows' filter."""
PLAY_CONTACT_PER_N = 0.02
"""Of a play, by which its ends give way to a newton, over which slopes are taken. Chosen: 1 um/N behind 50 um; columns
go straight with it."""
PLAY_COLUMNS_AT_A_TIME = 16
"""Of that travel. Chosen: memory."""
SHIFT_REACH_S = 0.5
"""Before and after a displacement in which its accelerations show. Derived: a filter of 20 Hz has died to 1e-6."""
LENGTH_MOST_M = 0.02
"""By which a leg's lengths may be off. Chosen: a thousand tolerances; as large, columns are no straight lines."""
PULL_SE = 5.0
"""Standard errors that the stiffness of a payload's tether must be. Measured: uncalibrated robots without one leave up
to 3, with a constant force of 2 N."""
TETHER_LEVER_M, TETHER_FINER_M, TETHER_STEP_M = 0.4, (0.2, 0.07, 0.025), 0.02
"""Levers of a tether of the payload at which a search begins, by which it goes on, and over which slopes are taken.
Chosen: half of a payload, and so fine that a Gauss-Newton step does the rest."""
TETHER_POINTS = 1000
"""Points of a payload that are told apart. Derived: every 0.1 m of a metre each way; near the limit they err by 0.05 m.
Without it, a tether of the payload whose point is free would always explain what one at a grasp does."""
CABLE_TURNS, CABLE_TURN_STEP = (-0.45, 0.45), 0.15
"""Where a tether that pulls along itself alone comes from: slopes across each of six axes at which a search begins,
24 ways in all, no direction further off than 33 deg; and over which slopes are taken. Chosen: as far as a Gauss-Newton
step goes; with a third of that it stopped beside what it was after."""
CABLE_STRETCHES_M, CABLE_STRETCH_STEP_M = (0.03, 0.0, 0.1), 0.015
"""By how much it is stretched at home. Chosen: a carry moves by 0.05 m, so it is slack at times, half of the time, and
never; steps as above."""
CABLE_NEAR_PER_M, CABLE_NEAR_RANGE_PER_M, CABLE_NEAR_STEP_PER_M = 1.0, (0.05, 5.0), 0.4
"""One over how far away it is tied: at first, at least and most, and over which slopes are taken. Chosen: a room."""
CABLES, CABLE_LINES = 10_000, 100
"""Cables that are told apart. Derived: ways 0.1 rad apart (4 pi / 0.01) times eight stretches; at the payload also
lines 0.1 m apart across a metre each way."""
CABLE_STIFFENS_RANGE_PER_M, CABLE_STIFFENS_STEP_PER_M, STRAPS = (-3.0, 1000.0), 20.0, 20
"""By which share of its stiffness a strap is stiffer per metre of stretch: at least and most, over which slopes are
taken, and how many are told apart. Chosen: a webbing twice as stiff at 0.02 m has 50 per m; rubber gets softer, not by
more than 0.3 in 0.1 m."""
RELAXATIONS_S = (0.02, 0.005, 0.06, 0.2)
"""Of what gives way to a force, tried first. Chosen: at most a factor of four apart, of which a Gauss-Newton step finds
the rest; the first is that of a base of 60 kg that gives way by 1 to 3 um/N, critically damped. Of a grasp it is the
least: 5 kg, a share of a payload, on 1 um/N, ten tolerances, follow within 4.5 ms."""
RELAXATION_FINER = (0.5, 0.7, 0.85, 1.2, 1.4, 2.0)
"""Shares of such a time that are tried next. Chosen."""
RELAXATION_RANGE_S = (0.001, 0.5)
"""Derived: a shorter one shifts a motion of 1 Hz by less than 0.6 % of itself; after a longer one, a base creeps."""
BASE_INERTIA_SHARES, BASE_INERTIA_FINER = (0.06, 0.25, 1.0), (0.5, 0.7, 1.4, 2.0)
"""Compliance times the mass that moves, over the square of the lag, tried where a base gives way: a quarter is damped
critically; and shares of it tried next. Chosen."""
GRASP_TURNS_M = (0.05, -0.05)
"""From the gimbal's centre to the point about which a grasp turns, along its axis, tried first. Chosen: a flange's
thickness or a gripper's, on either side; what is along it is found by Gauss-Newton."""
GRASP_TURNS_FINER, GRASP_TURNS_RANGE_M = (0.5, 0.7, 1.4, 2.0), (0.01, 0.3)
"""Shares of that tried next, and its range. Derived: nearer, nothing turns; farther, it is no part of the grasp."""
CREEP_STARTS_S = tuple(3.0 * k for k in range(1, 31))
"""Into a trial, at which a base may begin to creep, tried first. Chosen: trials last less than a minute and a half."""
CREEP_FINER_S = (-2.0, -1.0, -0.5, -0.25, 0.25, 0.5, 1.0, 2.0)
"""By which such a time is moved next. Chosen."""
CREEP_STEP_S = 0.5
"""Step of slopes by that time. Chosen: what creeps from half a second sooner or later goes nearly the same way."""
CREEP_STARTS = 100
"""How many of them there are, each as likely as the others. Derived: three bases, by a minute in steps of 2 s."""
CREEP_START_SHARE = 0.01
"""Of what a creep from the beginning is worth, that one which begins later must add. Measured on tuning sets: three of
five that creep from the beginning are worth 0.3 % more from 3 to 4 s on, when robots begin to move (why is not traced),
six that begin in mid-trial 64 % and more. Of the five, moved to 6 s one loses 0.5 %, to 5 s another 10 %: a begin soon
after robots begin to move may not be told."""
SLOSH_LENGTHS_M = (0.04, 1.0)
"""Derived: pendulums of 2.5 to 0.5 Hz; slower and faster ones look like drag or play."""
SLOSH_MOST_DAMPED = 0.3
"""Largest damping ratio tried. Chosen."""
SLOSH_SWINGS = 0.25
"""Largest damping ratio named. Chosen, after one of 0.29 had been named for drag."""
SLOSH_REACH_M = 1.5
"""From the centre of mass to where it hangs at most. Chosen: no payload of three robots is larger."""
MASS_OVER_S = 60.0
"""In which a mass that drifts becomes as much as its columns say. Chosen: any will do; in a minute it is as much as one
that is put on."""
MASS_TRIALS = 12
"""With which another mass may begin at most. Chosen: more are no experiment but a log."""
MASS_SPANS = 5
"""Up to which trial one may be there for some trials only. Chosen: of five, each span; of more, only what stays."""
SLOSH_ACROSS = (0.3, 0.37, 0.46, 0.58, 0.72, 1.38, 1.7, 2.15, 2.7, 3.4)
"""Length across over that along of what swings on two lengths, tried first. Measured (tuning set 99300, damping ratio
0.04): a length 25 % off still helps."""
SLOSH_HEADINGS_RAD = (0.0, 0.79, 1.57, 2.36)
"""Its headings, tried first. Measured, likewise: one 25 deg off still helps."""
SLOSH_SECOND, SLOSH_SHARE = (0.3, 0.55, 1.8, 3.3), 0.25
"""Length of a second pendulum over the first's, and its share of the mass, tried first. Chosen: a quarter is what the
second mode of two equal pendulums in a row has."""
SLOSH_SECOND_FINER, SLOSH_SHARES_FINER = (0.6, 0.75, 0.87, 0.95, 1.05, 1.15, 1.35, 1.7), (0.5, 0.75, 1.3, 2.0)
"""Shares of the second length, and of its share, tried next. Chosen."""
SLOSH_HEADINGS_FINER_RAD, SLOSH_TURN_RAD = (-0.26, -0.13, 0.13, 0.26), 0.1
"""By which a heading is moved next, and the step of slopes by it. Chosen."""
SLOSH_SECONDS = 150
"""Second modes that are told apart, each as likely as the others. Derived: thirty lengths, 10 % apart, by five headings
or shares. Without it a second mode would always explain what a pendulum of one mode does, and noise beside it."""

# Long recordings.

SEARCHED_S, SEARCHED_POWER = 480.0, 1.4
"""Of recordings of three robots together that is searched for causes; of N robots (3 / N)^power of it. Chosen: a
minute and a half of CPU. Measured: a minute of three robots takes 10 s, of ten 53 s (docs/commands/performance.md)."""
SEARCHED_PARTS, SHORTEST_PART_S = 4, 40.0
"""How many parts at least those are, and how long at least. Chosen: they can be held out of each other's fit, and are
spread over the recording; several ways of a random motion, and twenty times what the filters leave out."""
ODD_WINDOW_S = 10.0
"""Of a part at a time that is held against what was searched. Chosen: a short push, some periods of a motion."""
ODD_CHANCE, ODD_FACTOR = 0.01, 1.5
"""A part is searched, too, where in one of its windows more is left than would be by chance once in a hundred such
diagnoses if windows were normal, and by that factor. Derived: Student's t of the windows that were searched, over all
comparisons; the factor is chosen: what moves otherwise leaves otherwise. Measured: an hour of a random motion, 0.8."""
ODD_NAMED = 3
"""Of such parts that were not searched all the same, how many are named. Chosen."""
SWING_ROUNDS, SWING_FIRST_ROUNDS, SWING_SETTLED = 20, 1, 1e-4
"""Times a pendulum that swings far is swung again, the same while shapes are only looked through, and the change from
which it is enough. Chosen: sizes are told to a percent."""
SWING_CALM, SWING_WEIGHT, SWING_LEAST_WEIGHT = 0.5, 0.7, 0.3
"""Change of a round over that of the last, from which rounds go to and fro; by which a new one counts less then, and
how much at least. Chosen."""
SWING_MOST, SWING_START, SWING_EASED = 0.95, 0.9, 0.6
"""How far it swings at most, over its length, the same while it is sought, and by which share its restoring force is
less at most. Chosen: a mass beside its pivot is no pendulum."""
