"""Limits of the checks of measured data that have a source, or that several checks share.

A limit that is assumed, and used in one place, is a number there.
"""

from __future__ import annotations

# What follows from a suspicion

NO_EFFECT: tuple[float, float] = (1e-2, 2e-2)
"""Residuals of a fit, m and rad, that no effect of the catalogue leaves. Assumed."""
MISFIT = 10.0
"""Size of a fit's residuals, in units of the noise, from which there is a warning. Assumed."""
FAR_FROM_PRIOR = 6.0
"""Deviation of a parameter from nominal, in units of its tolerance, and of an unknown from what is declared, in prior sigmas,
from which there is a warning. Assumed."""
NAMED = 5
"""Largest number of parameters, or sessions, that a message names."""
USUAL_NOISE: tuple[float, float] = (1e-4, 3e-4)
"""Noise of a usual instrument, m and rad, where none is declared. Assumed."""

# Other readings of poses, compared with the nominal model

FEWEST_ROWS = 6
"""Number of rows below which a free frame fits almost any data, and nothing is compared or fitted. Assumed."""
ACCEPTED = 0.1
"""Share of the workspace's size up to which data fit without a correction. The mistakes below move poses by about the whole
size. Machines within the tolerances of the shipped robots stay below 0.08, except those of stewart_jugglebot."""
ALLOWED = 5e-3
"""Error of a machine, m, that is always accepted, even in a small workspace. Assumed."""
BETTER = 4.0
"""Factor by which another reading must bring the data nearer to the nominal model. Assumed."""
MORE_MISTAKES = 5.0
"""Factor by which a reading with more mistakes must be nearer than one with fewer. Assumed: of two zeros of a five-bar that are
off by 17 and 11 degrees, one zero and a free frame leave 7 times as much as the two (tests/calibration/test_recognise.py)."""
AS_GOOD, CLOSE = 1.5, 0.02
"""A reading with fewer mistakes is preferred where its misfit is at most `AS_GOOD` times the smallest one plus `CLOSE` times
the workspace's size. Assumed."""
LINE = 0.1
"""Ratio of a workspace's width to its length below which positions do not determine a rotation about its length. Assumed."""
REACHED = 0.75
"""Share of the rows that the nominal model must reach when commands are read in another way. Assumed."""

# Fits before, during and after the fit

CONVENTION_LEFT, CONVENTION_GAIN = 0.8, 60.0
"""Share of the squared orientation residuals that another convention may leave, and the least by which it lowers them: a
factor of exp(30) in likelihood, over some 150 readings. A convention has no free parameter: with residuals of effects, no
other convention left less than 0.96 (80 fits of 40 machines of the plant); a runout in one of 200 sealed cases left 0.77."""
CONVENTION_CERTAIN = 0.1
"""Share of the squared orientation residuals that another convention leaves where it is certain, whatever noise is declared. By
the same study no effect is so much like a convention."""
ENOUGH_ROWS = 150
"""Number of rows that are enough for the decision. Assumed."""
ANOTHER_TOLERANCES = 50.0
"""Deviation of a parameter from nominal, in units of its tolerance, that no machine has. Assumed."""
MOST_GROSS, MOST_GROSS_READINGS = 0.25, 0.5
"""Largest share of the rows, and of an instrument's rows, that can be gross errors: with more, it is not clear which rows are
wrong. Assumed."""
POOR = 1e-3
"""Position error, m, after a calibration, above which few effects leave any: other mistakes are looked for. Also the median
error of rows that were set aside, above which they belong to another measurement. Assumed."""
NOISE_OVERSTATED = 10.0
"""Declared noise over the noise that the data show from which the data are refused: no data sheet overstates the noise so much.
Assumed."""

# Other readings of instruments

READ_SUSPECT, READ_LEFT = 0.05, 0.2
"""Shares of the largest error within tolerances: from the first on, other ways to read a table are tried; below the second is
the median error where a fit has found its minimum. Assumed."""
VARIATION = 0.3
"""Largest error, as a share of a column's variation, with which a unit that makes the column's numbers smaller is accepted:
with numbers near zero, a wrong unit fits any robot that hardly moves. Assumed."""
READ_BETTER = 10.0
"""Ratio of errors from which another way to read a table is the right one. Assumed: a wrong unit makes hundreds."""

# Motions of the instrument, and commands of other rows

STRETCH_ROWS = 8
"""Fewest rows of a stretch, a sequence of rows, and before, between and after steps. Assumed: eight consecutive rows with large
errors are not due to chance. A motion has six numbers and fits any one row: one large error would count as two steps."""
STEP_SIZE = 30.0
"""Prior standard deviation of a step, mm and mrad; so wide that its value has little influence on the fit. Assumed."""
STEP_RATIO = 2.0
"""Power of the residuals without steps over that with them from which steps are the reason. Assumed: a moved frame
explains all residuals, other causes only a part."""
SESSION_FAR = 0.01
"""Motion, m, from which data are refused before a fit, or after a poor one. Assumed: with such motions no diagnosis is linear
about one frame."""

# Priors and data

SCALES = (1.0, 3.0, 10.0, 30.0, 100.0, 300.0)
"""Sizes that are tried: of a frame's shift and turn and of a zero in mm and mrad."""
FACTORS = (2.0, 3.0, 5.0, 10.0, 20.0, 50.0)
"""Factors that are tried on tolerances."""
CONFLICT = 7.0
"""Gain in log marginal likelihood, nats, from which an assumption is wrong: ln(1,000) rounded up. For each assumption and size
it occurs by chance in at most 1 of 1,000 machines, because the mean of a Bayes factor is 1 where the assumption is right."""
