"""Constants that several parts of a team's diagnosis share; those of one part stand in its file."""

PATCH_COLUMNS = 48
"""Of what a cause leaves open that are kept together. Chosen: a few seconds of friction at rest; of fewer, calls cost
more than numbers, of more, most numbers are nought."""
TEAM_PRE_HZ = 20.0
"""Cut-off before the nonlinear formulas. Derived: high enough that filtering and they commute to within the noise."""
PART_S = 180.0
"""Of a recording at most that is looked at as one trial. Chosen: what a trial leaves open costs its square, and ten of
its overlaps are a tenth of that; longer than any trial of the experiment."""
TEAM_TRIM_S = 2.0
"""Left out at both ends of a recording. Chosen."""
STRAIGHT_CHI2_PER_N = 0.01
"""What curvature adds to chi-square, from which all is linearised again. Chosen: a hundredth of the noise."""
STRAIGHT_BESIDE_CHI2_PER_N = 0.1
"""The same beside causes, where a step takes 6 to 10 s. Chosen. Measured: a tether's pull down, known to 0.09 N, is
0.67 N off where columns miss 34 in chi-square per n, and 0.34, 0.18 and 0.11 N where they miss 2.0, 0.45 and 0.07."""
MODEL_PHI_RAD, MODEL_THETA_RAD, MODEL_TAU_NM, MODEL_HZ = 2e-6, 7e-7, 3e-4, 100.0
"""What the model itself leaves beside any sensor, as noise of readings at ``MODEL_HZ``; as much in a band at any
other rate. Measured: what soft rods, welds and the integrator leave of trials with ideal sensors weighs as much as 1 to
3 urad of phi below 0.5 Hz and a third of that to 2 Hz, 0.1 to 2 urad of theta, and, at the motion's own frequencies,
0.1 to 0.2 mN m in random trials."""
NOISE_ABOVE_HZ = 25.0
"""Where nothing moves, so that what is there is noise. Chosen."""
TEAM_SMOOTH_HZ = 12.0
"""Cut-off of signals when their rounding is drawn anew, and of rates that say where friction slides. Chosen."""
NOISE_SEED = 20250
"""Of these draws. Chosen: any will do; fixed, so that a verdict can be had again."""
REST_RAD_PER_S, REST_NM_PER_S = 1e-3, 0.2
"""Below which a joint, or a spring's torque, rests and its friction is noise. Chosen: as of the causes."""
PLAY_FORCE_N = 0.4
"""Below which a payload may be anywhere in its play. Chosen."""
TETHER_LEVER_M, TETHER_FINER_M, TETHER_STEP_M = 0.4, (0.2, 0.07, 0.025), 0.02
"""Levers of a tether of the payload at which a search begins, by which it goes on, and over which slopes are taken.
Chosen: half of a payload, and so fine that a Gauss-Newton step does the rest."""
CABLES, CABLE_LINES = 10_000, 100
"""Cables that are told apart. Derived: ways 0.1 rad apart (4 pi / 0.01) times eight stretches; at the payload also
lines 0.1 m apart across a metre each way."""
RELAXATIONS_S = (0.02, 0.005, 0.06, 0.2)
"""Of what gives way to a force, tried first. Chosen: at most a factor of four apart, of which a Gauss-Newton step finds
the rest; the first is that of a base of 60 kg that gives way by 1 to 3 um/N, critically damped. Of a grasp it is the
least: 5 kg, a share of a payload, on 1 um/N, ten tolerances, follow within 4.5 ms."""
MASS_OVER_S = 60.0
"""In which a mass that drifts becomes as much as its columns say. Chosen: any will do; in a minute it is as much as one
that is put on."""
SWING_ROUNDS, SWING_FIRST_ROUNDS, SWING_SETTLED = 20, 1, 1e-4
"""Times a pendulum that swings far is swung again, the same while shapes are only looked through, and the change from
which it is enough. Chosen: sizes are told to a percent."""
