"""Numbers of the search for laws that no catalogue lists."""

LAW_KNOTS = 8
"""Of a curve over a signal. Chosen: enough for an S, and few to pay for."""
LAW_QUANTILES = (0.01, 0.2, 0.4, 0.6, 0.8, 0.99)
"""Of a signal's values: ends of a curve, and knees between them. Chosen."""
LAW_PLAY_SHARES = (0.0003, 0.001, 0.003, 0.01, 0.03, 0.1, 0.3, 1.0)
"""Half widths of a play that are tried, over the signal's standard deviation. Chosen; the best is sharpened."""
LAW_LAG_S = (0.01, 0.1, 1.0)
"""Time constants of a lag that are tried. Chosen."""
LAW_WARMING_S = (2.0, 5.0, 10.0, 20.0, 50.0)
"""Time constants of a warming that are tried. Chosen: from a moment to a trial. One shorter than the first is over when
a trial's rows begin (``TEAM_TRIM_S``): a constant."""
LAW_RESONANCE_HZ, LAW_DAMPING = (0.5, 0.8, 1.2, 2.0), (0.1, 0.7)
"""Frequencies and damping ratios of what follows a motion. Chosen."""
LAW_MOST_TIMES = 32
"""Periods a turn of what comes again with an angle. Chosen: poles of motors and of magnetic encoders."""
LAW_SLOW_RAD_PER_S = 4e-3
"""Below which a direction of motion fades. Chosen: as in the friction of the catalogue."""
LAW_KNOTS_S, LAW_VECTOR_KNOTS_S = 0.3, 1.2
"""Between knots of an error as a function of time, of one component and of several. Chosen: 0.3 s holds what a joint's
motion carries, up to 1.6 Hz."""
LAW_SMOOTH = (1, 4, 16)
"""Times as many seconds between knots, for errors that change slowly. Chosen."""
LAW_HUM_STEP_HZ = 0.01
"""Between frequencies that are tried. Derived: a period in the hundred seconds of a few trials."""
LAW_HUM_LEAST_HZ = 0.3
"""Below which a sine of time is not tried. Chosen: slower ones are what time and motion do anyhow."""
LAW_HUM_PEAKS = 6
"""Peaks in the spectrum of what is left that are tried as a hum. Chosen."""
LAW_LINE_SPAN = 41
"""Frequencies around one that are its surroundings. Chosen: 0.4 Hz, ten times as wide as a line of a trial of 25 s."""
LAW_PLACES = 6
"""At which formulas are tried: the likeliest. Chosen."""
LAW_LEADERS = 16
"""Formulas that are looked at closely. Chosen."""
LAW_INSTEAD = 0.9
"""Probability of a named cause below which a law is tried in place of all that is named, also where nothing is left.
Chosen: what is named with more was right in all of six sets of arms, with less in 14 of 23."""
LAW_LEAD_NATS = 20.0
"""By which a law must be likelier than the one cause, sure and leaving noise, whose place it takes. Chosen: what is
listed is no guess. Measured: a quadratic and a saturating torque reading are 96 and 157 nats likelier than the
hardening springs that they were taken for, a sliding load 255 than a tether."""
LAW_MOST = 3
"""Laws that are looked for, one after the other. Chosen."""
LAW_HELD_OUT = 0.5
"""Least share of a law's gain in sample that it must also have on trials that were left out, to be stated. Chosen."""
LAW_FOLDS = 0.5
"""Share of the trials that it must help, fitted to the others. Chosen: more than half."""
LAW_SCALES = {
    "rad": 1e-3, "N m": 0.1, "N": 1.0, "m": 1e-3, "kg": 0.1, "kg m": 0.01, "kg m^2/s": 0.1, "V": 0.01
}  # fmt: skip
"""Typical sizes of errors, by unit. Chosen: columns are expressed in them; the size itself is learnt."""
LAW_FORMS = 60
"""Formulas of a place's own signals that are as likely as each other. Derived: about so many are tried."""
LAW_INSIDE = 10
"""Values of a number inside a function that are as likely as each other. Derived: about so many are tried."""
LAW_SIZES = tuple(4.0**k for k in range(-3, 2))
"""Of an error over ten times what one value alone is known to, of which the likeliest is taken. Chosen."""
LAW_CHUNK = 240
"""Columns that are judged at a time. Chosen: memory."""
LAW_NEAR = 0.5
"""Share of the likeliest formula's nats from which the numbers inside another are sharpened. Chosen: time."""
LAW_CAUSES = 2
"""Causes of the catalogue that are looked for at most after each law. Chosen: what was missed without it is little."""
LAW_READING_ROUNDS, LAW_READING_STEP, LAW_READING_LEAST = 8, 1e-3, 0.2
"""Newton's steps from what a sensor reads to what there is, the step of its slope over the signal's standard deviation,
and the least slope of a reading over the truth. Chosen: a sensor that loses four fifths tells nothing."""
LAW_RIVALS = 6
"""Other laws that are kept as rivals of one, the likeliest. Chosen: what comes after has no part in a probability."""

LAW_SHOWS = 1e-3
"""Share of a vector law's largest size below which what it does in another direction is not simulated. Chosen."""
LAW_KNOTS_MISS = 0.5
"""Share of a law's variance between the knots of what was located, beyond which no picture of that is made. Chosen."""
