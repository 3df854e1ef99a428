"""Noise, priors, search and verdict of any machine; origins are named as in ``discrepancy.rules``."""

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
ROWS_PER_COEFFICIENT = 10
"""A series must have more rows than so many for each coefficient, or stays as it is. Chosen."""
LOUD_POWER = 2.25
"""Noise of a row, in squares of that of the others, above which it has a weight of its own. Derived: four standard
deviations of a mean square of 24 draws (a team's ``NOISE_DRAWS``), sqrt(2/24) = 0.29, above 1."""
SHRINKAGE_SHARE = 0.05
"""By which the channels' covariance is drawn to its diagonal at least. Chosen."""

# Search: which candidates are compared, how their shapes are sharpened.

MOST_CAUSES = 12
"""Of one verdict. Chosen: no more than a guard; the benchmark's first axis takes eight."""
LEADERS = 8
"""Candidates of a scan that are looked at closely, and as many more that are the likeliest of their cause. Chosen."""
SHAPES_AT_A_TIME = 24
"""Of which columns are there together. Chosen: memory; about as many as a pendulum has."""
FINER_ROUNDS = 4
"""Refinements of a shape around the best so far. Chosen."""
POLISH_ROUNDS = 3
"""Gauss-Newton steps of a shape after the grid. Chosen."""
SETTLE_ROUNDS, SETTLED_NATS = 8, 0.1
"""The same in the noise that is left with the cause, at most, and the gain from which it has settled. Measured: three
steps took the damping of a mass that swings by 0.3 rad half of the way."""
LEADS, LEAD_ROUNDS = 3, 8
"""Kinds of shapes far apart that are followed, and Gauss-Newton steps each. Measured: of a cable that is slack at times
one from the other side explains nearly as much (428 of 453 nats), and more where a search begins (272, 208); seven
steps are enough."""
REFIT_ROUNDS, SHORT_ROUNDS = 3, 12
"""Gauss-Newton steps of causes and unknowns with exact residuals, and steps where they had to be shortened. Chosen."""
LEAST_STEP = 0.2
"""Of a step, beyond which it is halved where it makes things worse. Derived: with a slope k times that of the columns
steps of a share s leave |1 - s k| of the error, so that down to an eighth all k below 16 settle."""
EVENT_PARTS = 16
"""Parts of an event's interval in which its ends are sought, and of these at its ends. Chosen: 0.4 % of it."""
EVENT_LOUD_POWER = 2.25
"""Of a cell, from which events are looked for in calmer noise, too. Chosen: below, edges weigh little more."""
EVENT_SHORTEST_S = 0.1
"""That searching for an interval may leave. Chosen."""
EVENT_RAMPS = (0.0, 0.15, 0.3, 0.5)
"""In which an event grows and fades, over its duration, that are tried. Chosen: hands ramp; a half is a triangle."""
WORST_INTERVALS = 2
"""Per trial and duration that become candidates. Chosen."""

# Verdict and closed loop.

RESPONSE_SHARE = 0.8
"""Of the response's excess error that causes must remove, or what is left of a visible one is said beside the verdict.
Chosen."""
CLOSE_NATS = 20.0
"""Shapes are sharpened of candidates that a scan puts closer to its likeliest. Chosen: it costs time."""
COARSE_SHARE = 0.4
"""Of what the likeliest is worth, from which causes are sharpened whose shapes are far apart in a scan. Measured: of
two cables it sees 0.46 and 0.60."""
PLACE_SHARE = 0.25
"""Of what the likeliest is worth in a scan, from which others at its place are sharpened. Measured: friction of a joint
that creeps has 0.35 of that of its spring, and a base 0.75 of a grasp; sharpened they are 8.5 and 1.8 times as much."""
REACH_NATS, REACH_SHARE = 50.0, 0.5
"""What is less likely than the likeliest by that, and worth less than that share of it, is not looked at once more in
its place. Chosen: its odds are 2e-22; where rows are not straight the likeliest may be overrated, but not twofold."""
SIZE_SETTLED = 0.02
"""Share to which the size of what a cause leaves open is found. Derived: of a hundred unknowns a share x changes the
log evidence by some 100 x^2, 0.04 nats."""
AMBIGUOUS_NATS = CLOSE_NATS / 4.0
"""Rivals that the rows put closer are simulated; what the closed loop does not part either cannot be told apart.
Chosen."""
MARGIN_SHARE = 0.02
"""Simulations whose chi-square differs by less are equally good; so are all within the noise, at 1 and less, except for
laws, which have to help. Chosen."""
VISIBLE_CHI2_PER_N = 3.0
"""Of the closed loop, from which something is said of it beside the verdict. Chosen."""

# Inference: what is learnt from the data, and with what priors.

CELL_BANDS = 6
"""Octaves of frequency in which the noise has powers of its own, of every group of channels and trial. Chosen."""
TRANSFORM_PRIME, TRANSFORM_ROWS = 100, 900
"""Largest prime factor of a number of rows, and rows at most, from which on a cosine transform is a product with its
matrix. Measured: that is 2.6 times as fast for 446 rows, and as fast for 898; without such a factor it is slower."""
ROWS_BYTES = 1.5e8
"""Of all columns of all trials, from which they are kept in files and in single precision. Chosen: memory; those of
five minutes of three robots. On two sets of the tuning pool chi2/n is the same to 1e-5 either way."""
PORTION_BYTES = 1e8
"""Of a trial's columns that are made together. Chosen: memory; all of a minute of three robots are a quarter."""
TOLD_BYTES = 1e7
"""Of columns that are held against a fit together. Chosen: memory; all pushes near one of a minute of three robots are
ten times as much."""
ASKED_BEFORE = 2
"""Times that columns were asked about before what is needed of them is kept. Chosen: events are asked about twice, and
then not again."""
KEPT_COLUMNS = 16
"""Of those made together, as many from which their products with columns that are asked about again are kept. Chosen:
fewer are multiplied again in less time than is needed to look each cell up."""
WIDENED_ROWS = 1024
"""Of these, turned into double precision together. Chosen: as many as a processor's cache holds."""
POWER_NUMBERS = 20.0
"""Numbers that the prior of a power counts for, at 1: whitening is right to 30 % without data. Chosen."""
SPREAD_NUMBERS = 4.0
"""Numbers that the tolerance counts for when a kind's spread is learnt. Chosen: that a kind scatters is no likelier
beforehand than that one of its places is at fault."""
LEVEL_KINDS = 5.0
"""Of other kinds that the data tell, from which a kind is expected to be as far off as they are. Chosen: fewer may be
off for one reason."""
MOST_SPREAD = 1e3
"""Of a kind over its tolerance. Chosen: an encoder's zero of 6 deg."""
LEAST_SLAB = 4.0
"""Size of what counts as a fault over the tolerance, at least. Chosen."""
LEAST_SIZE = 1e-6
"""Of a cause without a tolerance over its typical size. Derived: not to divide by nought."""
LEARN_ROUNDS, LEARN_NATS = 30, 0.05
"""Steps of powers and spreads at most, and the gain of evidence below which they have settled. Chosen."""
SAME_TRACE = 1e-6
"""Sine, squared, between columns that are one. Derived: more than rounding, less than what any data could tell."""
OPEN_SHOWS = 1e-4
"""Of what a cause leaves open, trace over the largest from which it counts. Derived: the largest is some hundred times
the noise, so that one dropped is a hundredth of it."""
PATCH_COLUMNS = 48
"""Of what a cause leaves open that are kept together. Chosen: a few seconds of friction at rest; of fewer, calls cost
more than numbers, of more, most numbers are nought."""
PATCH_SHOWS = 1e-2 * OPEN_SHOWS
"""The same as ``OPEN_SHOWS`` of such columns alone. Derived: what is left out first must not show beside that."""
SHAPE_NATS = 5.0
"""By which a cause with one number more in its shape must be likelier. Derived: half the log of the rows' numbers, some
ten to thirty thousand (Schwarz's criterion)."""
LEAST_POWER = 0.5
"""Of a cell over that of its whitening. Chosen: some noise of healthy robots is drawn larger than it is."""
FLAT_SHARE = 1e-10
"""Information that shared unknowns have beforehand, over that of the data. Derived: as good as none."""
PRIOR_ODDS, MOST_ODDS = 0.05, 1000.0
"""Of any cause of the catalogue being there, at all its places together, unless they are given (--odds), and the most
that may be given. Chosen: one in a team, of twenty causes; beyond the most the data would not matter."""
FALSE_ALARM_COST, WRONG_NAME_COST = 150.0, 1.0
"""What naming a cause where there is none costs, and naming another than what is there, in units of one that is missed.
Chosen: whoever is sent to a healthy robot stops believing; whoever is sent to the wrong place has lost as much as if
nothing had been said."""
SLAB_OCTAVES = 10.0
"""In which the size of a fault is equally likely. Chosen: from the tolerance to a thousand times that."""
INTERVALS = 1000.0
"""At which an event may be. Derived: about so many are searched."""
RAMPS = 150.0
"""Ramps of an event that are told apart, each as likely as the others, and all as none. Derived: as SHAPE_NATS, for one
number more. Without it, a push without ramps would always have short ones."""
LOOKED_AT_NATS = -5.0
"""Log odds in the scan, from which a candidate is looked at closely. Chosen: what it leaves open may make up for it."""
NARROW_NATS = 0.0
"""The same with every kind within its tolerance, from which what has a shape is sought to the end there. Chosen: kinds
that scatter can only take of it, and exact steps take seconds; the shapes of a scan have been tried by then."""
HELD_FACTOR = 1.5
"""Spread of a kind from which it is scanned within its tolerance, too. Chosen."""
WORST_EVENTS = 3
"""Intervals looked at closely. Chosen."""
NAMED_NATS = 5.0
"""Log odds from which a cause is named. Derived: ln of ``FALSE_ALARM_COST``: naming costs that much times 1 - p, and
silence 1 times p."""
EXCHANGES = 4
"""Rounds in which causes are exchanged and taken away after one was added. Chosen."""
EXCHANGED_NATS = 1.0
"""By which another cause, or another shape, must be likelier to be taken instead. Chosen: less is a matter of steps."""
DIVERGED_NATS, BENT_NATS = 50.0, 200.0
"""Fall of the evidence from which a Gauss-Newton step is not taken: after another one, and after the straight answer
for what bends, whose columns flatter it. Chosen: a sensor that loses 8 % of its scale falls by 60 and is right, one
that loses a third by 1200 and is not."""
NEAR_CHI2 = 2.25
"""Of what is left over the noise, below which columns are made anew where the causes are. Chosen: as of cells that
are loud; simulated arms with a payload leave 1.2 at most, the TX40 4.0 with twelve causes."""
SETTLED_SE = 0.05
"""Standard errors: a value that moves less has settled. Chosen."""
CELL_NATS = 4.0
"""What a process of its own in a cell costs. Chosen: about a hundred cells are looked at, ln 100."""
UNLISTED_NATS = 60.0
"""Of all such processes, from which what is left is not noise. Chosen."""
DOUBT_NATS = 20.0
"""Of the same, from which it is looked whether one place explains it. Chosen: a third. Measured on tuning sets: six
clean teams leave up to 34 and no place explains more than 14 nats of it; a play in an encoder of a team at ten times
its tolerances left 50, and its place explained 909."""
LAW_SHARE = 0.2
"""Standard deviation of what the law of a cause that is there leaves of its trace, in amplitude. Chosen."""
FRICTION_FORM_SHARE = 0.1
"""By which friction and play of real contacts have another form than their law, of their trace in amplitude: so much is
no sign of something unlisted. Chosen: friction of 30 mN m in nine simulated springs leaves as much (ten times the
tolerance, one set of the tuning pool); with half of it that set is `unexplained`, with twice of it unlisted effects
show half of what they do."""
FRICTION_FORM_NM = 0.03
"""Friction up to which that is its share. Derived: that of the set; beyond, the share grows with the root of the
friction, since it rests until the load has changed by twice as much."""
FORM_SHARE_MOST = 0.3
"""Largest such share. Chosen: more would be no friction as it is listed."""
LISTED_ODDS = 4.0
"""That a cause is one of the catalogue rather than an unlisted one that looks like it. Chosen."""
LAW_ERROR_SHARE = 0.02
"""By which the law of a cause puts its size off; part of every standard error, and of no probability. Chosen; of those
of a team in ``TEAM_LAW_ERRORS`` measured."""
LEAST_PROBABILITY = WRONG_NAME_COST / (1.0 + WRONG_NAME_COST)
"""From which a cause is named, one half; below, it is a suspicion. Derived: named, it costs the share of wrong
names; not named, that of right ones."""
NEGATIVE_SE = 3.0
"""Standard errors beyond which what must be positive is not. Derived: of a coupled drive that has one of three numbers
beside two of nought one in 370 is lost, with two standard errors one in 22 (one of 246 nats was). Where another number
of the cause stands out by more, what its law leaves of that (``LAW_SHARE``) may pass for a negative one as well."""
SCATTER_FACTOR = 3.0
"""Spread of a kind over its tolerance, from which a team is said to be off in it. Chosen."""
CONTRADICTED = 0.5
"""By which causes lose probability that make the closed loop's response worse or, where what is left is no noise, a
trial that is foretold by the others less likely by ``NAMED_NATS``. Chosen: as likely wrong as not."""
REFUSED = 2
"""Steps in a row that do not pay where they are exact, after which a search ends. Chosen: it costs time."""
BASE_ROUNDS = 4
"""Linearisations at most. Measured: robots 1 deg off take two."""
BENT_CHI2_PER_N = 1.0
"""What columns may miss where a fit without causes finds machines. Derived: as much as noise. Measured: 0.47 and less
from the second step on in ten sets of teams at three and ten times their tolerances and uncalibrated; 543 to 2266 in
three that a strong tether drives away."""
STRAIGHTER = 0.5
"""Share to which a step has to lessen what columns miss, or all stays linear where it is. Chosen. Measured: beside its
cause a team 1 deg off, at which a spring of 42 N/m pulls, misses 54, 2.3, 0.28 and 0.011 in chi-square per n, one whose
payload is held with play besides 0.41 and 0.39."""
DOUBTFUL, LITTLE_SHARE = 2, 0.05
"""Steps in a row that explain at most such a share of what is left (in nats), after which no more are looked for:
causes that are less likely than not when they are added, and what is no more than healthy ones have where no cause
would pay. Chosen: one may become likely beside the next. Measured: in a team ten times off of which a base gives way,
and no cause is one that does, a grasp, five springs and three joints one after the other account for 388 to 13 nats
of more than 8000, the last at ten times the cost of the first."""
