"""Measuring by rendering: which choice is right, and which is cheapest, on a scene.

`trials` renders combinations of choices by turns.  `agreement` says whether pictures agree, `efficiency` how
much cheaper one is: pure functions on arrays.  `selftests` judges the choices of a scene against each other,
`pilot` picks the cheapest.  `clvol.lab.comparison`, which writes reports, builds on these.
"""
