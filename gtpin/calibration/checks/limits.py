"""Limits of the checks of measured data, each with its source: derived, from a study, or assumed."""

from __future__ import annotations

import numpy as np

# What follows from a suspicion

UNFIT = 10.0
"""Residuals, in units of the noise, from which data do not fit. Assumed."""
FITTED = 3.0
"""Residuals, in units of the noise, up to which data fit. Assumed: effects that are not fitted make some of them."""
FAR_LOWER = 10.0
"""Factor by which a correction lowers residuals that only a mistake can make so much smaller. Assumed."""
NO_EFFECT: tuple[float, float] = (1e-2, 2e-2)
"""Residuals of a fit, m and rad, that no effect of the catalogue leaves. Assumed. There `LOWER` is enough."""
LOWER = 4.0
"""The same factor for residuals beyond `NO_EFFECT`. Assumed."""
EXACT, ABOVE = 1.1, 2.0
"""Residuals, in units of the declared noise, up to which a correction fits exactly, and above which data do not fit before it.
Assumed: an effect has another pattern than a convention of rotations, so that more would be left."""
MISFIT = 10.0
"""Size of a fit's residuals, in units of the noise, from which there is a warning. Assumed."""
FAR_FROM_PRIOR = 6.0
"""Deviation of a parameter from nominal, in units of its tolerance, and of an unknown from what is declared, in prior sigmas,
from which there is a warning. Assumed."""
NAMED = 5
"""Largest number of parameters, or sessions, that a message names."""
NO_BETTER = 0.8
"""Share of the residuals that a correction leaves, from which it is no suspicion. Assumed."""
USUAL_NOISE: tuple[float, float] = (1e-4, 3e-4)
"""Noise of a usual instrument, m and rad, where none is declared. Assumed."""
LEAST_NOISE: tuple[float, float] = (1e-6, 1e-6)
"""Smallest noise, m and rad."""

# Other readings of poses, compared with the nominal model

SEARCH_ROWS = 100
"""Number of rows that are used: medians of more rows are not much more certain. Assumed."""
FEWEST_ROWS = 6
"""Number of rows below which a free frame fits almost any data, and nothing is compared or fitted. Assumed."""
ACCEPTED = 0.1
"""Share of the workspace's size up to which data fit without a correction. The mistakes below move poses by about the whole
size. Machines within the tolerances of the shipped robots stay below 0.08, except those of stewart_jugglebot."""
ALLOWED = 5e-3
"""Error of a machine, m, that is always accepted, even in a small workspace. Assumed."""
BETTER = 4.0
"""Factor by which another reading must bring the data nearer to the nominal model. Assumed."""
FAR_BETTER, MORE_MISTAKES = 10.0, 5.0
"""Factor by which a reading must be nearer after a fit has failed, and one with more mistakes than one with fewer. Assumed: a
wrong geometry, frame or target takes up some part of a mistake, and not nine tenths of it; of two zeros of a five-bar that are
off by 17 and 11 degrees, one zero and a free frame leave 7 times as much as the two (tests/calibration/test_recognise.py)."""
FEW_DRIVES = 2
"""Largest number of drives of a robot with loops for which several mistakes are tried: the number of readings grows with the
square of it, and a pose of six loops takes ten times as long as that of an arm."""
AS_GOOD, CLOSE = 1.5, 0.02
"""A reading with fewer mistakes is preferred where its misfit is at most `AS_GOOD` times the smallest one plus `CLOSE` times
the workspace's size. Assumed."""
BEYOND_EXPECTED = 3.0
"""Misfit, in expected errors of the nominal model, above which frame, commands and target are doubted. Assumed."""
LINE = 0.1
"""Ratio of a workspace's width to its length below which positions do not determine a rotation about its length. Assumed."""
MOST_NAMED = 4
"""Largest number of readings that are named where several fit equally well: three swaps and a frame, of a delta."""

# Zeros of commands

START_ROWS, REFINED_ROWS = 30, 50
"""Number of rows with which starts are compared, and refined. Assumed: frame, target and two zeros are 14 numbers of 90."""
ZEROS = 2.0 * np.pi * np.arange(8) / 8.0
"""Zeros, rad, from which joints that turn start. Assumed: half a step is 22 degrees, from which the steps below converge."""
POLISHED, REFINED = 300, 40
"""Number of starts that get a few rough steps, and of those, the ones with the smallest misfit, that are refined. Assumed."""
ROUGH_ALIGNMENTS, ALIGNMENTS = 3, 10
"""Number of alternating fits of frame and target for the starts, and in a refinement. Assumed."""
ZERO_STEPS, ZERO_STEP, RIDGE = 8, 1e-5, 1e-9
"""Number of Gauss-Newton steps; change of a zero, m or rad, for their derivatives; and the ridge, relative to the trace."""
GROSS = 10.0
"""Distance from the middle of the positions, in medians, from which a row is a gross error. Assumed."""
LEAST_MISFIT, TINY = 1e-9, 1e-30
"""Smallest misfit, m, that weights of rows are made with; and a number that keeps normal equations of no effect regular."""
REACHED = 0.75
"""Share of the rows that the nominal model must reach when commands are read in another way. Assumed."""

# Units in a part of the rows

MIXED_SHARE = 0.1
"""Share of all rows below which a part in one unit is left to the search for gross errors; at least `FEWEST_ROWS`. Assumed."""
MIXED_REST = 0.75
"""Share of the other rows that must fit in metres. Assumed."""
MIXED_ROWS = 300
"""Rows, evenly over the file, that are enough to guess a free frame."""
TRIPLES = 400
"""Sets of three rows that a free frame is guessed from: of two units in equal parts, every eighth is in metres alone."""

# Conventions of rotations, after a fit

CONVENTION_LEFT, CONVENTION_GAIN = 0.8, 60.0
"""Share of the squared orientation residuals that another convention may leave, and the least by which it lowers them: a
factor of exp(30) in likelihood, over some 150 readings. A convention has no free parameter: with residuals of effects, no
other convention left less than 0.96 (80 fits of 40 machines of the plant); a runout in one of 200 sealed cases left 0.77."""
CONVENTION_CERTAIN = 0.1
"""Share of the squared orientation residuals that another convention leaves where it is certain, whatever noise is declared. By
the same study no effect is so much like a convention."""
CONVENTION_ROWS = 20
"""Number of poses below which nothing is reported. Assumed."""

# The quick fit before the fit

ENOUGH_ROWS = 150
"""Number of rows that are enough for the decision. Assumed."""
COARSE_NOISE = 1e-3
"""Noise, m and rad, of the first fit: with less, the cost is a narrow curved valley far from its minimum."""
ANOTHER_TOLERANCES, ANOTHER_ROBOT = 50.0, {"m": 0.02, "rad": 0.05}
"""Deviation of a parameter from nominal, in units of its tolerance, and in m and rad, that no machine has. Assumed: a fit that
needs more makes up for a mistake."""
QUICK_STEPS = 15
"""Largest number of steps of each fit."""

# After the fit

MOST_GROSS = 0.25
"""Largest share of the rows that can be gross errors: with more, it is not clear which rows are wrong. Assumed."""
POOR = 1e-3
"""Position error, m, after a calibration, above which few effects leave any: other mistakes are looked for. Also the median
error of rows that were set aside, above which they belong to another measurement. Assumed."""
ROUNDED = 0.1, 1.5
"""Error of the commands over the step: at least in the median, at most in nine tenths of the rows. Assumed:
rounding makes up to a half, truncation up to one, and the geometry's own errors come on top."""
MOST_GROSS_READINGS = 0.5
"""Largest share of gross errors among an instrument's rows; above it, it is not clear which rows are the errors. Assumed."""
SEVERAL_READINGS = 3
"""Fewest readings of one id for a message that most of them were set aside. Assumed."""
GEOMETRY_CHANCE = 1e-6
"""Probability, by the tolerances, of a geometry that is at least as far from nominal as a whole, below which something is
declared wrongly. Assumed."""

# Declared noise

NOISE_SUSPECT = 0.7
"""Root mean square of the residuals over the declared sigma below which the noise is estimated for comparison. Assumed: it
only saves a second fit in clear cases."""
NOISE_TWICE = 2.0
"""Declared noise over the noise that the data show from which the declared value is not used. Assumed: data
sheets give limits of two standard deviations as often as one, and less than that changes no verdict."""
NOISE_OVERSTATED = 10.0
"""Declared noise over the noise that the data show from which the data are refused: no data sheet overstates the noise so much.
Assumed."""
NO_NOISE = 0.01
"""Noise, m or rad, above that of any instrument for robots: residuals of this size are not noise. Assumed."""
NOISE_CHANCE = 1e-3
"""Probability, by chi-square, of residuals as small as these under the declared noise, below which the declared value is not
used. Assumed."""
NOISE_UNITS = {
    "m": ((250.0, 4e3, "millimetres"), (2.5e5, 4e6, "micrometres")),
    "rad": ((25.0, 150.0, "degrees"), (250.0, 4e3, "milliradians"), (2.5e5, 4e6, "microradians")),
}
"""Ratios (a factor of four to either side of a unit's own, less for degrees) and the unit that they look like."""

# Other readings of instruments

NO_TURN = 0.2
"""Median error of a tilt or an orientation, rad, that no robot within its tolerances shows. Assumed."""
READ_SUSPECT = 0.05
"""Share of the largest error within tolerances from which other ways to read a table are tried. Assumed."""
READ_LEFT = 0.2
"""Share of the largest error within tolerances, m, that the median error stays below where a fit has found its minimum.
Assumed."""
READ_FAR = 10.0
"""Deviation of an unknown from its declared value, in prior sigmas, from which other ways to read a table are tried too.
Assumed."""
READ_FARTHEST = 30.0
"""Deviation of an unknown from its declared value after a fit, in prior sigmas, with which the data are not fitted. Assumed."""
USUAL_ERROR = 1e-3
"""Usual error of a nominal robot, m and rad: it counts as much as a deviation of one prior sigma. Assumed."""
VARIATION = 0.3
"""Largest error, as a share of a column's variation, with which a unit that makes the column's numbers smaller is accepted:
with numbers near zero, a wrong unit fits any robot that hardly moves. Assumed."""
READ_BETTER = 10.0
"""Ratio of errors from which another way to read a table is the right one. Assumed: a wrong unit makes hundreds."""
ANY_ZERO = 1e3
"""Prior sigma of an encoder's zero, rad or m, with which the zero is practically free."""

# Motions of the instrument, and commands of other rows

STRETCH_ROWS = 8
"""Fewest rows of a stretch, a sequence of rows, and before, between and after steps. Assumed: eight consecutive rows with large
errors are not due to chance. A motion has six numbers and fits any one row: one large error would count as two steps."""
STRETCH_SHARE = 0.1
"""Share of rows with large errors from which a stretch is searched for: the largest share that scattered gross errors have."""
STRETCH_WITHIN = 0.6
"""Smallest share of a stretch's rows that have large errors, and of all rows with large errors that are in it."""
STRETCH_LEFT = 0.1
"""Largest share of a stretch's error that remains after the correction. Assumed: a neighbour's command or a moved frame
explains the whole error or nothing."""
OWN_SESSION = 0.8
"""Share of a session's rows that must lie in a stretch for the session to be the stretch's own."""
STEP_SIZE = 30.0
"""Prior standard deviation of a step, mm and mrad; so wide that its value has little influence on the fit. Assumed."""
STEP_GRID = 60
"""Number of rows that are tried first; then all those near the best one."""
STEP_RATIO = 2.0
"""Power of the residuals without steps over that with them from which steps are the reason. Assumed: a moved frame
explains all residuals, other causes only a part."""
STEP_LARGE = 4.0
"""Size of the step at the median pose, in standard deviations of the remaining residuals, from which data are refused. Assumed:
smaller steps are left to a diagnosis, which compares them with drift and other causes."""
STEP_AHEAD = 1.2
"""Ratio of the best alternative's residual power to that of steps, above which steps are the reason. The alternatives are
motions in proportion to time (to its third power), temperatures, payload or another recorded column that changes slowly.
Assumed; with 150 poses of six numbers it is a log likelihood ratio of 80 nats."""
SESSION_FAR = 0.01
"""Motion, m, from which data are refused before a fit, or after a poor one. Assumed: with such motions no diagnosis is linear
about one frame."""
SESSION_FAILED = 1e-3
"""Motion, m, from which data are refused after a fit has failed. Assumed."""
SESSION_CLEAR = 4.0
"""Ratio of a motion to the residuals with a separate frame for each session, above which the motion is clear. Assumed."""
SESSION_EXPECTED = 3.0
"""Ratio of a motion to the expected error of the nominal model, above which the motion is clear: the best frame for a part of
the workspace absorbs such errors. Assumed."""
SESSION_BEYOND = 0.1
"""Motion, m, that is too large to be an error of the geometry. Assumed."""
SESSION_RATIO = 4.0
"""Power of the residuals without motions over that with them from which motions are why a fit failed. Assumed."""

# Priors and data

SCALES = (1.0, 3.0, 10.0, 30.0, 100.0, 300.0)
"""Sizes that are tried: of a frame's shift and turn and of a zero in mm and mrad."""
FACTORS = (2.0, 3.0, 5.0, 10.0, 20.0, 50.0)
"""Factors that are tried on tolerances."""
CONFLICT = 7.0
"""Gain in log marginal likelihood, nats, from which an assumption is wrong: ln(1,000) rounded up. For each assumption and size
it occurs by chance in at most 1 of 1,000 machines, because the mean of a Bayes factor is 1 where the assumption is right."""
MAY_EXPLAIN = 0.9
"""Share of the squares that an unknown place of the target leaves, to first order, below which it is fitted. Wrong places of 85
and 120 mm left 0.23 and 0.76; elastic drives, a wrong scale and a hose 0.93 and more."""
WIDENED = 3.0
"""Deviation of a parameter, in units of its tolerance, above which the deviation becomes its tolerance. Assumed."""

# Constant orientations

SAME_TURN = 1e-12
"""1 less the cosine of half the angle, some 3 microradians, up to which orientations count as the same."""
TURNS = 1e-5
"""Angle, rad, by which the nominal orientation must change; less is rounding error of a robot that keeps its orientation."""
