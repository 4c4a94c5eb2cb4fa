"""Diagnosis: where the gap between simulation and reality lies, which effects cause it, and how much they explain.

How a verdict comes about, in the order of docs/statistics.md:

- ``evidence.py``: the log Bayes factor of a model in closed form, and its scales (sections 4 and 5). The linear problem is made
  in ``design.py`` (3), and periods and places are scanned in ``scan.py`` (6).
- ``hypothesis_set.py``: the terms of a model and their prior odds (7). ``search.py``: the search for the most probable model
  (8). ``periodic_lines.py``: the periods of one drive (6).
- ``classes.py``: what else each cause could be, with probabilities (10).
- ``verdict.py``: named causes against smooth terms, and the verdict (9 and 11). ``doubts.py`` lists all other reasons for
  ``unknown``.
- ``diagnose.py``: the five steps, from the dataset to the result.

What can explain a gap is in ``hypothesis.py``, ``smooth_terms.py`` and ``propose.py``. ``noise.py`` is section 2,
``joint_fit.py`` 12, ``gap.py`` 13, ``earlier.py`` and ``against.py`` 14. ``trials.py``, ``discrimination.py`` and
``next_experiment.py`` plan what to measure next.
"""
